#include <dashpot/apps/report/modes.hpp>
#include <dashpot/apps/report/system_report.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/text/printable.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace dashpot::apps {
namespace {

ReportedResponse respond(const SystemEntry& entry, const analysis::System<>& system,
                         const analysis::Spectrum<>& spectrum) {
  const analysis::Response response(system, spectrum);
  const analysis::Cause cause{entry.initial_position, entry.initial_velocity, entry.impulse,
                              entry.force};
  ReportedResponse result;
  for (const double time : *entry.times) {
    result.times.push_back(time);
    result.motions.push_back(response.caused(cause, time));
  }
  const Eigen::Index n = system.dof();
  const bool task = entry.impedance.jacobian && entry.impedance.jacobian->rows() > 0;
  result.point = task ? "the directions of jacobian" : "the coordinates";
  result.shares = analysis::mode_shares(
      system, spectrum, cause,
      task ? *entry.impedance.jacobian : Eigen::MatrixXd(Eigen::MatrixXd::Identity(n, n)));
  return result;
}

std::vector<std::string> notes_on(const SystemEntry& entry, const analysis::System<>& system,
                                  const analysis::Spectrum<>& spectrum) {
  std::vector<std::string> notes;
  if (system.dof() > 0 && !entry.impedance.damping && !entry.impedance.task_damping) {
    notes.emplace_back("no damping given: taken as zero");
  }
  if (!spectrum.symmetric) {
    const bool damping = system.damping != system.damping.transpose();
    const bool stiffness = system.stiffness != system.stiffness.transpose();
    notes.push_back(std::string(damping && stiffness ? "damping and stiffness are"
                                : damping            ? "damping is"
                                                     : "stiffness is") +
                    " not symmetric: solved as a general problem");
  }
  if (spectrum.coupled) {
    notes.emplace_back("the damping couples zero modes and vibrations: solved together");
  }
  if (spectrum.status != analysis::Status::kOk) {
    notes.emplace_back(analysis::to_text(spectrum.status));
  }
  const bool causes =
      entry.initial_position || entry.initial_velocity || entry.impulse || entry.force;
  if (causes && !entry.times) notes.emplace_back("no times given: no response computed");
  if (entry.times && !causes) {
    notes.emplace_back(
        "times without initial_position, initial_velocity, impulse or force: nothing moves");
  }
  return notes;
}

Json response_json(const ReportedResponse& response) {
  Json result = {{"shares", shares_json(response.shares)},
                 {"times", response.times},
                 {"position", Json::array()},
                 {"velocity", Json::array()},
                 {"zero_mode_position", Json::array()}};
  for (const analysis::Motion& motion : response.motions) {
    result["position"].push_back(json_list(motion.position));
    result["velocity"].push_back(json_list(motion.velocity));
    result["zero_mode_position"].push_back(json_list(motion.zero_mode_position));
  }
  return result;
}

using Align = TextTable::Align;
constexpr std::size_t kWidth = 100;
constexpr const char* kShapeHeading = "shape, relative to its largest entry (phase if over 10 deg)";

/// Returns the number after the real part of the first eigenvalue: the imaginary part of a complex
/// pair, or the second of two real eigenvalues.
std::string second_eigenvalue(const analysis::Mode<>& mode) {
  const analysis::Complex first = mode.eigenvalues[0];
  if (first.imag() == 0) return format_number(mode.eigenvalues[1].real(), 6);
  return "+- " + format_number(std::abs(first.imag()), 6) + "i";
}

/// The bound of a complex pair, or the bounds of two real eigenvalues.
std::string eigenvalue_bounds(const analysis::Mode<>& mode) {
  if (mode.eigenvalues[0].imag() != 0) return format_bound(mode.error_bound);
  return format_bound(mode.eigenvalue_bounds[0]) + " " + format_bound(mode.eigenvalue_bounds[1]);
}

class Writer {
 public:
  explicit Writer(bool bold) : bold_(bold) {}

