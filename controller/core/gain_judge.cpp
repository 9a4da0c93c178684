#include <dashpot/analysis/spectrum.hpp>
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

}  // namespace

GainJudge::GainJudge(const RobotModel& model, const Settings& settings)
    : kernel_(model),
      lower_(settings.limits.position_lower),
      upper_(settings.limits.position_upper),
      wanted_(settings.limits.gain_margin),
      gravity_(settings.feed_forward.gravity),
      loop_(sampled_loop(model, settings)),
      posture_loop_(model, judging(settings)) {}

GainJudge::Verdict GainJudge::judge(const JointVector& q, const Gains& gains) {
  Verdict worst{std::numeric_limits<double>::infinity(), Mode::kJoint};
  loop_.gravity_gradient = Eigen::MatrixXd();
  if (gravity_) loop_.gravity_gradient = gravity_gradient(kernel_, q);
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
  analysis::System<kMaxJoints> system;
  if (posture_loop_.closed_loop(q, gains, mode, system) != Status::kOk) return 0;
  analysis::SpectrumSolver<kMaxJoints> solver;
  analysis::Spectrum<kMaxJoints> spectrum;
  const analysis::Status solved = solver.solve(system, spectrum);
  if (solved != analysis::Status::kOk && solved != analysis::Status::kUncertified) return 0;
  return analysis::gain_margin(system, spectrum, loop_, wanted_, kSlowestVibration);
} catch (const std::exception&) {  // no convergence
  return 0;
}

}  // namespace dashpot::controller
