#include <dashpot/analysis/mode.hpp>
#include <dashpot/analysis/solver_status.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/controller/drives.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/tick_status.hpp>
#include <dashpot/lcmtypes/message_fields.hpp>

#include <type_traits>
#include <vector>

namespace dashpot::apps {
namespace {

Json mode_json(const analysis::Mode<>& mode) {
  return {{"eigenvalues",
           Json::array({json_complex(mode.eigenvalues[0]), json_complex(mode.eigenvalues[1])})},
          {"natural_frequency", mode.natural_frequency},
          {"damping_ratio", mode.damping_ratio},
          {"damped_frequency", mode.damped_frequency},
          {"kind", analysis::to_text(mode.kind)},
          {"shape", json_list(mode.shapes[0])},
          {"backward_error", mode.backward_error},
          {"condition", mode.condition},
          {"error_bound", mode.error_bound},
          {"eigenvalue_bounds", mode.eigenvalue_bounds},
          {"natural_frequency_bound", mode.natural_frequency_bound},
          {"damping_ratio_bound", mode.damping_ratio_bound}};
}

/// The value on one line, in ASCII: other characters as \u00e9, invalid UTF-8 as \ufffd. Names of
/// robots and files come from elsewhere, and must neither end the program nor steer a terminal.
std::string one_line(const Json& value) {
  return value.dump(-1, ' ', true, Json::error_handler_t::replace);
}

/// Objects and lists of objects get a line for each item; numbers, vectors and matrices stay on
/// one.
void write(const Json& value, const std::string& indent, std::string& out) {
  const bool spread =
      value.is_object() || (value.is_array() && !value.empty() && value.front().is_object());
  if (!spread || value.empty()) {
    out += one_line(value);
    return;
  }
  const std::string inner = indent + "  ";
  const char* separator = "\n";
  out += value.is_object() ? '{' : '[';
  for (const auto& [key, item] : value.items()) {
    out += separator + inner;
    if (value.is_object()) out += one_line(key) + ": ";
    write(item, inner, out);
    separator = ",\n";
  }
  out += '\n' + indent + (value.is_object() ? '}' : ']');
}

}  // namespace

Json json_complex(const analysis::Complex& value) {
  return Json::array({value.real(), value.imag()});
}

Json json_rows(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) rows.push_back(json_list(matrix.row(i)));
  return rows;
}

Json modes_json(const analysis::Spectrum<>& spectrum) {
  Json result = Json::array();
  for (const analysis::Mode<>& mode : spectrum.modes) result.push_back(mode_json(mode));
  return result;
}

Json drives_json(const std::string& name) {
  const controller::Drives& drives = controller::find_drives(name);
  return {{"name", drives.name},
          {"reflected_inertia", json_list(drives.values(drives.reflected_inertia))},
          {"viscous_friction", json_list(drives.values(drives.viscous_friction))},
          {"coulomb_friction", json_list(drives.values(drives.coulomb_friction))},
          {"source", drives.source},
          {"doubt", drives.doubt}};
}

std::string json_text(const Json& document) {
  std::string text;
  write(document, "", text);
  return text + '\n';
}

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
