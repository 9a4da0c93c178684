#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/controller/model/least_inertia.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <numbers>

namespace dashpot::controller {
namespace {

constexpr std::array<double, kMaxJoints> kPrimes{2,  3,  5,  7,  11, 13, 17, 19,
                                                 23, 29, 31, 37, 41, 43, 47, 53};

/// Those of the loop that is judged.
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
      lower_(settings.limits.position_lower),
      upper_(settings.limits.position_upper),
      wanted_(settings.limits.gain_margin),
      integral_time_(settings.integral.time),
      gravity_(settings.feed_forward.gravity),
      loop_(sampled_loop(model, settings)),
      posture_loop_(model, judging(settings)) {}

GainJudge::Verdict GainJudge::judge(const JointVector& q, const Gains& gains) {
  Verdict worst{wanted_, Mode::kJoint};
  const Eigen::MatrixXd gravity = gravity_of(kernel_, q);
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    analysis::System<kMaxJoints> system;
    const bool known = posture_loop_.closed_loop(q, gains, mode, system) == Status::kOk;
    loop_.memory = memory(q, gains, mode);
    const double found = known ? margin(system, gravity, wanted_) : 0;
    if (found < worst.margin) worst = {found, mode};
    if (!known || !loaded_ || !counts_payload(gains, mode)) continue;
    DynamicsResult there;
    bare_.evaluate(q, JointVector::Zero(q.size()), there);
    system.mass = there.M;
    const double enough = std::min(kDropped, wanted_);
    const double dropped = margin(system, gravity_of(bare_, q), enough);
    if (dropped < std::min(enough, worst.margin)) worst = {dropped, mode, true};
  }
  worst.q = q;
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

std::string GainJudge::missing(const Verdict& verdict, const Gains& gains) const {
  const RobotModel model = model_.with(attached_);
  const std::string missing = missing_rotors_text(model);
  if (missing.empty() || verdict.q.size() == 0) return missing;
  PostureLoop loop(model, judging(settings_));
  analysis::System<kMaxJoints> closed;
  if (loop.closed_loop(verdict.q, gains, verdict.mode, closed) != Status::kOk) return missing;
  analysis::System<> system(verdict.q.size());
  system.mass = closed.mass;
  system.damping = closed.damping;
  system.stiffness = closed.stiffness;
  const std::optional<JointVector> enough =
      enough_reflected_inertia(model, system, settings_.period, [&](const RobotModel& with_rotors) {
        return GainJudge(with_rotors, settings_).judge(verdict.q, gains).margin >= wanted_;
      });
  const std::string hint = rotors_hint(model, "robot.reflected_inertia", "robot.drives:");
  if (!enough) return missing + ", but no reflected inertia would be enough. " + hint;
  return missing + ", and with " + inertia_text(model, *enough) + " the margin would be enough. " +
         hint;
}

Eigen::MatrixXd GainJudge::gravity_of(const DynamicsKernel& kernel, const JointVector& q) const {
  return gravity_ ? gravity_gradient(kernel, q) : Eigen::MatrixXd();
}

analysis::ControllerMemory GainJudge::memory(const JointVector& q, const Gains& gains,
                                             Mode mode) const {
  Setpoint setpoint;
  setpoint.mode = mode;
  setpoint.gains = gains;
  const int n = static_cast<int>(q.size());
  DynamicsResult robot;
  kernel_.evaluate(q, JointVector::Zero(n), robot);
  return integral_memory(robot, Impedance(setpoint, n), integral_time_, loop_.period);
}

double GainJudge::margin(const analysis::System<kMaxJoints>& system, const Eigen::MatrixXd& gravity,
                         double enough) try {
  loop_.gravity_gradient = gravity;
  analysis::SpectrumSolver<kMaxJoints> solver;
  analysis::Spectrum<kMaxJoints> spectrum;
  const analysis::Status solved = solver.solve(system, spectrum);
  if (solved != analysis::Status::kOk && solved != analysis::Status::kUncertified) return 0;
  return std::min(enough,
                  analysis::gain_margin(system, spectrum, loop_, enough, kSlowestVibration));
} catch (const std::exception&) {  // no convergence
  return 0;
}

}  // namespace dashpot::controller
