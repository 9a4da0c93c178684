#include <dashpot/apps/audit/audit_report.hpp>
#include <dashpot/apps/cli/arm_option.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/modes.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/text/printable.hpp>

#include <cmath>

namespace dashpot::apps {
namespace {

using Align = TextTable::Align;

Json to_json(const controller::Distribution& found) {
  return {{"median", found.median},
          {"p05", found.p05},
          {"p95", found.p95},
          {"worst", found.worst},
          {"worst_q", found.worst_q.size() > 0 ? json_list(found.worst_q) : Json()},
          {"bound", found.bound}};
}

std::string margin_text(double margin) {
  return std::isinf(margin) ? "above 1e6" : format_number(margin, 4);
}

std::string modes_table(const AuditTask& task, const controller::PostureAudit& posture) {
  const analysis::Spectrum<>& spectrum = posture.spectrum;
  const Eigen::VectorXd& with_rotors = posture.rotors.damping_ratios;
  const bool compares = with_rotors.size() == spectrum.modes.size();
  TextTable table({{Align::kRight, {"", "mode"}},
                   {Align::kPoint, {"natural", "rad/s"}},
                   {Align::kPoint, {"damping", "ratio"}},
                   {Align::kPoint, {"", "meant"}},
                   {Align::kLeft, {"", "kind"}},
                   {Align::kPoint, {"fastest", "1/s"}}});
  if (compares) table.add_column(Align::kPoint, {"ratio with", "rotors"});
  for (int i = 0; i < spectrum.modes.size(); ++i) {
    const analysis::Mode<>& mode = spectrum.modes[i];
    const double fastest = std::min(mode.eigenvalues[0].real(), mode.eigenvalues[1].real());
    std::vector<std::string> row = {std::to_string(i + 1),
                                    format_number(mode.natural_frequency, 6),
                                    format_number(mode.damping_ratio, 6),
                                    format_number(task.intended_ratio, 3),
                                    analysis::to_text(mode.kind),
                                    format_number(fastest, 6)};
    if (compares) row.push_back(format_number(with_rotors[i], 6));
    table.add_row(row);
  }
  return table.text();
}

/// Returns what is unknown because the model has no rotors; empty if it has rotors.
std::string rotors_table(const AuditTask& task, const controller::PostureAudit& posture) {
  const controller::RobotModel& model = task.model;
  const std::string missing = controller::missing_rotors_text(model);
  const std::string drives = controller::drives_text(model, task.drives);
  std::string used = drives.empty() ? "" : "\n  " + drives + "\n";
  if (!task.friction.empty()) used += "\n  " + task.friction + "\n";
  if (missing.empty()) return used;
  const bool loop = task.options.period > 0;
  std::string text = used + "\n  Rotors unknown: " + missing + ". Fast modes" +
                     (loop ? ",\n  fastest pole, and gain margin" : "\n  and fastest pole") +
                     " are computed for " + controller::arm_without_rotors(model) + ".\n";
  const controller::MissingRotors& rotors = posture.rotors;
  const std::string asked = format_number(task.options.margin, 3);
  if (rotors.inertia && !rotors.inertia->isZero(0)) {
    text += "  Enough for a margin of " + asked + " would be " +
            controller::inertia_text(model, *rotors.inertia) + ".\n";
  } else if (rotors.inertia) {
    text += "  The margin of " + asked + " is there without them.\n";
  } else if (loop) {
    text += "  No reflected inertia of these joints gives a margin of " + asked + ".\n";
  }
  if (rotors.compared.size() > 0) {
    const controller::Drives* published = controller::unknown_rotors(model).published;
    text += "  With " +
            (published != nullptr ? "the published drives " + std::string(published->name)
                                  : std::string("it")) +
            " the smallest ratio is " + format_number(rotors.numbers.smallest_ratio, 6) +
            ", the fastest pole " + format_number(rotors.numbers.fastest_pole, 6) + " 1/s" +
            (loop ? ", the gain margin " + margin_text(rotors.numbers.gain_margin) : "") + ".\n";
  }
  return text + "  " + task.rotors_hint() + "\n";
}

/// Returns what a gain margin means. A loop is not called unstable if its rotors are unknown.
std::string margin_verdict(const AuditTask& task, double margin) {
  if (margin >= 1) return "stiffness and damping may grow by it together.\n";
  return controller::unknown_rotors(task.model).any()
             ? "too little for an arm without rotors, which yours is not.\n"
             : "the sampled loop is unstable.\n";
}

std::string posture_table(const AuditTask& task, const AuditReport& report) {
  const controller::PostureAudit& posture = report.posture;
  const controller::PostureNumbers& numbers = posture.numbers;
  std::string text = "At q = " + format_list(posture.q, 5) + "\n" + modes_table(task, posture) +
                     "\n  Smallest ratio " + format_number(numbers.smallest_ratio, 6);
  if (!std::isnan(task.intended_ratio)) {
    text += " where " + format_number(task.intended_ratio, 3) + " was meant";
  }
  text += "; fastest pole " + format_number(numbers.fastest_pole, 6) + " 1/s.\n";
  if (task.options.period > 0) {
    text += "  Gain margin " + margin_text(numbers.gain_margin) + " with a period of " +
            format_number(task.options.period, 3) +
            " s: " + margin_verdict(task, numbers.gain_margin);
  }
  text += assumes_text(loop_assumptions(task.options, &task.model));
  text += integral_text(posture.integral_decays);
  const Eigen::Index zero = posture.spectrum.zero_modes.count;
  text += "  Zero modes: " + std::to_string(zero) + ".";
  if (numbers.zero_modes > zero) {
    text += " Soft modes, which hardly any spring resists: " +
            std::to_string(numbers.zero_modes - zero) + ".";
  }
  if (!report.lost_directions.empty()) {
    text += "\n  The posture is singular, or next to it: no spring acts in direction " +
            report.lost_directions + ".";
  }
  return text + "\n" + rotors_table(task, posture);
}

std::string workspace_table(const AuditTask& task, const AuditReport& report) {
  const controller::WorkspaceAudit& found = *report.workspace;
  TextTable table({{Align::kLeft, {""}}});
  for (const char* name : {"median", "5 %", "95 %", "worst"}) {
    table.add_column(Align::kPoint, {name});
  }
  table.add_column(Align::kLeft, {"worst at q ="});
  const auto add = [&](const char* name, const controller::Distribution& row) {
    const auto text = [](double value) {
      return std::isinf(value) ? std::string("above 1e6") : format_number(value, 4);
    };
    table.add_row({name, text(row.median), text(row.p05), text(row.p95), text(row.worst),
                   format_list(row.worst_q, 3)});
  };
  add("smallest ratio", found.smallest_ratio);
  add("fastest pole, 1/s", found.fastest_pole);
  const bool known = !controller::unknown_rotors(task.model).any();
  if (task.options.period > 0) {
    add(known ? "gain margin" : "margin without rotors", found.gain_margin);
  }
  return "\nOver " + std::to_string(found.samples) + " postures, " +
         std::to_string(found.singular) + " of them singular" +
         (report.interrupted ? " (interrupted: no more were done)" : "") + "\n" + table.text() +
         "\n  Proved bounds: " + format_bound(found.smallest_ratio.bound) + " of the ratios, " +
         format_bound(found.fastest_pole.bound) + " 1/s of the poles shown.\n";
}

std::string suggestion_table(const AuditTask& task, const AuditReport& report) {
  const std::string ratio = format_number(task.wanted_ratio, 3);
  if (!report.no_suggestion.empty()) {
    return "\nNo damping is suggested: " + text::printable(report.no_suggestion) + "\n";
  }
  const controller::DampingSuggestion& found = report.suggestion;
  std::string text = "\nDamping for a ratio of " + ratio + " at q; smallest ratio with it " +
                     format_number(found.smallest_ratio, 4) + "\n";
  TextTable table;
  for (Eigen::Index j = 0; j < found.damping.cols(); ++j) {
    const Eigen::VectorXd column = found.damping.col(j);
    table.add_column(Align::kPoint, {}, format_column({column.begin(), column.end()}, 6));
  }
  return text + table.text() + "\n  Nearest diagonal: " + format_list(found.diagonal, 4) +
         "; smallest ratio with it " + format_number(found.diagonal_smallest_ratio, 4) + "\n";
}

void rotors_json(const AuditTask& task, const controller::PostureAudit& posture, Json& result) {
  const controller::UnknownRotors unknown = controller::unknown_rotors(task.model);
  result["rotors"] = unknown.any() ? "unknown" : "known";
  if (!task.drives.empty()) result["drives"] = drives_json(task.drives);
  if (!unknown.any()) return;
  const auto& rotors = posture.rotors;
  Json names = Json::array();
  for (const int i : unknown.joints) {
    names.push_back(text::printable(task.model.joints()[static_cast<std::size_t>(i)].name));
  }
  result["joints_without_rotors"] = names;
  result["margin"] = task.options.margin;
  result["reflected_inertia_for_margin"] = rotors.inertia ? json_list(*rotors.inertia) : Json();
  result["published_drives"] =
      unknown.published != nullptr ? Json(std::string(unknown.published->name)) : Json();
  result["with_rotors"] = Json();
  if (rotors.compared.size() > 0) {
    result["with_rotors"] = {{"reflected_inertia", json_list(rotors.compared)},
                             {"smallest_ratio", rotors.numbers.smallest_ratio},
                             {"fastest_pole", rotors.numbers.fastest_pole},
                             {"gain_margin", rotors.numbers.gain_margin},
                             {"damping_ratios", json_list(rotors.damping_ratios)}};
  }
}

}  // namespace

std::string audit_json(const AuditTask& task, const AuditReport& report) {
  const controller::PostureNumbers& numbers = report.posture.numbers;
  Json result = {{"intended_ratio", task.intended_ratio},
                 {"posture",
                  {{"q", json_list(report.posture.q)},
                   {"modes", modes_json(report.posture.spectrum)},
                   {"smallest_ratio", numbers.smallest_ratio},
                   {"smallest_ratio_bound", report.posture.smallest_ratio_bound},
                   {"fastest_pole", numbers.fastest_pole},
                   {"fastest_pole_bound", report.posture.fastest_pole_bound},
                   {"gain_margin", numbers.gain_margin},
                   {"assumes", loop_assumptions(task.options, &task.model)},
                   {"integral_decays", report.posture.integral_decays},
                   {"zero_modes", numbers.zero_modes},
                   {"singular", numbers.singular},
                   {"lost_directions", report.lost_directions},
                   {"viscous_friction",
                    json_list(task.model.joint_values(&controller::Joint::viscous_friction))}}}};
  rotors_json(task, report.posture, result["posture"]);
  if (report.workspace) {
    result["workspace"] = {{"samples", report.workspace->samples},
                           {"singular", report.workspace->singular},
                           {"interrupted", report.interrupted},
                           {"smallest_ratio", to_json(report.workspace->smallest_ratio)},
                           {"fastest_pole", to_json(report.workspace->fastest_pole)},
                           {"gain_margin", to_json(report.workspace->gain_margin)}};
  }
  result["suggestion"] = Json();
  if (report.no_suggestion.empty()) {
    const bool joint = task.options.mode == controller::Mode::kJoint;
    result["suggestion"] = {
        {"damping_ratio", task.wanted_ratio},
        {joint ? "damping" : "task_damping", json_rows(report.suggestion.damping)},
        {"smallest_ratio", report.suggestion.smallest_ratio},
        {"diagonal", json_list(report.suggestion.diagonal)},
        {"diagonal_smallest_ratio", report.suggestion.diagonal_smallest_ratio}};
  }
  return json_text(result);
}

std::string audit_table(const AuditTask& task, const AuditReport& report) {
  const controller::RobotModel& model = task.model;
  std::string text = text::printable(model.name()) + ": " + std::to_string(model.dof()) +
                     (model.dof() == 1 ? " joint" : " joints") + " from " +
                     text::printable(model.base()) + " to " + text::printable(model.tip()) + "\n\n";
  text += posture_table(task, report);
  if (report.workspace) text += workspace_table(task, report);
  return text + suggestion_table(task, report);
}

std::string csv_heading(const controller::RobotModel& model) {
  std::string text = "posture";
  const text::Units units = controller::joint_units(model, "rad", "m");
  for (std::size_t i = 0; i < units.size(); ++i) {
    text += ",q" + std::to_string(i + 1) + " [" + units[i] + "]";
  }
  return text + ",smallest_ratio,fastest_pole [1/s],gain_margin,zero_modes,singular\n";
}

std::string csv_line(std::int64_t i, const controller::JointVector& q,
                     const controller::PostureNumbers& numbers) {
  std::string text = std::to_string(i);
  for (const double value : q) text += "," + csv_text(value);
  return text + "," + csv_text(numbers.smallest_ratio) + "," + csv_text(numbers.fastest_pole) +
         "," + csv_text(numbers.gain_margin) + "," + std::to_string(numbers.zero_modes) + "," +
         (numbers.singular ? "1" : "0") + "\n";
}

}  // namespace dashpot::apps
