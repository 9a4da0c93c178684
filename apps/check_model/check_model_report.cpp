#include <dashpot/apps/check_model/check_model_report.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/text/printable.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numbers>

namespace dashpot::apps {
namespace {

using identification::Estimate;
using identification::JointCheck;
using identification::ModelCheck;
using identification::TorqueKind;
using Align = TextTable::Align;

const char* kind_text(TorqueKind kind) {
  switch (kind) {
    case TorqueKind::kWhole:
      return "whole";
    case TorqueKind::kWithoutGravity:
      return "without gravity";
    case TorqueKind::kExternal:
      return "external";
  }
  return "";
}

std::string kind_sentence(TorqueKind kind) {
  switch (kind) {
    case TorqueKind::kWhole:
      return "";
    case TorqueKind::kWithoutGravity:
      return "The torques leave out the arm's weight, as those commanded to a robot do that holds "
             "itself:\nthe model's gravity is not compared.\n";
    case TorqueKind::kExternal:
      return "The torques are only those that the robot's own model does not explain: the model of "
             "the\nconfiguration is not compared, only friction and payload are.\n";
  }
  return "";
}

std::string joints_table(const CheckModelReport& report) {
  const std::string& torque = report.torque_unit;
  TextTable table({{Align::kRight, {"", "joint"}},
                   {Align::kLeft, {"", "name"}},
                   {Align::kPoint, {"left over", "before"}},
                   {Align::kPoint, {torque, "after"}},
                   {Align::kLeft, {"offset", torque}},
                   {Align::kLeft, {"Coulomb friction", torque}},
                   {Align::kLeft, {"viscous friction", report.damping_unit}},
                   {Align::kLeft, {"reflected inertia", report.inertia_unit}}});
  if (report.calibrates) {
    table.add_column(Align::kPoint, {"explained, %", "before"});
    table.add_column(Align::kPoint, {"", "after"});
  }
  for (std::size_t i = 0; i < report.joints.size(); ++i) {
    const JointCheck& joint = report.check.joints[i];
    std::vector<std::string> row = {std::to_string(i + 1),
                                    text::printable(report.joints[i]),
                                    format_number(joint.residual_before, 3),
                                    format_number(joint.residual_after, 3),
                                    estimate_text(joint.offset),
                                    estimate_text(joint.coulomb_friction),
                                    estimate_text(joint.viscous_friction),
                                    estimate_text(joint.reflected_inertia)};
    if (report.calibrates) {
      row.push_back(format_number(100 * joint.explained_before, 4));
      row.push_back(format_number(100 * joint.explained_after, 4));
    }
    table.add_row(row);
  }
  return table.text();
}

std::string delay_text(const Estimate& delay) {
  if (!std::isfinite(delay.deviation)) return "";
  const Estimate ms{1e3 * delay.value, 1e3 * delay.deviation, delay.determined};
  return "Delay: the torques act " + estimate_text(ms) + " ms after their times" +
         (delay.value < 0 ? ", that is, they were measured late\n" : "\n");
}

/// The number of determined parameters, and the motion that would determine each other one.
std::string determined_text(const CheckModelReport& report) {
  const ModelCheck& check = report.check;
  std::string text =
      "The records tell " +
      (check.rank == check.parameters ? "all " : std::to_string(check.rank) + " of ") +
      std::to_string(check.parameters) + " parameters apart, the clearest " +
      format_number(check.condition, 2) + " times as well as the faintest\n";
  for (std::size_t i = 0; i < check.joints.size(); ++i) {
    if (check.joints[i].wanted.empty()) continue;
    text += "  joint " + std::to_string(i + 1) + ": " + check.joints[i].wanted + "\n";
  }
  return text;
}

std::string modes_text(const CheckModelReport& report) {
  const CalibratedLoop& loop = report.loop;
  if (loop.modes.empty()) return "";
  TextTable table(
      {{Align::kLeft, {"natural frequency", "rad/s"}}, {Align::kLeft, {"damping ratio", ""}}});
  for (const CalibratedMode& mode : loop.modes) {
    if (std::isnan(mode.natural_frequency)) {
      table.add_row({"none in the sampled loop", "-"});
      continue;
    }
    const auto text_of = [](double value, double deviation) {
      constexpr double kKnown = 0.05;  // of the value, with 95 %
      return estimate_text({value, deviation, 1.96 * deviation < kKnown * std::abs(value)});
    };
    table.add_row({text_of(mode.natural_frequency, mode.natural_frequency_std),
                   text_of(mode.damping_ratio, mode.damping_ratio_std)});
  }
  std::string text = "\nModes of the calibrated loop, at q =";
  for (const double q : report.rest) text += " " + format_number(q, 3);
  text += ", with a delay of " + count(loop.delay, "tick") +
          (loop.delay_found ? ", as the records have it; the configuration knows less: "
                              "analysis.sampled.delay\n"
                            : "\n");
  if (!loop.stable) text += "  These gains make this loop UNSTABLE: do not run it.\n";
  return text + table.text();
}

std::string payload_text(const ModelCheck& check) {
  constexpr double kHeldFast = 1e-6;  // kg, of a payload that is said to be known
  if (check.payload.mass.deviation < kHeldFast) return "Payload: as in the configuration\n";
  std::string text = "Payload: " + estimate_text(check.payload.mass) + " kg";
  const bool known = check.payload.mass.value > 3 * check.payload.mass.deviation;
  if (!known) return text + "\n";
  text += ", center";
  for (const Estimate& one : check.payload.center) text += "  " + estimate_text(one);
  return text + " m in the tip link\n";
}

Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json();
}

void put(Json& to, const std::string& name, const Estimate& one) {
  to[name] = one.value;
  to[name + "_std"] = number(one.deviation);
}

}  // namespace

