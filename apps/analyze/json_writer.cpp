#include <dashpot/apps/analyze/json_writer.hpp>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace dashpot::apps {
namespace {

using Json = nlohmann::ordered_json;

Json to_value(const analysis::Complex& value) {
  return Json::array({value.real(), value.imag()});
}

template <class Derived>
Json list(const Eigen::MatrixBase<Derived>& vector) {
  Json result = Json::array();
  for (Eigen::Index i = 0; i < vector.size(); ++i) {
    if constexpr (Eigen::NumTraits<typename Derived::Scalar>::IsComplex) {
      result.push_back(to_value(vector(i)));
    } else {
      result.push_back(vector(i));
    }
  }
  return result;
}

Json rows(const Eigen::MatrixXd& matrix) {
  Json result = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) result.push_back(list(matrix.row(i)));
  return result;
}

Json to_value(const analysis::Mode<>& mode) {
  return {
      {"eigenvalues", Json::array({to_value(mode.eigenvalues[0]), to_value(mode.eigenvalues[1])})},
      {"natural_frequency", mode.natural_frequency},
      {"damping_ratio", mode.damping_ratio},
      {"damped_frequency", mode.damped_frequency},
      {"kind", analysis::to_text(mode.kind)},
      {"shape", list(mode.shapes[0])},
      {"backward_error", mode.backward_error},
      {"condition", mode.condition},
      {"error_bound", mode.error_bound},
      {"eigenvalue_bounds", mode.eigenvalue_bounds},
      {"natural_frequency_bound", mode.natural_frequency_bound},
      {"damping_ratio_bound", mode.damping_ratio_bound}};
}

Json modes(const analysis::Spectrum<>& spectrum) {
  Json result = Json::array();
  for (const analysis::Mode<>& mode : spectrum.modes) result.push_back(to_value(mode));
  return result;
}

Json to_value(const ReportedResponse& response) {
  Json result = {{"times", response.times},
                 {"position", Json::array()},
                 {"velocity", Json::array()},
                 {"zero_mode_position", Json::array()}};
  for (const analysis::Motion& motion : response.motions) {
    result["position"].push_back(list(motion.position));
    result["velocity"].push_back(list(motion.velocity));
    result["zero_mode_position"].push_back(list(motion.zero_mode_position));
  }
  return result;
}

Json to_value(const Report& report) {
  const analysis::Spectrum<>& spectrum = report.spectrum;
  const analysis::ZeroModes<>& zero_modes = spectrum.zero_modes;
  Json result = {
      {"status", analysis::to_text(spectrum.status)},
      {"notes", report.notes},
      {"dof", report.dof},
      {"modes", modes(spectrum)},
      {"zero_modes", rows(zero_modes.basis.transpose())},
      {"zero_mode_rates", list(spectrum.zero_mode_rates.head(zero_modes.count))},
      {"zero_mode_rates_bound", list(spectrum.zero_mode_rates_bound.head(zero_modes.count))},
      {"rank_gap",
       {{"floor", zero_modes.floor},
        {"smallest_kept", zero_modes.smallest_kept},
        {"largest_dropped", zero_modes.largest_dropped}}},
      {"coupling", spectrum.coupling},
      {"coupled", spectrum.coupled},
      {"symmetric", spectrum.symmetric},
      {"proportional", spectrum.proportional},
      {"extended", spectrum.extended},
      {"constraint_matrix", rows(report.elimination.constraint_matrix)},
      {"eliminated", report.elimination.eliminated},
      {"reduced",
       {{"mass", rows(report.elimination.mass)},
        {"damping", rows(report.elimination.damping)},
        {"stiffness", rows(report.elimination.stiffness)}}}};
  if (report.response) result["response"] = to_value(*report.response);
  return result;
}

/// The value on one line, in ASCII: other characters as \u00e9, what is not UTF-8 as \ufffd. Names
/// of robots and files come from elsewhere, and must neither end the program nor steer a terminal.
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

Json report_json(const Report& report) {
  return to_value(report);
}

Json modes_json(const analysis::Spectrum<>& spectrum) {
  return modes(spectrum);
}

std::string json_text(const Json& document) {
  std::string text;
  write(document, "", text);
  return text + '\n';
}

std::string to_json(const std::vector<Report>& reports, bool as_list) {
  Json document = Json::array();
  for (const Report& report : reports) document.push_back(to_value(report));
  return json_text(as_list ? document : document.at(0));
}

}  // namespace dashpot::apps
