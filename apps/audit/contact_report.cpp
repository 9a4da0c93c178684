#include <dashpot/apps/audit/audit_report.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/modes.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/text/printable.hpp>

#include <algorithm>
#include <cmath>
#include <sstream>

namespace dashpot::apps {
namespace {

using Align = TextTable::Align;
using controller::ContactAt;
using controller::HeldForce;

std::string stiffness_text(double k, int digits = 4) {
  return std::isinf(k) ? "above 1e9" : format_number(k, digits);
}

/// Rounding errors are shown as zeros.
std::string direction_text(const Eigen::Vector3d& n) {
  return "(" + format_list(n.unaryExpr([](double x) { return std::abs(x) < 1e-9 ? 0 : x; }), 2) +
         ")";
}

/// Orders postures that have a limit by it.
std::vector<std::size_t> ranking(const std::vector<PostureContact>& found) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!std::isnan(found[i].touch.limit.stiffness)) order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) {
    return found[i].touch.limit.stiffness < found[j].touch.limit.stiffness;
  });
  return order;
}

std::size_t not_held(const ContactReport& report) {
  return static_cast<std::size_t>(std::count_if(report.workspace.begin(), report.workspace.end(),
                                                [](const auto& one) { return !one.held; }));
}

/// The limit with the nearest rank: the least that a share of all does not exceed.
double at_share(const ContactReport& report, const std::vector<std::size_t>& order, double share) {
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(order.size())));
  return report.workspace[order[std::max<std::size_t>(rank, 1) - 1]].touch.limit.stiffness;
}

bool bears(const ContactReport& report) {
  const analysis::ContactLimit& limit = report.posture.touch.limit;
  return report.asked < (std::isnan(limit.lower) ? limit.stiffness : limit.lower);
}

/// Number of postures of the workspace that have no limit although the arm can hold itself there.
std::size_t without_limit(const ContactReport& report) {
  return report.workspace.size() - not_held(report) - ranking(report.workspace).size();
}

/// Number of postures of the workspace that are unstable at the stiffness asked for.
std::size_t bearing_less(const ContactReport& report) {
  return static_cast<std::size_t>(std::count_if(
      report.workspace.begin(), report.workspace.end(),
      [&](const auto& one) { return one.held && one.touch.limit.stiffness <= report.asked; }));
}

std::string verdict(const AuditTask& task, const ContactReport& report) {
  const ContactAt& touch = report.posture.touch;
  const bool known = !controller::unknown_rotors(task.model).any();
  std::string text;
  if (touch.limit.stiffness == 0) {
    text =
        known ? "Unstable before it touches anything"
              : "Unstable before it touches anything, as an arm without rotors, which yours is not";
  } else if (std::isinf(touch.limit.stiffness)) {
    const double most = report.options.most;
    text = "Stable in contact with springs of any stiffness up to " +
           (most > 1e9 ? format_number(most, 4) : "1e9") + " N/m " +
           (report.options.direction ? "along " + direction_text(touch.direction)
                                     : std::string("in any direction"));
  } else {
    text = "Stable in contact with springs up to " + format_number(touch.limit.stiffness, 4) +
           " N/m along " + direction_text(touch.direction) +
           (report.options.direction ? "" : ", the direction with the lowest limit");
  }
  if (touch.limit.stiffness > 0 && !known) text += ", as an arm without rotors";
  if (report.asked > 0) {
    text += "; at the " + format_number(report.asked, 4) +
            " N/m asked for: " + (bears(report) ? "yes" : "no");
    if (!report.workspace.empty()) {
      text += " here, and no at " + std::to_string(bearing_less(report)) + " of " +
              count(static_cast<std::int64_t>(report.workspace.size()), "posture");
    }
  }
  return text + (report.posture.passivity.passive ? "; passive." : "; not passive.");
}

std::string passivity_text(const controller::RobotModel& model,
                           const analysis::PortPassivity& found) {
  if (found.passive)
    return "  Passive: stable in contact with everything that is passive itself.\n";
  std::string text = "  Not passive";
  if (found.missing_friction > 0) {
    const text::Units units = controller::joint_units(model, "N m s/rad", "N s/m");
    const bool same = std::count(units.begin(), units.end(), units[0]) == std::ssize(units);
    text += " from " + format_number(found.from, 3) + " to " + format_number(found.to, 4) +
            " rad/s: each joint would need " + format_number(found.missing_friction, 3) + " " +
            (same ? units[0] : "N m s/rad (N s/m)") + " more of friction of its own";
  } else {
    text += found.instants ? ", though no motion below the Nyquist frequency gets energy"
                           : ": the springs do not pull back from everywhere";
  }
  if (found.instants) text += ";\n  dampers on velocities measured at an instant never are";
  return text + ".\n";
}

