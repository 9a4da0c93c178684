#include <dashpot/apps/report/json.hpp>
#include <dashpot/controller/drives.hpp>

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

}  // namespace dashpot::apps
