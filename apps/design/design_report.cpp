#include <dashpot/apps/design/design_report.hpp>
#include <dashpot/apps/report/modes.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/controller/posture_loop.hpp>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace dashpot::apps {
namespace {

using Align = TextTable::Align;
using analysis::DampingMiss;
using Eigen::Index;
using Eigen::MatrixXd;

Json to_value(const DampingMiss& miss) {
  return {{"mode", miss.mode},
          {"natural_frequency", miss.natural_frequency},
          {"wanted", miss.wanted},
          {"obtained", miss.obtained},
          {"missed_by", miss.obtained - miss.wanted},
          {"reason", analysis::to_text(miss.reason)}};
}

Json to_value(const LoopReport& report) {
  Json modes = Json::array();
  for (const analysis::SampledMode& mode : report.sampled.modes) {
    modes.push_back({{"natural_frequency", mode.natural_frequency},
                     {"damping_ratio", mode.damping_ratio},
                     {"damped_frequency", mode.damped_frequency},
                     {"kind", analysis::to_text(mode.kind)}});
  }
  Json result = limit_value(report.limit, report.gain_margin);
  result["level"] = report.level;
  result["integral_decays"] = controller::integral_decays(report.sampled, report.limit.loop.period);
  result["spectral_radius"] = report.sampled.spectral_radius;
  result["modes"] = modes;
  return result;
}

Json to_value(const DesignReport& report) {
  Json before = report_json(report.before), after = report_json(report.after);
  Json misses = Json::array();
  for (const DampingMiss& miss : report.design.misses) misses.push_back(to_value(miss));
  Json result = {{report.key, json_rows(report.design.damping)},
                 {"smallest_eigenvalue", smallest_eigenvalue(report.design.damping)},
                 {"wanted", report.ratio},
                 {"reached", report.design.misses.empty()},
                 {"misses", misses},
                 {"indefinite_by", report.design.indefinite_by},
                 {"notes", report.notes},
                 {"assumes", report.assumes},
                 {"modes", after["modes"]},
                 {"before", before},
                 {"after", after}};
  if (report.q) result["q"] = json_list(*report.q);
  if (!report.rotors.empty()) result["rotors"] = report.rotors;
  if (!report.drives.empty()) result["drives"] = drives_json(report.drives);
  if (report.loop) result["loop"] = to_value(*report.loop);
  return result;
}

std::string mode_table(const DesignReport& report) {
  const auto& before = report.before.spectrum.modes;
  const auto& after = report.after.spectrum.modes;
  TextTable table({{Align::kRight, {"", "mode"}},
                   {Align::kPoint, {"before", "rad/s"}},
                   {Align::kPoint, {"", "ratio"}},
                   {Align::kPoint, {"after", "rad/s"}},
                   {Align::kPoint, {"", "ratio"}},
                   {Align::kLeft, {"", "kind"}}});
  if (report.loop) {
    table.add_column(Align::kPoint, {"sampled", "rad/s"});
    table.add_column(Align::kPoint, {"", "ratio"});
  }
  for (int i = 0; i < std::max(before.size(), after.size()); ++i) {
    std::vector<std::string> row = {std::to_string(i + 1)};
    for (const auto* modes : {&before, &after}) {
      const bool there = i < modes->size();
      row.push_back(there ? format_number((*modes)[i].natural_frequency, 6) : "");
      row.push_back(there ? format_number((*modes)[i].damping_ratio, 6) : "");
    }
    row.emplace_back(i < after.size() ? analysis::to_text(after[i].kind) : "");
    if (report.loop) {
      const auto& modes = report.loop->sampled.modes;
      const auto at = static_cast<std::size_t>(i);
      row.push_back(at < modes.size() ? format_number(modes[at].natural_frequency, 6) : "");
      row.push_back(at < modes.size() ? format_number(modes[at].damping_ratio, 6) : "");
    }
    table.add_row(std::move(row));
  }
  return table.text();
}

std::string loop_text(const DesignReport& report) {
  const LoopReport& loop = *report.loop;
  if (loop.level == 1) return loop_margin_text(loop.gain_margin);
  return "  The loop allows " + format_number(loop.level * report.ratio, 6) + " instead of " +
         format_number(report.ratio, 3) + ": with more damping, a gain margin of " +
         format_number(loop.limit.gain_margin, 3) + " is lost.\n";
}

std::string miss_text(const DesignReport& report) {
  const double ratio = report.ratio * (report.loop ? report.loop->level : 1);
  const auto misses = [](const DampingMiss& miss) {
    return miss.reason != DampingMiss::Reason::kLoop;
  };
  if (std::none_of(report.design.misses.begin(), report.design.misses.end(), misses)) {
    return std::string(report.gears ? "  With rigid gears every mode has a damping ratio of "
                                    : "  Every mode has a damping ratio of ") +
           format_number(ratio, ratio < report.ratio ? 6 : 3) + ".\n";
  }
  std::string text;
  for (const DampingMiss& miss : report.design.misses) {
    if (!misses(miss)) continue;
    text += "  Mode " + std::to_string(miss.mode + 1) +
            " misses: " + format_number(miss.obtained, 6) + " instead of " +
            format_number(miss.wanted, 6);
    switch (miss.reason) {
      case DampingMiss::Reason::kSoft:
        text += "; too slow, next to a singularity.\n";
        break;
      case DampingMiss::Reason::kOverdone:
        text += "; the existing damping is too large in some direction.\n";
        break;
      case DampingMiss::Reason::kStructure:
        text += "; no matrix of this structure was found that gives it.\n";
        break;
      case DampingMiss::Reason::kCoupling:
        text += "; no exact matrix was found in addition to the existing damping.\n";
        break;
      case DampingMiss::Reason::kLoop:
        break;
    }
  }
  if (report.design.indefinite_by < 0) {
    text += "  The exact answer would feed energy in (eigenvalue " +
            format_number(report.design.indefinite_by, 3) +
            " 1/s in modal coordinates); this is the damping matrix nearest to it.\n";
  }
  return text;
}

/// The note in lines of at most 100 characters, unless a word is longer.
std::string note_lines(const std::string& note) {
  std::string text, line = "  Note:";
  for (std::size_t at = 0; at < note.size();) {
    const std::size_t end = std::min(note.find(' ', at), note.size());
    const std::string word = note.substr(at, end - at);
    if (line.size() + 1 + word.size() > 100) {
      text += line + "\n";
      line = "   ";
    }
    line += " " + word;
    at = end + 1;
  }
  return text + line + "\n";
}

}  // namespace

