#include <dashpot/apps/check_model/check_model_report.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/text/printable.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace dashpot::apps {
namespace {

using identification::Estimate;
using identification::JointCheck;
using identification::ModelCheck;
using identification::TorqueKind;
using Align = TextTable::Align;

/// "12.345 +- 0.012": two digits of the deviation, and as many of the value; "?" if the records do
/// not narrow the value down.
std::string estimate_text(const Estimate& one) {
  if (!std::isfinite(one.deviation)) return "?";
  const double size = std::max({one.deviation, 1e-9 * std::abs(one.value), 1e-12});
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(size))), 0, 12);
  std::array<char, 100> text{};
  std::snprintf(text.data(), text.size(), "%.*f +- %.*f", decimals, one.value, decimals,
                one.deviation);
  return std::string(text.data()) + (one.determined ? "" : " ?");
}

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
  TextTable table({{Align::kRight, {"", "joint"}},
                   {Align::kLeft, {"", "name"}},
                   {Align::kPoint, {"left over", "before"}},
                   {Align::kPoint, {"N m", "after"}},
                   {Align::kLeft, {"offset", "N m"}},
                   {Align::kLeft, {"Coulomb friction", "N m"}},
                   {Align::kLeft, {"viscous friction", "N m s/rad"}}});
  for (std::size_t i = 0; i < report.joints.size(); ++i) {
    const JointCheck& joint = report.check.joints[i];
    table.add_row({std::to_string(i + 1), text::printable(report.joints[i]),
                   format_number(joint.residual_before, 3), format_number(joint.residual_after, 3),
                   estimate_text(joint.offset), estimate_text(joint.coulomb_friction),
                   estimate_text(joint.viscous_friction)});
  }
  return table.text();
}

std::string payload_text(const ModelCheck& check) {
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

std::string check_model_table(const CheckModelReport& report) {
  const ModelCheck& check = report.check;
  std::string text = format_number(check.used, 3) + " s of motion, means over " +
                     format_number(check.window, 2) + " s\n" + kind_sentence(check.kind) + "\n" +
                     joints_table(report) + "\n" + payload_text(check);
  std::string doubts;
  if (check.gravity) {
    const Eigen::Vector3d& g = *check.gravity;
    const std::string list =
        format_number(g[0], 3) + ", " + format_number(g[1], 3) + ", " + format_number(g[2], 3);
    doubts = "  gravity: the torques are " +
             std::string(check.gravity_fits ? "those" : "nearer to those") +
             " of an arm with robot.gravity: [" + list + "], not as the model says: " +
             (check.gravity_fits ? "does it hang from a ceiling, or at a wall?\n"
                                 : "is its base inclined, or the model wrong otherwise?\n");
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
    one["determined"] = {{"offset", joint.offset.determined},
                         {"coulomb_friction", joint.coulomb_friction.determined},
                         {"viscous_friction", joint.viscous_friction.determined}};
    one["moves"] = joint.moves;
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
  return {{"torques", kind_text(check.kind)},
          {"seconds", check.used},
          {"window", check.window},
          {"joints", std::move(joints)},
          {"payload", std::move(payload)},
          {"suspicious", std::move(suspicious)},
          {"order", check.order},
          {"gravity", check.gravity ? Json(json_list(*check.gravity)) : Json()},
          {"gravity_fits", check.gravity_fits},
          {"ambiguities", check.ambiguities},
          {"left_out", std::move(left_out)},
          {"notes", report.notes}};
}

}  // namespace dashpot::apps