  void write(const Report& report, const std::string& label) {
    const analysis::Spectrum<>& spectrum = report.spectrum;
    heading(label + count(report.dof, "coordinate", "no") + ": " +
            count(spectrum.modes.size(), "vibration mode", "no") + ", " +
            count(spectrum.zero_modes.count, "zero mode", "no"));
    for (const std::string& note : report.notes) out_ += "  Note: " + note + "\n";
    if (!spectrum.modes.empty()) write_modes(spectrum);
    if (report.dof > 0) write_zero_modes(report);
    if (report.response && !report.response->times.empty()) {
      write_response(*report.response, report);
    }
  }

  void blank_line() { out_ += '\n'; }
  std::string take() { return std::move(out_); }

 private:
  void heading(const std::string& text) {
    out_ += bold_ ? "\033[1m" + text + "\033[0m\n" : text + "\n";
  }

  void write_modes(const analysis::Spectrum<>& spectrum) {
    TextTable table({{Align::kRight, {"", "mode"}},
                     {Align::kPoint, {"natural", "rad/s"}},
                     {Align::kPoint, {"frequency", "Hz"}},
                     {Align::kPoint, {"damping", "ratio"}},
                     {Align::kLeft, {"", "kind"}},
                     {Align::kPoint, {"eigenvalues", "1/s"}},
                     {Align::kLeft, {"", ""}},
                     {Align::kRight, {"error <", "1/s"}},
                     {Align::kRight, {"backward", "error"}}});
    TextTable shapes({{Align::kRight, {"mode"}}, {Align::kLeft, {kShapeHeading}}});
    for (int i = 0; i < spectrum.modes.size(); ++i) {
      const analysis::Mode<>& mode = spectrum.modes[i];
      const std::string number = std::to_string(i + 1);
      table.add_row({number, format_number(mode.natural_frequency, 6),
                     format_number(mode.natural_frequency / (2 * std::numbers::pi), 6),
                     format_number(mode.damping_ratio, 6), analysis::to_text(mode.kind),
                     format_number(mode.eigenvalues[0].real(), 6), second_eigenvalue(mode),
                     eigenvalue_bounds(mode), format_number(mode.backward_error, 2)});
      shapes.add_row({number, format_shape(mode.shapes[0], kWidth - 10)});
    }
    out_ += '\n' + table.text() + '\n' + shapes.text();
  }

  void write_zero_modes(const Report& report) {
    const analysis::Spectrum<>& spectrum = report.spectrum;
    const analysis::ZeroModes<>& zero = spectrum.zero_modes;
    if (zero.count > 0) {
      TextTable table({{Align::kRight, {"", "zero mode"}},
                       {Align::kRight, {"velocity", "decays, 1/s"}},
                       {Align::kRight, {"error <", "1/s"}},
                       {Align::kLeft, {"", kShapeHeading}}});
      for (int i = 0; i < zero.count; ++i) {
        table.add_row({std::to_string(i + 1), format_number(-spectrum.zero_mode_rates[i], 6),
                       format_bound(spectrum.zero_mode_rates_bound[i]),
                       format_shape(zero.basis.col(i).cast<analysis::Complex>(), kWidth - 40)});
      }
      out_ += '\n' + table.text();
    }
    out_ += "\n  Rank: " + count(zero.count, "zero mode", "no") + ";";
    if (zero.count < report.dof) {
      out_ += " smallest frequency kept " + format_number(zero.smallest_kept, 3) + ",";
    }
    if (zero.count > 0) {
      out_ += " largest dropped " + format_number(zero.largest_dropped, 2) + ",";
    }
    out_ += " floor " + format_number(zero.floor, 2) + " rad/s.\n";
    if (zero.count == 0 || zero.count == report.dof) return;
    out_ += "  Coupling of zero modes and vibrations by the damping: " +
            format_number(spectrum.coupling, 2) +
            (spectrum.coupled ? ", solved together.\n" : ", independent.\n");
    out_ += "  The constraint matrix (--json) eliminates";
    for (std::size_t i = 0; i < report.elimination.eliminated.size(); ++i) {
      out_ += (i == 0 ? " " : ", ") + joint_name(report.elimination.eliminated[i]);
    }
    out_ += ".\n";
  }

  void write_response(const ReportedResponse& response, const Report& report) {
    blank_line();
    heading("Shares of the modes");
    out_ += shares_table(report.spectrum, response.shares, response.point);
    write_motion("Position", response, &analysis::Motion::position, report.dof);
    write_motion("Velocity", response, &analysis::Motion::velocity, report.dof);
    if (report.spectrum.zero_modes.count > 0) {
      write_motion("Position, part along the zero modes", response,
                   &analysis::Motion::zero_mode_position, report.dof);
    }
  }

