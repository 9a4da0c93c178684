#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/controller/model/least_inertia.hpp>
#include <dashpot/controller/model/posture_sequence.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>

#include <algorithm>
#include <exception>

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

/// Whether the payload has a part in the damping. In motions that leave the tip where it is, it has
/// none.
bool counts_payload(const Gains& gains, Mode mode) noexcept {
  if (mode == Mode::kJoint) return gains.joint_damping_ratio > 0;
  const auto& held = gains.directions;
  const bool moves = std::find(held.begin(), held.end(), false) != held.end();
  return gains.task_damping_ratio > 0 || (moves && gains.null_damping_ratio > 0);
}

}  // namespace

GainJudge::GainJudge(const RobotModel& model, const Settings& settings)
    : model_(model),
      settings_(settings),
      attached_(model.attachment()),
      kernel_(model),
      bare_(unloaded(model)),
      loaded_(model.attachment().mass > 0),
      loop_(sampled_loop(model, settings)),
      elastic_(elastic_joints(model)),
      posture_loop_(model, judging(settings)) {}

GainJudge::Verdict GainJudge::judge(const JointVector& q, const Gains& gains) {
  const double wanted = settings_.limits.gain_margin;
  Verdict worst{wanted, Mode::kJoint};
  const Eigen::MatrixXd gravity = gravity_of(kernel_, q);
  const JointVector rest = JointVector::Zero(q.size());
  DynamicsResult robot, bare;
  kernel_.evaluate(q, rest, robot);
  if (loaded_) bare_.evaluate(q, rest, bare);
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    Setpoint setpoint;
    setpoint.mode = mode;
    setpoint.gains = gains;
    const Impedance springs(setpoint, static_cast<int>(q.size()));
    loop_.memory = integral_memory(robot, springs, settings_.integral.time, loop_.period);
    analysis::System<kMaxJoints> system;
    const bool known = posture_loop_.closed_loop(q, gains, mode, system) == Status::kOk;
    const double found = known ? margin(system, gravity, wanted) : 0;
    if (found < worst.margin) worst = {found, mode};
    if (!known || !loaded_ || !counts_payload(gains, mode)) continue;
    system.mass = bare.M;
    if (elastic_.any()) elastic_.extend_mass(system.mass);
    const double enough = std::min(kDropped, wanted);
    const double dropped = margin(system, gravity_of(bare_, q), enough);
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
  PostureLoop loop(model, judging(settings_));
  analysis::System<kMaxJoints> closed;
  if (loop.closed_loop(verdict.q, gains, verdict.mode, closed) != Status::kOk) return missing;
  analysis::System<> system(closed.dof());
  system.mass = closed.mass;
  system.damping = closed.damping;
  system.stiffness = closed.stiffness;
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

Eigen::MatrixXd GainJudge::gravity_of(const DynamicsKernel& kernel, const JointVector& q) const {
  return settings_.feed_forward.gravity ? gravity_gradient(kernel, q) : Eigen::MatrixXd();
}

double GainJudge::margin(const analysis::System<kMaxJoints>& system, const Eigen::MatrixXd& gravity,
                         double enough) try {
  analysis::SampledLoop loop = loop_;
  loop.gravity_gradient = gravity;
  loop.gears = elastic_;
  loop = analysis::with_gears(loop);
  analysis::SpectrumSolver<kMaxJoints> solver;
  analysis::Spectrum<kMaxJoints> spectrum;
  const analysis::Status solved = solver.solve(system, spectrum);
  if (solved != analysis::Status::kOk && solved != analysis::Status::kUncertified) return 0;
  return std::min(enough, analysis::gain_margin(system, spectrum, loop, enough, kSlowestVibration));
} catch (const std::exception&) {  // no convergence
  return 0;
}

}  // namespace dashpot::controller