double smallest_eigenvalue(const MatrixXd& A) {
  return A.size() == 0 ? 0 : Eigen::SelfAdjointEigenSolver<MatrixXd>(A).eigenvalues()[0];
}

Json limit_value(const analysis::LoopLimit& limit, double gain_margin) {
  return {
      {"period", limit.loop.period},        {"delay", limit.loop.delay},
      {"cutoff", limit.loop.torque_cutoff}, {"difference_velocity", limit.loop.difference_velocity},
      {"margin", limit.gain_margin},        {"gain_margin", gain_margin}};
}

std::string matrix_text(const MatrixXd& matrix) {
  TextTable table;
  for (Index j = 0; j < matrix.cols(); ++j) table.add_column(Align::kPoint, {});
  const double negligible = 1e-13 * (matrix.size() > 0 ? matrix.cwiseAbs().maxCoeff() : 0);
  for (Index i = 0; i < matrix.rows(); ++i) {
    std::vector<std::string> row;
    for (const double value : matrix.row(i)) {
      row.push_back(format_number(std::abs(value) <= negligible ? 0 : value, 6));
    }
    table.add_row(std::move(row));
  }
  return table.text();
}

std::string loop_margin_text(double gain_margin) {
  return "  Springs and damping may grow by a factor of " + format_number(gain_margin, 3) +
         " together before the loop is unstable.\n";
}

std::string design_json(const std::vector<DesignReport>& reports, bool as_list) {
  Json document = Json::array();
  for (const DesignReport& report : reports) document.push_back(to_value(report));
  return json_text(as_list ? document : document.at(0));
}

std::string design_table(const std::vector<DesignReport>& reports, bool as_list) {
  if (reports.empty()) return "no systems\n";
  std::string text;
  for (std::size_t i = 0; i < reports.size(); ++i) {
    const DesignReport& report = reports[i];
    if (i > 0) text += '\n';
    if (as_list) text += "[" + std::to_string(i) + "] ";
    text += report.key + (report.q ? " at q = " + format_list(*report.q, 5) : "") + "\n" +
            matrix_text(report.design.damping) + "\n";
    for (const std::string& note : report.notes) text += note_lines(note);
    if (report.loop) {
      text += loop_text(report) + assumes_text(report.assumes);
      text += integral_text(
          controller::integral_decays(report.loop->sampled, report.loop->limit.loop.period));
    }
    text += miss_text(report);
    if (!report.after.spectrum.modes.empty()) text += "\n" + mode_table(report);
  }
  return text;
}

}  // namespace dashpot::apps
