#pragma once
#include <dashpot/lcmtypes/contact_t.hpp>
#include <dashpot/lcmtypes/modes_t.hpp>
#include <dashpot/lcmtypes/sampled_modes_t.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <nlohmann/json.hpp>

namespace dashpot::apps {

/// Returns a message as a JSON object with the fields of its .lcm file by their names, in their
/// units. Enumerations have a text beside their number ("status_text"). NaN and infinity become
/// null in the text.
template <class Message>
nlohmann::ordered_json message_json(const Message& message);

/// Returns the JSON schema (draft 7) of an object that message_json returned: every key with its
/// type. Readers of MCAP need one type for each key, so the schema omits the null of numbers that
/// are not finite.
nlohmann::ordered_json json_schema(const nlohmann::ordered_json& example, const std::string& title);

}  // namespace dashpot::apps
