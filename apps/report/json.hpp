#pragma once
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/lcmtypes/contact_t.hpp>
#include <dashpot/lcmtypes/modes_t.hpp>
#include <dashpot/lcmtypes/sampled_modes_t.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <string>

namespace dashpot::apps {

/// Every number of a report can be read back exactly; NaN and infinity are null.
using Json = nlohmann::ordered_json;

/// Returns [re, im].
Json json_complex(const analysis::Complex& value);
/// Returns the entries of a vector.
template <class Derived>
Json json_list(const Eigen::MatrixBase<Derived>& vector) {
  Json list = Json::array();
  for (Eigen::Index i = 0; i < vector.size(); ++i) {
    if constexpr (Eigen::NumTraits<typename Derived::Scalar>::IsComplex) {
      list.push_back(json_complex(vector(i)));
    } else {
      list.push_back(vector(i));
    }
  }
  return list;
}
/// Returns a list for each row.
Json json_rows(const Eigen::MatrixXd& matrix);

/// Returns the modes of a spectrum. docs/command-line.md lists the keys.
Json modes_json(const analysis::Spectrum<>& spectrum);

/// Returns figures, source and doubt of the published drives of this name.
Json drives_json(const std::string& name);

/// Returns the text of a document: objects take a line for each item, numbers and matrices stay on
/// one.
std::string json_text(const Json& document);

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