std::string touch_table(const AuditTask& task, const ContactReport& report) {
  const controller::ContactAudit& found = report.posture;
  const analysis::ContactLimit& limit = found.touch.limit;
  std::string text = "At q = " + format_list(found.q, 5) + "\n";
  if (limit.stiffness > 0 && std::isfinite(limit.stiffness)) {
    text += "  Limit " + format_number(limit.stiffness, 6) + " N/m, " +
            (std::isnan(limit.lower + limit.upper)
                 ? std::string("not proved")
                 : "proved to be between " + format_number(limit.lower, 8) + " and " +
                       format_number(limit.upper, 8)) +
            "; there a motion of " + format_number(limit.frequency, 4) + " rad/s grows.\n";
  }
  text += std::string("  Held rigidly in that direction: ") +
          (limit.stable_if_rigid ? "stable" : "unstable") +
          ".\n  Limit with half of the stiffness " + stiffness_text(found.with_half_stiffness) +
          ", with 1.5 times the damping " + stiffness_text(found.with_more_damping);
  if (!std::isnan(found.with_less_delay)) {
    text += ", with a tick less of delay " + stiffness_text(found.with_less_delay);
  }
  text += " N/m.\n" + passivity_text(task.model, found.passivity) +
          assumes_text(loop_assumptions(task.options, &task.model));
  if (const std::string missing = controller::missing_rotors_text(task.model); !missing.empty()) {
    text += "  Rotors unknown: " + missing + ". The limit is computed for " +
            controller::arm_without_rotors(task.model) + ".\n";
    if (!std::isnan(report.limit_with_rotors)) {
      text += "  With the published drives " +
              std::string(controller::unknown_rotors(task.model).published->name) + " it is " +
              stiffness_text(report.limit_with_rotors) + " N/m.\n";
    }
    text += "  " + task.rotors_hint() + "\n";
  }
  TextTable table({{Align::kPoint, {"touch", "N/m"}},
                   {Align::kPoint, {"least", "ratio"}},
                   {Align::kPoint, {"natural", "rad/s"}}});
  constexpr std::size_t kADecade = 10;
  for (std::size_t i = 0; i < report.curve.size(); ++i) {
    if (i > 0 && (i - 1) % kADecade != 0) continue;
    const analysis::ContactPoint& point = report.curve[i];
    table.add_row({format_number(point.stiffness, 3), format_number(point.damping_ratio, 4),
                   format_number(point.natural_frequency, 4)});
  }
  return text + "\n" + table.text();
}

std::string hold_table(const AuditTask& task, const ContactReport& report) {
  const controller::ContactAudit& found = report.posture;
  const auto name = [&](int joint) {
    return text::printable(task.model.joints()[static_cast<std::size_t>(joint)].name);
  };
  TextTable joints({{Align::kLeft, {"", "joint"}},
                    {Align::kPoint, {"", "weight"}},
                    {Align::kPoint, {"", "limit"}},
                    {Align::kLeft, {"", ""}},
                    {Align::kPoint, {"share", "%"}}});
  const text::Units units = controller::joint_units(task.model, "N m", "N");
  const std::vector<std::string> weights =
      format_column({found.weight.begin(), found.weight.end()}, 4);
  for (int i = 0; i < found.weight.size(); ++i) {
    const bool limited = std::isfinite(found.effort[i]);
    joints.add_row(
        {name(i), weights[static_cast<std::size_t>(i)],
         limited ? format_number(found.effort[i], 4) : "unknown",
         units[static_cast<std::size_t>(i)],
         limited ? format_number(std::round(100 * std::abs(found.weight[i]) / found.effort[i]), 2)
                 : "-"});
  }
  TextTable forces({{Align::kLeft, {"pressing", "along"}},
                    {Align::kPoint, {"force", "N"}},
                    {Align::kPoint, {"springs", "in by mm"}},
                    {Align::kLeft, {"", "at its limit"}}});
  for (const HeldForce& one : found.forces) {
    const auto number = [](double value, double unit) {
      if (std::isnan(value)) return std::string("unknown");
      return std::isinf(value) ? "-" : format_number(unit * value, 4);
    };
    forces.add_row({direction_text(one.direction), number(one.force, 1),
                    number(one.deflection, 1e3), one.joint < 0 ? "-" : name(one.joint)});
  }
  return "\nWhat the joints hold\n" + joints.text() + "\n" + forces.text();
}

std::string workspace_table(const ContactReport& report) {
  const std::vector<std::size_t> order = ranking(report.workspace);
  std::string text =
      "\nOver " + count(static_cast<std::int64_t>(report.workspace.size()), "posture");
  text += ", " + std::to_string(not_held(report)) + " of them too heavy for the arm to hold, " +
          std::to_string(without_limit(report)) + " where the tip cannot move so" +
          (report.interrupted ? " (interrupted: no more were done)" : "") + "\n";
  if (order.empty()) return text + "  None with a limit.\n";
  const PostureContact& worst = report.workspace[order.front()];
  return text + "  Limit: median " + stiffness_text(at_share(report, order, 0.5)) + ", 5 % below " +
         stiffness_text(at_share(report, order, 0.05)) + ", least " +
         stiffness_text(worst.touch.limit.stiffness) + " N/m, along " +
         direction_text(worst.touch.direction) +
         " at q = " + format_list(report.postures[order.front()], 3) + "\n";
}

