#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <numbers>

namespace dashpot::controller {
namespace {

constexpr double kSlowest = 1;  // rad/s
constexpr std::array<double, kMaxJoints> kPrimes{2,  3,  5,  7,  11, 13, 17, 19,
                                                 23, 29, 31, 37, 41, 43, 47, 53};

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
      lower_(settings.limits.position_lower),
      upper_(settings.limits.position_upper),
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

GainJudge::Verdict GainJudge::judge_anywhere(const Gains& gains) {
  Verdict best{-1, Mode::kJoint};
  JointVector q(lower_.size());
  for (int k = 0; k < kPostures && best.margin < wanted_; ++k) {
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      // Kronecker's sequence of the roots of primes: no two joints run through the same values.
      const double share = std::fmod((k + 1) * std::sqrt(kPrimes[static_cast<std::size_t>(i)]), 1);
      const double turn = 2 * std::numbers::pi;  // where there is no limit
      double low = std::isfinite(upper_[i]) ? upper_[i] - turn : -turn / 2;
      if (std::isfinite(lower_[i])) low = lower_[i];
      const double high = std::isfinite(upper_[i]) ? upper_[i] : low + turn;
      q[i] = low + share * (high - low);
    }
    const Verdict found = judge(q, gains);
    if (found.margin > best.margin) best = found;
  }
  return best;
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
