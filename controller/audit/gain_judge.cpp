#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/controller/model/least_inertia.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/rotors.hpp>

#include <algorithm>

namespace dashpot::controller {
namespace {

/// Returns the settings of the loop that is judged.
Settings judging(Settings settings) {
  settings.task_terms = {};
  settings.environment.tip_stiffness = settings.environment.tip_damping = Vector6::Zero();
  settings.environment.joint_stiffness = settings.environment.joint_damping =
      JointVector::Zero(settings.limits.torque.size());
  return settings;
}

/// Returns true if the payload adds to the damping. It does not in motions that leave the tip at
/// rest.
bool counts_payload(const Gains& gains, Mode mode) noexcept {
  if (mode == Mode::kJoint) return gains.joint_damping_ratio > 0;
  const auto& held = gains.directions;
  const bool moves = gains.null_projector == NullProjector::kNone ||
                     std::find(held.begin(), held.end(), false) != held.end();
  return gains.task_damping_ratio > 0 || (moves && gains.null_damping_ratio > 0);
}

}  // namespace

GainJudge::GainJudge(const RobotModel& model, const Settings& settings)
    : model_(model),
      settings_(settings),
      attached_(model.attachment()),
      loaded_(model.attachment().mass > 0),
      bare_(unloaded(model), timing_of(settings)),
      posture_loop_(model, judging(settings)) {}

GainJudge::Verdict GainJudge::judge(const JointVector& q, const Gains& gains) {
  const double wanted = settings_.limits.gain_margin;
  Verdict worst{wanted, Mode::kJoint};
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    analysis::System<kMaxJoints> system;
    const bool known = posture_loop_.closed_loop(q, gains, mode, system) == Status::kOk;
    const double found = known ? margin_up_to(system, posture_loop_.sampled(), wanted) : 0;
    if (found < worst.margin) worst = {found, mode};
    if (!known || !loaded_ || !counts_payload(gains, mode)) continue;
    DynamicsResult bare;
    bare_.kernel().evaluate(q, JointVector::Zero(q.size()), bare);
    system.mass = bare.M;
    if (bare_.gears().any()) bare_.gears().extend_mass(system.mass);
    analysis::SampledLoop loop = posture_loop_.sampled();
    const analysis::SampledLoop of_bare = with_gears(bare_.at(q));
    loop.gravity_gradient = of_bare.gravity_gradient;
    loop.compensation = of_bare.compensation;
    const double enough = std::min(kDropped, wanted);
    const double dropped = margin_up_to(system, loop, enough);
    if (dropped < std::min(enough, worst.margin)) worst = {dropped, mode, true};
  }
  worst.q = q;
  return worst;
}

GainJudge::Verdict GainJudge::judge_anywhere(const Gains& gains) {
  Verdict best{-1, Mode::kJoint};
  const Limits& limits = settings_.limits;
  const PostureSequence postures(limits.position_lower, limits.position_upper);
  for (int k = 0; k < kPostures && best.margin < limits.gain_margin; ++k) {
    const Verdict found = judge(postures.at(k), gains);
    if (found.margin > best.margin) best = found;
  }
  return best;
}

std::string GainJudge::missing(const Verdict& verdict, const Gains& gains) const {
  const RobotModel model = model_.with(attached_);
  std::string missing = missing_rotors_text(model);
  if (missing.empty() || verdict.q.size() == 0) return missing;
  const analysis::System<> system =
      PostureLoop(model, judging(settings_)).at(verdict.q, gains, verdict.mode).system;
  const std::optional<JointVector> enough =
      enough_reflected_inertia(model, system, settings_.period, [&](const RobotModel& with_rotors) {
        return GainJudge(with_rotors, settings_).judge(verdict.q, gains).margin >=
               settings_.limits.gain_margin;
      });
  if (const Drives* published = unknown_rotors(model).published) {
    const RobotModel with = with_at_least(model, published->values(published->reflected_inertia));
    missing +=
        ", with the published drives " + std::string(published->name) + " the margin is " +
        (GainJudge(with, settings_).judge(verdict.q, gains).margin >= settings_.limits.gain_margin
             ? "enough"
             : "too small");
  }
  const std::string hint = rotors_hint(model, "robot.reflected_inertia", "robot.drives:");
  if (!enough) return missing + ", but no reflected inertia would be enough. " + hint;
  return missing + ", and with " + inertia_text(model, *enough) + " the margin would be enough. " +
         hint;
}

}  // namespace dashpot::controller