std::string estimate_text(const Estimate& one) {
  if (!std::isfinite(one.deviation)) return "?";
  const double size = std::max({one.deviation, 1e-9 * std::abs(one.value), 1e-12});
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(size))), 0, 12);
  std::array<char, 100> text{};
  std::snprintf(text.data(), text.size(), "%.*f +- %.*f", decimals, one.value, decimals,
                one.deviation);
  return std::string(text.data()) + (one.determined ? "" : " ?");
}

std::string check_model_table(const CheckModelReport& report) {
  const ModelCheck& check = report.check;
  std::string text =
      format_number(check.used, 3) + " s of motion, " +
      (check.validation > 0
           ? "the last " + format_number(check.validation, 2) + " of them kept for validation, "
           : "") +
      "means over " + format_number(check.window, 2) + " s\n" + kind_sentence(check.kind) +
      (report.calibrates ? determined_text(report) : "") + "\n" + joints_table(report) + "\n" +
      payload_text(check) + delay_text(check.delay);
  std::string doubts;
  constexpr double kLate = 5e-3;  // s: more than drives and their sensors need
  if (check.delay.value < -kLate && check.delay.value < -4 * check.delay.deviation) {
    doubts = "  delay: the torques are " + format_number(-1e3 * check.delay.value, 3) +
             " ms late: is a filter in the way, or are two clocks?\n";
  }
  if (check.gravity) {
    const Eigen::Vector3d& g = *check.gravity;
    const std::string list =
        format_number(g[0], 3) + ", " + format_number(g[1], 3) + ", " + format_number(g[2], 3);
    constexpr double kDegree = 180 / std::numbers::pi;
    doubts += "  gravity: the torques " +
              std::string(check.gravity_fits ? "match" : "are closer to") +
              " an arm with robot.gravity: [" + list + "], not the model (+- " +
              format_number(kDegree * check.gravity_deviation, 2) + " deg): " +
              (check.gravity_fits ? "how is it mounted?\n" : "is the model wrong otherwise?\n");
  }
  for (const std::string& one : check.order) doubts += "  " + one + "\n";
  for (std::size_t i = 0; i < check.joints.size(); ++i) {
    const std::string& reason = check.joints[i].suspicious;
    if (reason.empty()) continue;
    doubts += "  joint " + std::to_string(i + 1) + ": " + reason + "\n";
  }
  text += doubts.empty() ? "No joint is suspicious.\n" : "\nSuspicious\n" + doubts;
  if (!check.ambiguities.empty()) text += "\nNot told apart\n";
  for (const std::string& one : check.ambiguities) text += "  " + one + "\n";
  if (!check.contacts.empty()) text += "\nLeft out, as other forces acted\n";
  for (const identification::LeftOut& one : check.contacts) {
    text += "  " + report.files[static_cast<std::size_t>(one.record)] + ": " +
            format_number(one.from, 4) + " to " + format_number(one.to, 4) + " s\n";
  }
  text += modes_text(report);
  if (!report.notes.empty()) text += "\n";
  for (const std::string& note : report.notes) text += "Note: " + note + "\n";
  return text;
}