Json hold_json(const controller::ContactAudit& found) {
  Json forces = Json::array();
  for (const HeldForce& one : found.forces) {
    forces.push_back({{"direction", json_list(one.direction)},
                      {"force", one.force},
                      {"joint", one.joint < 0 ? Json() : Json(one.joint)},
                      {"deflection", one.deflection}});
  }
  return {
      {"torque", json_list(found.weight)}, {"limit", json_list(found.effort)}, {"forces", forces}};
}

}  // namespace

std::string contact_json(const AuditTask& task, const ContactReport& report) {
  const controller::ContactAudit& found = report.posture;
  const analysis::ContactLimit& limit = found.touch.limit;
  const analysis::PortPassivity& port = found.passivity;
  Json curve = Json::array();
  for (const analysis::ContactPoint& point : report.curve) {
    curve.push_back({point.stiffness, point.damping_ratio, point.natural_frequency});
  }
  Json result = {{"verdict", verdict(task, report)},
                 {"posture",
                  {{"q", json_list(found.q)},
                   {"direction", json_list(found.touch.direction)},
                   {"limit", limit.stiffness},
                   {"limit_lower", limit.lower},
                   {"limit_upper", limit.upper},
                   {"frequency", limit.frequency},
                   {"stable_if_rigid", limit.stable_if_rigid},
                   {"with_half_stiffness", found.with_half_stiffness},
                   {"with_more_damping", found.with_more_damping},
                   {"rotors", controller::unknown_rotors(task.model).any() ? "unknown" : "known"},
                   {"assumes", loop_assumptions(task.options, &task.model)},
                   {"curve", curve},
                   {"passivity",
                    {{"passive", port.passive},
                     {"missing_friction", port.missing_friction},
                     {"frequency", port.frequency},
                     {"band", port.to > 0 ? Json({port.from, port.to}) : Json()},
                     {"velocity_at_instants", port.instants}}},
                   {"hold", hold_json(found)}}}};
  Json& posture = result["posture"];
  if (!std::isnan(found.with_less_delay)) posture["with_less_delay"] = found.with_less_delay;
  if (!std::isnan(report.limit_with_rotors))
    posture["limit_with_rotors"] = report.limit_with_rotors;
  if (report.asked > 0) {
    result["asked"] = {{"stiffness", report.asked}, {"stable", bears(report)}};
    if (!report.workspace.empty()) result["asked"]["postures_unstable"] = bearing_less(report);
  }
  if (report.workspace.empty()) return json_text(result);
  const std::vector<std::size_t> order = ranking(report.workspace);
  Json& workspace = result["workspace"];
  workspace = {{"samples", report.workspace.size()},
               {"not_held", not_held(report)},
               {"without_limit", without_limit(report)},
               {"interrupted", report.interrupted}};
  if (order.empty()) return json_text(result);
  const ContactAt& worst = report.workspace[order.front()].touch;
  workspace["limit"] = {{"median", at_share(report, order, 0.5)},
                        {"p05", at_share(report, order, 0.05)},
                        {"worst", worst.limit.stiffness},
                        {"worst_q", json_list(report.postures[order.front()])},
                        {"worst_direction", json_list(worst.direction)}};
  return json_text(result);
}

std::string contact_table(const AuditTask& task, const ContactReport& report) {
  std::string text =
      verdict(task, report) + "\n\n" + touch_table(task, report) + hold_table(task, report);
  if (!report.workspace.empty()) text += workspace_table(report);
  return text;
}

void draw_contact(const std::string& path, const AuditTask& task, const ContactReport& report) {
  std::ostringstream out;
  out << plot_heading(path, 900, 620) << "$curve << EOD\n";
  for (const analysis::ContactPoint& point : report.curve) {
    if (point.stiffness == 0) continue;
    out << point.stiffness << ' ' << point.damping_ratio << ' ' << point.natural_frequency << '\n';
  }
  out << "EOD\nset termoption noenhanced\nset logscale x\nset format x '%.0e'\nset grid\n"
      << "set multiplot layout 2,1 title "
      << quoted_for_gnuplot(text::printable(task.model.name()) + ", touched along " +
                            direction_text(report.posture.touch.direction))
      << "\nset xlabel 'stiffness that is touched, N/m'\nset ylabel 'least damping ratio'\n";
  const double limit = report.posture.touch.limit.stiffness;
  if (limit > 0 && std::isfinite(limit)) {
    out << "set arrow 1 from " << limit << ", graph 0 to " << limit
        << ", graph 1 nohead lw 2 lc rgb '#d62728'\nset label 1 ' limit " << format_number(limit, 3)
        << " N/m' at " << limit << ", graph 0.93 textcolor rgb '#d62728'\n";
  }
  out << "plot $curve using 1:2 with lines lw 2 lc rgb '#1f77b4' notitle, 0 lc rgb '#777777' "
         "notitle\nunset label 1\nset ylabel 'its frequency, rad/s'\nset logscale y\n"
      << "plot $curve using 1:3 with lines lw 2 lc rgb '#1f77b4' notitle\nunset multiplot\n";
  run_gnuplot(path, out.str());
}

}  // namespace dashpot::apps
