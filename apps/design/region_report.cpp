// dashpot design --region and --contact: a damping for many postures, or for what the tip touches.
#include <dashpot/apps/cli/arm_option.hpp>
#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/design/design_report.hpp>
#include <dashpot/apps/report/modes.hpp>
#include <dashpot/controller/contact_audit.hpp>
#include <dashpot/controller/dynamics.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::apps {

using controller::JointVector;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

using Align = TextTable::Align;

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

/// Returns the rows of the map; for a contact, of each stiffness the row with the least ratio.
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

namespace {

/// Adds the spring of what is touched to an arm.
SystemEntry touched(SystemEntry entry, const VectorXd& a, double stiffness) {
  const MatrixXd spring = stiffness * a * a.transpose();
  MatrixXd& all = entry.impedance.stiffness
                      ? *entry.impedance.stiffness
                      : entry.impedance.stiffness.emplace(MatrixXd::Zero(a.size(), a.size()));
  all += spring;
  if (stiffness > 0) entry.loop.passive_stiffness = spring;
  return entry;
}

/// Whether the ratio wanted is there to the steps in which it is sought.
bool holds(const RegionReport& report) {
  constexpr double kSteps = 1e-3;
  return report.design.kept && report.design.level >= 1 - kSteps;
}

/// Returns the configurations of postures in the air and against stiffnesses up to `most`, and
/// notes in the report what is touched in each.
SystemFile against(double most, const DesignOptions& options, const SystemFile& air,
                   const std::vector<MatrixXd>& J, const std::vector<JointVector>& postures,
                   RegionReport& report) {
  constexpr int kDecades = 3, kADecade = 4;  // below which the arm's own springs are stiffer
  std::vector<Eigen::Vector3d> directions = controller::contact_directions();
  if (!options.direction.empty()) directions = {read_direction(options.direction)};
  SystemFile file;
  const auto add = [&](std::size_t i, double stiffness, const Eigen::Vector3d& n) {
    file.entries.push_back(touched(air.entries[i], J[i].transpose() * n, stiffness));
    report.touches.push_back({stiffness, n});
    report.postures.push_back(postures[i]);
  };
  for (std::size_t i = 0; i < air.entries.size(); ++i) {
    add(i, 0, Eigen::Vector3d::Zero());
    for (int k = most > 0 ? kDecades * kADecade : -1; k >= 0; --k) {
      const double stiffness = most * std::pow(10.0, -static_cast<double>(k) / kADecade);
      for (const Eigen::Vector3d& n : directions) add(i, stiffness, n);
    }
  }
  return file;
}

}  // namespace

RegionReport design_for_contact(const DesignOptions& options, const SystemFile& air,
                                const controller::RobotModel& model,
                                const std::vector<JointVector>& postures,
                                const RegionSearch& search, const SampledRatio& ratio) {
  constexpr double kNear = 1.03, kLeast = 1;  // of the stiffness that is sought; N/m
  std::vector<MatrixXd> J;
  J.reserve(postures.size());
  for (const JointVector& q : postures) {
    J.emplace_back(controller::evaluate(model, q, JointVector::Zero(q.size())).J.topRows<3>());
  }
  const auto design = [&](double most) {
    RegionReport noted;
    const SystemFile file = against(most, options, air, J, postures, noted);
    RegionReport found = search(file);
    found.touches = std::move(noted.touches);
    found.postures = std::move(noted.postures);
    found.asked_contact = options.contact;
    if (holds(found)) found.contact = most;
    return found;
  };
  RegionReport best = design(options.contact);
  if (!holds(best)) best = design(0);
  for (double high = options.contact;
       best.contact && high > kNear * *best.contact && high > kLeast;) {
    const double low = *best.contact;
    const double middle = low > 0 ? std::sqrt(low * high) : 0.1 * high;
    RegionReport found = design(middle);
    if (holds(found)) {
      best = std::move(found);
    } else {
      high = middle;
    }
  }
  RegionReport again;
  const double most = best.contact.value_or(0);
  best.sampled_ratio = ratio(against(most, options, air, J, postures, again), best.design.damping);
  return best;
}

}  // namespace dashpot::apps
