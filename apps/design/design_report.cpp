#include <dashpot/apps/cli/drives_option.hpp>
#include <dashpot/apps/design/design_report.hpp>
#include <dashpot/apps/report/json.hpp>
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

double smallest_eigenvalue(const MatrixXd& A) {
  return A.size() == 0 ? 0 : Eigen::SelfAdjointEigenSolver<MatrixXd>(A).eigenvalues()[0];
}

Json to_value(const DampingMiss& miss) {
  return {{"mode", miss.mode},
          {"natural_frequency", miss.natural_frequency},
          {"wanted", miss.wanted},
          {"obtained", miss.obtained},
          {"missed_by", miss.obtained - miss.wanted},
          {"reason", analysis::to_text(miss.reason)}};
}

/// Returns the keys of a loop and its margin, without those that follow from them.
Json limit_value(const analysis::LoopLimit& limit, double gain_margin) {
  return {
      {"period", limit.loop.period},        {"delay", limit.loop.delay},
      {"cutoff", limit.loop.torque_cutoff}, {"difference_velocity", limit.loop.difference_velocity},
      {"margin", limit.gain_margin},        {"gain_margin", gain_margin}};
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

/// The matrix in aligned columns; entries within the rounding of the largest are 0.
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

std::string loop_margin_text(double gain_margin) {
  return "  Springs and damping may grow by a factor of " + format_number(gain_margin, 3) +
         " together before the loop is unstable.\n";
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

/// One row of the map of a region: the effect of its damping at a configuration.
struct RegionRow {
  std::size_t index;
  const analysis::RegionSample* sample;
};

std::vector<RegionRow> rows_of(const RegionReport& report) {
  std::vector<RegionRow> rows;
  for (const analysis::RegionSample& sample : report.design.samples) {
    rows.push_back({rows.size(), &sample});
  }
  return rows;
}

/// Says up to which stiffness the ratio holds.
std::string contact_text(const RegionReport& report) {
  const std::string asked = format_number(report.asked_contact, 3) + " N/m";
  const std::string ratio = "  The ratio of " + format_number(report.ratio, 3);
  if (!report.contact)
    return ratio + " does not hold in the air; up to " + asked + " were asked.\n";
  if (*report.contact == report.asked_contact) {
    return ratio + " holds in the air and against every stiffness up to " + asked + ".\n";
  }
  return ratio + " holds in the air and against every stiffness up to " +
         format_number(*report.contact, 3) +
         " N/m; with no damping that\n  was found it holds up to " + asked + ".\n";
}

/// Of a contact, the row with the least ratio for each stiffness.
std::vector<RegionRow> shown_rows(const RegionReport& report) {
  if (report.touches.empty()) return rows_of(report);
  std::vector<RegionRow> rows;
  for (const RegionRow& row : rows_of(report)) {
    const auto same = std::find_if(rows.begin(), rows.end(), [&](const RegionRow& other) {
      return report.touches[other.index].stiffness == report.touches[row.index].stiffness;
    });
    if (same == rows.end()) {
      rows.push_back(row);
    } else if (row.sample->damping_ratio < same->sample->damping_ratio) {
      *same = row;
    }
  }
  return rows;
}

std::vector<Field<RegionRow>> region_fields(const RegionReport& report) {
  using Sample = analysis::RegionSample;
  const auto real = [](double Sample::*member) {
    return [member](const RegionRow& row) { return Json(row.sample->*member); };
  };
  // If all modes are soft, no mode is the worst.
  const auto if_any = [](double Sample::*member) {
    return [member](const RegionRow& row) {
      const Sample& sample = *row.sample;
      return sample.worst_mode < 0 ? "-" : format_number(sample.*member, 6);
    };
  };
  std::vector<Field<RegionRow>> fields = {
      {"",
       "configuration",
       {Align::kRight, {"", "configuration"}},
       [](const RegionRow& row) { return Json(row.index); },
       [](const RegionRow& row) { return "[" + std::to_string(row.index) + "]"; }},
      {"worst_mode",
       "worst_mode",
       {Align::kRight, {"worst", "mode"}},
       [](const RegionRow& row) { return Json(row.sample->worst_mode); },
       [](const RegionRow& row) {
         return row.sample->worst_mode < 0 ? "-" : std::to_string(row.sample->worst_mode + 1);
       }},
      {"natural_frequency",
       "natural_frequency [rad/s]",
       {Align::kPoint, {"", "rad/s"}},
       real(&Sample::natural_frequency),
       if_any(&Sample::natural_frequency)},
      {"damping_ratio",
       "damping_ratio",
       {Align::kPoint, {"smallest", "ratio"}},
       real(&Sample::damping_ratio),
       if_any(&Sample::damping_ratio)},
      {"wanted", "", {}, real(&Sample::wanted)},
      {"largest_ratio",
       "largest_ratio",
       {Align::kPoint, {"largest", "ratio"}},
       real(&Sample::largest_ratio),
       if_any(&Sample::largest_ratio)},
      {"soft_modes", "soft_modes", {Align::kRight, {"soft", "modes"}}, [](const RegionRow& row) {
         return Json(row.sample->soft_modes);
       }}};
  if (report.limit) {
    fields.push_back({"gain_margin",
                      "gain_margin",
                      {Align::kPoint, {"gain", "margin"}, 3},
                      real(&Sample::gain_margin)});
  }
  if (!report.touches.empty()) {
    fields.push_back(
        {"touch", "touch [N/m]", {Align::kPoint, {"touch", "N/m"}, 3}, [&](const RegionRow& row) {
           return Json(report.touches[row.index].stiffness);
         }});
    fields.push_back({"direction", "", {}, [&](const RegionRow& row) {
                        return json_list(report.touches[row.index].direction);
                      }});
  }
  if (!report.postures.empty()) {
    fields.push_back(
        {"q", "", {}, [&](const RegionRow& row) { return json_list(report.postures[row.index]); }});
  }
  return fields;
}

}  // namespace

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

std::string region_json(const RegionReport& report) {
  const analysis::RegionDesign& design = report.design;
  Json result = {{report.key, json_rows(design.damping)},
                 {"smallest_eigenvalue", smallest_eigenvalue(design.damping)},
                 {"wanted", report.ratio},
                 {"level", design.level},
                 {"violation", design.violation},
                 {"worst_sample", design.worst_sample},
                 {"assumes", report.assumes}};
  if (report.limit) {
    result["loop"] = limit_value(*report.limit, design.gain_margin);
    result["loop"]["share"] = design.share;
    result["loop"]["margin_sample"] = design.margin_sample;
  }
  if (!report.touches.empty()) {
    result["contact"] = {{"asked", report.asked_contact}, {"holds_to", Json()}};
    if (report.contact) result["contact"]["holds_to"] = *report.contact;
    if (report.limit) result["contact"]["sampled_ratio"] = report.sampled_ratio;
  }
  result["samples"] = json_of(rows_of(report), region_fields(report));
  return json_text(result);
}

std::string region_table(const RegionReport& report) {
  const analysis::RegionDesign& design = report.design;
  std::string text = report.key + "\n" + matrix_text(design.damping) + "\n";
  if (design.worst_sample >= 0) {
    const analysis::RegionSample& worst =
        design.samples[static_cast<std::size_t>(design.worst_sample)];
    text +=
        "  Smallest ratio " + format_number(worst.damping_ratio, 6) + ", wanted " +
        format_number(worst.wanted, 3) + ", at configuration [" +
        std::to_string(design.worst_sample) + "]" +
        (report.postures.empty()
             ? ".\n"
             : ",\n  q = " +
                   format_list(report.postures[static_cast<std::size_t>(design.worst_sample)], 5) +
                   ".\n");
  }
  if (report.limit && design.share < 1) {
    text += "  The loops allow " + format_number(design.share, 6) +
            " of the damping designed for continuous loops: with more, a gain margin of " +
            format_number(report.limit->gain_margin, 3) + " is lost, first at configuration [" +
            std::to_string(design.margin_sample) + "].\n";
  } else if (report.limit) {
    text += loop_margin_text(design.gain_margin);
  }
  if (!report.touches.empty()) text += contact_text(report);
  if (!report.touches.empty() && report.limit) {
    text += "  The smallest ratio of the sampled loops is " +
            format_number(report.sampled_ratio, 3) + ".\n";
  }
  if (report.limit || !report.touches.empty()) text += assumes_text(report.assumes);
  return text + "\n" + table_of(shown_rows(report), region_fields(report));
}

std::string region_complaint(const RegionReport& report) {
  const analysis::RegionDesign& design = report.design;
  if (design.violation > 1e-6) {
    return "the existing damping exceeds --largest-ratio by " + format_number(design.violation, 3) +
           "; allow more, or take friction away";
  }
  if (design.worst_sample < 0) return "";
  const analysis::RegionSample& worst =
      design.samples[static_cast<std::size_t>(design.worst_sample)];
  if (worst.damping_ratio >= 0.1 * worst.wanted) return "";
  double largest = 0;
  for (const analysis::RegionSample& sample : design.samples) {
    largest = std::max(largest, sample.largest_ratio);
  }
  return "the smallest ratio, " + format_number(worst.damping_ratio, 3) +
         ", is less than a tenth of the " + format_number(worst.wanted, 3) +
         " wanted; what binds: no mode may have a ratio above --largest-ratio, and one has " +
         format_number(largest, 4) + ", or the structure leaves no better matrix";
}

std::string region_csv(const RegionReport& report) {
  return csv_of(rows_of(report), region_fields(report));
}

}  // namespace dashpot::apps
