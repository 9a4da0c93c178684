#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>

namespace dashpot::controller {
namespace {

constexpr double kSlowest = 1;  // rad/s

/// Those of a controller whose closed loop has the gains of a set-point from the second tick on,
/// wherever the robot is.
Settings judging(Settings settings) {
  constexpr double kFar = 1e5;  // rad: set-points at the robot are within it
  settings.motion.gain_time = settings.period;
  settings.analysis.where = Analysis::Where::kOff;
  settings.analysis.sampled.interval = 0;
  settings.limits.position_lower.setConstant(-kFar);
  settings.limits.position_upper.setConstant(kFar);
  settings.limits.walls.clear();
  settings.task_terms = {};
  return settings;
}

}  // namespace

GainJudge::GainJudge(const RobotModel& model, const Settings& settings)
    : model_(model),
      wanted_(settings.limits.gain_margin),
      gravity_(settings.feed_forward.gravity),
      loop_(sampled_loop(model, settings)),
      controller_(model, judging(settings)) {}

GainJudge::Verdict GainJudge::judge(const JointVector& q, const Gains& gains) {
  Verdict worst{std::numeric_limits<double>::infinity(), Mode::kJoint};
  loop_.gravity_gradient = Eigen::MatrixXd();
  if (gravity_) loop_.gravity_gradient = gravity_gradient(model_, q);
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    const double found = margin(q, gains, mode);
    if (found < worst.margin) worst = {found, mode};
  }
  worst.margin = std::min(worst.margin, wanted_);
  return worst;
}

double GainJudge::margin(const JointVector& q, const Gains& gains, Mode mode) try {
  const JointVector rest = JointVector::Zero(q.size());
  const DynamicsResult there = evaluate(model_, q, rest);
  controller_.reset();
  RobotState state;
  state.position = q;
  state.velocity = rest;
  Setpoint setpoint;
  setpoint.mode = mode;
  setpoint.joint_position = q;
  setpoint.tip_pose = {there.p_BT_B, there.R_BT};
  setpoint.gains = gains;
  const auto period = static_cast<std::int64_t>(std::ceil(1e9 * controller_.settings().period));
  JointVector torque;
  for (int tick = 0; tick < 3; ++tick) {
    time_ += period;
    state.time = setpoint.time = time_;
    const Status status = controller_.update(state, setpoint, torque);
    if (status == Status::kSetpointRejected || status > Status::kWeightNotHeld) return 0;
  }
  analysis::System<kMaxJoints> system;
  controller_.closed_loop(system);
  analysis::SpectrumSolver<kMaxJoints> solver;
  analysis::Spectrum<kMaxJoints> spectrum;
  const analysis::Status solved = solver.solve(system, spectrum);
  if (solved != analysis::Status::kOk && solved != analysis::Status::kUncertified) return 0;
  return analysis::gain_margin(system, spectrum, loop_, wanted_, kSlowest);
} catch (const std::exception&) {  // no convergence
  return 0;
}

}  // namespace dashpot::controller