Json check_model_json(const CheckModelReport& report) {
  const ModelCheck& check = report.check;
  Json joints = Json::array(), suspicious = Json::array(), left_out = Json::array();
  for (std::size_t i = 0; i < report.joints.size(); ++i) {
    const JointCheck& joint = check.joints[i];
    Json one = {
        {"name", text::printable(report.joints[i])},
        {"residual_rms", {{"before", joint.residual_before}, {"after", joint.residual_after}}}};
    put(one, "offset", joint.offset);
    put(one, "coulomb_friction", joint.coulomb_friction);
    put(one, "viscous_friction", joint.viscous_friction);
    put(one, "reflected_inertia", joint.reflected_inertia);
    one["determined"] = {{"reflected_inertia", joint.reflected_inertia.determined},
                         {"offset", joint.offset.determined},
                         {"coulomb_friction", joint.coulomb_friction.determined},
                         {"viscous_friction", joint.viscous_friction.determined}};
    one["moves"] = joint.moves;
    if (check.validation > 0) {
      one["explained"] = {{"before", joint.explained_before},
                          {"after", joint.explained_after},
                          {"correlation", joint.correlation}};
    }
    one["wanted"] = joint.wanted.empty() ? Json() : Json(joint.wanted);
    one["suspicious"] = joint.suspicious.empty() ? Json() : Json(joint.suspicious);
    joints.push_back(std::move(one));
    if (!joint.suspicious.empty()) {
      suspicious.push_back({{"joint", i + 1}, {"reason", joint.suspicious}});
    }
  }
  Json center = Json::array(), center_std = Json::array();
  bool determined = check.payload.mass.determined;
  for (const Estimate& one : check.payload.center) {
    center.push_back(one.value);
    center_std.push_back(number(one.deviation));
    determined = determined &&
                 (one.determined || check.payload.mass.value < 3 * check.payload.mass.deviation);
  }
  for (const identification::LeftOut& one : check.contacts) {
    left_out.push_back({{"file", report.files[static_cast<std::size_t>(one.record)]},
                        {"from", one.from},
                        {"to", one.to}});
  }
  Json payload;
  put(payload, "mass", check.payload.mass);
  payload["center"] = std::move(center);
  payload["center_std"] = std::move(center_std);
  payload["determined"] = determined;
  Json modes = Json::array();
  for (const CalibratedMode& mode : report.loop.modes) {
    modes.push_back({{"natural_frequency", mode.natural_frequency},
                     {"natural_frequency_std", number(mode.natural_frequency_std)},
                     {"damping_ratio", mode.damping_ratio},
                     {"damping_ratio_std", number(mode.damping_ratio_std)}});
  }
  Json result = {
      {"torques", kind_text(check.kind)},
      {"seconds", check.used},
      {"window", check.window},
      {"joints", std::move(joints)},
      {"payload", std::move(payload)},
      {"suspicious", std::move(suspicious)},
      {"order", check.order},
      {"gravity", check.gravity ? Json(json_list(*check.gravity)) : Json()},
      {"gravity_fits", check.gravity_fits},
      {"gravity_std", check.gravity_deviation},
      {"delay", check.delay.value},
      {"delay_std", number(check.delay.deviation)},
      {"delay_determined", check.delay.determined},
      {"information",
       {{"parameters", check.parameters}, {"rank", check.rank}, {"condition", check.condition}}},
      {"ambiguities", check.ambiguities},
      {"left_out", std::move(left_out)},
      {"notes", report.notes}};
  if (report.calibrates) {
    result["validation"] = check.validation;
    result["q"] = json_list(report.rest);
    result["modes"] = std::move(modes);
    result["loop"] = {{"delay", report.loop.delay}, {"stable", report.loop.stable}};
  }
  return result;
}

}  // namespace dashpot::apps
