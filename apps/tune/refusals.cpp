#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/tune/tuned_loop.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/controller/settings_check.hpp>

#include <algorithm>
#include <sstream>

namespace dashpot::apps {
namespace {

Json refusal_json(const std::string& key, const std::string& reason) {
  return {{"key", key}, {"reason", reason}};
}

}  // namespace

Json warnings(const TunedArm& arm, const TunedDesign& design) {
  Json result = Json::array();
  for (const std::string& one : arm.model().warnings()) result.push_back(refusal_json("arm", one));
  if (design.stated.inertia_blocks) return result;
  for (const std::string& one : controller::doubtful_gains(arm.model(), design.stated.gains)) {
    result.push_back(refusal_json("gains", one));
  }
  return result;
}

Json refusals(const TunedArm& arm, const TunedDesign& design, const controller::JointVector& q) {
  Json result = Json::array();
  const std::string lost = controller::lost_directions(arm.model(), q);
  if (!lost.empty() && design.stated.mode == controller::Mode::kCartesian) {
    result.push_back(refusal_json("q", "the posture is singular: no spring acts in direction " +
                                           lost + "; a damping ratio means little here"));
  }
  const std::string heavy = controller::too_heavy(arm.model(), q);
  if (!heavy.empty()) result.push_back(refusal_json("q", heavy));
  if (arm.torque_guessed()) {
    result.push_back(refusal_json("limits.torque",
                                  "the model has no effort limits; this page takes 100 N m, a "
                                  "configuration must state the limit of each joint"));
  }
  const controller::Gains& gains = design.settings.initial.gains;
  if (design.stated.inertia_blocks) {
    result.push_back(refusal_json(
        "inertia_blocks", "Dashpot's controller does not multiply gains by the tip's inertia"));
    return result;
  }
  for (const controller::Mode mode : {controller::Mode::kJoint, controller::Mode::kCartesian}) {
    const auto fault = controller::check_gains(gains, mode, arm.model().dof());
    if (!fault) continue;
    result.push_back(refusal_json(fault.key, fault.reason));
    return result;
  }
  try {
    controller::Settings settings = design.settings;
    settings.analysis.where = controller::Analysis::Where::kOff;
    settings.analysis.sampled.interval = 0;
    (void)controller::Controller(arm.model(), settings);
  } catch (const controller::InvalidSettings& error) {
    result.push_back(refusal_json(error.key(), error.what()));
    return result;
  }
  if (design.stated.period == 0) return result;
  const controller::GainJudge::Verdict verdict =
      controller::GainJudge(arm.model(), design.settings).judge(q, gains);
  const double asked =
      verdict.dropped ? controller::GainJudge::kDropped : design.settings.limits.gain_margin;
  if (verdict.margin < std::min(asked, design.settings.limits.gain_margin)) {
    std::ostringstream text;
    text.precision(3);
    text << "with the " << (verdict.mode == controller::Mode::kJoint ? "joint" : "task")
         << " gains the sampled loop " << (verdict.margin < 1 ? "is unstable here, with" : "has")
         << " a gain margin of " << verdict.margin << (verdict.margin < 1 ? "" : " here")
         << (verdict.dropped ? " once the payload is dropped, " : ", ") << asked << " is asked for";
    const std::string missing = controller::missing_rotors_text(arm.model());
    if (!missing.empty()) text << "; " << missing;
    result.push_back(refusal_json("gain_margin", text.str()));
  }
  return result;
}

}  // namespace dashpot::apps
