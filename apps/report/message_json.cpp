#include <dashpot/analysis/mode.hpp>
#include <dashpot/analysis/solver_status.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/message_json.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/tick_status.hpp>
#include <dashpot/lcmtypes/message_fields.hpp>

#include <string>
#include <type_traits>
#include <vector>

namespace dashpot::apps {
namespace {

// The text beside a number, for the enumerations that have one.
const char* status_text(const state_t& /*of*/, std::int8_t status) {
  return controller::to_text(static_cast<controller::Status>(status));
}
const char* status_text(const auto& /*modes*/, std::int8_t status) {
  return analysis::to_text(static_cast<analysis::Status>(status));
}

const char* kind_text(std::int8_t kind) {
  return analysis::to_text(static_cast<analysis::ModeKind>(kind));
}

std::vector<std::string> assumed(std::int32_t bits) {
  return controller::assumption_names(static_cast<std::uint32_t>(bits));
}
std::vector<std::string> assumed(const auto& /*no such field*/) {
  return {};
}

Json schema_of(const Json& value) {
  if (value.is_object()) {
    Json schema{{"type", "object"}, {"properties", Json::object()}};
    for (const auto& [key, item] : value.items()) schema["properties"][key] = schema_of(item);
    return schema;
  }
  if (value.is_array()) {
    return {{"type", "array"},
            {"items",
             value.empty() ? Json{{"type", Json({"number", "null"})}} : schema_of(value.front())}};
  }
  if (value.is_string()) return {{"type", "string"}};
  if (value.is_number_integer()) return {{"type", "integer"}};
  // A plain "number": readers of MCAP take the first type of a list for all, and null for NaN.
  return {{"type", "number"}};
}

}  // namespace

template <class Message>
Json message_json(const Message& message) {
  Json json;
  lcmtypes::visit_fields<Message>([&](const std::string& name, auto field) {
    const auto& value = message.*field;
    json[name] = value;
    using Value = std::remove_cvref_t<decltype(value)>;
    if constexpr (std::is_same_v<Value, std::int8_t>) {
      if (name == "status" || name == "fault") json[name + "_text"] = status_text(message, value);
    } else if constexpr (std::is_same_v<Value, std::vector<std::int8_t>>) {
      json[name + "_text"] = Json::array();
      for (const std::int8_t kind : value) json[name + "_text"].push_back(kind_text(kind));
    }
    if (name == "assumes") json[name + "_text"] = assumed(value);
  });
  return json;
}
template Json message_json(const state_t& message);
template Json message_json(const contact_t& message);
template Json message_json(const modes_t& message);
template Json message_json(const sampled_modes_t& message);

Json json_schema(const Json& example, const std::string& title) {
  Json schema = schema_of(example);
  schema["$schema"] = "http://json-schema.org/draft-07/schema#";
  schema["title"] = title;
  return schema;
}

}  // namespace dashpot::apps