  void write_motion(const std::string& title, const ReportedResponse& response,
                    Eigen::VectorXd analysis::Motion::*part, Eigen::Index n) {
    constexpr Eigen::Index kColumns = 7;
    blank_line();
    heading(title);
    std::vector<std::string> times;
    for (const double time : response.times) times.push_back(text::number(time));
    const double negligible = 1e-13 * largest(response, part);
    for (Eigen::Index first = 0; first < n; first += kColumns) {
      TextTable table;
      table.add_column(Align::kPoint, {"t, s"}, times);
      for (Eigen::Index i = first; i < std::min(first + kColumns, n); ++i) {
        std::vector<double> values;
        for (const analysis::Motion& motion : response.motions) {
          const double value = (motion.*part)[i];
          values.push_back(std::abs(value) <= negligible ? 0 : value);
        }
        table.add_column(Align::kRight, {joint_name(i)}, format_column(values, 5));
      }
      if (first > 0) blank_line();
      out_ += table.text();
    }
  }

  static double largest(const ReportedResponse& response, Eigen::VectorXd analysis::Motion::*part) {
    double result = 0;
    for (const analysis::Motion& motion : response.motions) {
      for (const double value : motion.*part) {
        if (std::isfinite(value)) result = std::max(result, std::abs(value));
      }
    }
    return result;
  }

  bool bold_;
  std::string out_;
};

}  // namespace

Report make_report(const SystemEntry& entry, const analysis::System<>& system,
                   const analysis::SpectrumOptions& options, analysis::Pivot pivot) {
  Report report;
  report.dof = system.dof();
  report.spectrum = analysis::analyze(system, options);
  report.elimination = analysis::eliminate_zero_modes(system, report.spectrum.zero_modes, pivot);
  if (entry.times) report.response = respond(entry, system, report.spectrum);
  report.notes = notes_on(entry, system, report.spectrum);
  return report;
}

Json report_json(const Report& report) {
  const analysis::Spectrum<>& spectrum = report.spectrum;
  const analysis::ZeroModes<>& zero_modes = spectrum.zero_modes;
  Json result = {
      {"status", analysis::to_text(spectrum.status)},
      {"notes", report.notes},
      {"dof", report.dof},
      {"modes", modes_json(spectrum)},
      {"zero_modes", json_rows(zero_modes.basis.transpose())},
      {"zero_mode_rates", json_list(spectrum.zero_mode_rates.head(zero_modes.count))},
      {"zero_mode_rates_bound", json_list(spectrum.zero_mode_rates_bound.head(zero_modes.count))},
      {"rank_gap",
       {{"floor", zero_modes.floor},
        {"smallest_kept", zero_modes.smallest_kept},
        {"largest_dropped", zero_modes.largest_dropped}}},
      {"coupling", spectrum.coupling},
      {"coupled", spectrum.coupled},
      {"symmetric", spectrum.symmetric},
      {"proportional", spectrum.proportional},
      {"extended", spectrum.extended},
      {"constraint_matrix", json_rows(report.elimination.constraint_matrix)},
      {"eliminated", report.elimination.eliminated},
      {"reduced",
       {{"mass", json_rows(report.elimination.mass)},
        {"damping", json_rows(report.elimination.damping)},
        {"stiffness", json_rows(report.elimination.stiffness)}}}};
  if (report.response) result["response"] = response_json(*report.response);
  return result;
}

std::string to_json(const std::vector<Report>& reports, bool as_list) {
  Json document = Json::array();
  for (const Report& report : reports) document.push_back(report_json(report));
  return json_text(as_list ? document : document.at(0));
}

std::string to_table(const std::vector<Report>& reports, bool as_list, bool bold) {
  if (reports.empty()) return "no systems\n";
  Writer writer(bold);
  for (std::size_t i = 0; i < reports.size(); ++i) {
    if (i > 0) writer.blank_line();
    writer.write(reports[i], as_list ? "[" + std::to_string(i) + "] " : "");
  }
  return writer.take();
}

}  // namespace dashpot::apps
