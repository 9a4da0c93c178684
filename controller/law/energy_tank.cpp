#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/law/energy_tank.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::controller {
namespace {

constexpr double kFullTurn = 2 * std::numbers::pi;

}  // namespace

EnergyTank::EnergyTank(const RobotModel& model, const Settings& settings)
    : store_(settings.energy.from == Energy::From::kTank ? settings.energy.store : 0),
      period_(settings.period),
      lag_(settings.analysis.sampled.cutoff > 0 ? 1 / (kFullTurn * settings.analysis.sampled.cutoff)
                                                : 0),
      passed_(lag_ > 0 ? 1 - std::exp(-period_ / lag_) : 1),
      late_((settings.analysis.sampled.delay + 0.5) * period_ + lag_),
      weakened_(model.dof()),
      delay_(static_cast<std::size_t>(settings.analysis.sampled.delay)),
      per_rate_(settings.limits.torque_rate.cwiseInverse()),
      viscous_(model.joint_values(&Joint::viscous_friction)),
      coulomb_(model.joint_values(&Joint::coulomb_friction)) {
  reset();
}

void EnergyTank::reset() noexcept {
  fill();
  applied_ = 0;
  known_ = false;
}

void EnergyTank::fill() noexcept {
  level_ = store_;
  no_springs();
}

void EnergyTank::count_work(const JointVector& q, const JointMatrix& M, const JointVector& weight,
                            double dt, bool same_body) noexcept {
  constexpr double kOnTime = 1.5;            // periods
  constexpr double kWindow = 0.05;           // s
  constexpr double kLostOfCoulomb = 0.0028;  // rad/s: c v tanh(v / 0.01 rad/s) >= c (|v| - this)
  const double before = level_;
  const bool on_time = dt <= kOnTime * period_;
  if (known_ && applied_ > delay_) {
    const JointVector& tau = torques_[(applied_ - 1 - delay_) % torques_.size()];
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      level_ -= (tau[i] - 0.5 * (weight_[i] + weight[i])) * (q[i] - q_[i]);
    }
    // Where states were missing other torques acted meanwhile, so nothing is gained.
    if (!on_time) level_ = std::min(level_, before);
  }
  window_ += dt;
  if (known_ && on_time && window_ >= kWindow) {  // a shorter one takes noise for motion
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      const double dq = q[i] - window_q_[i];
      level_ += viscous_[i] * dq * dq / window_ +
                coulomb_[i] * std::max(0.0, std::abs(dq) - kLostOfCoulomb * window_);
    }
  }
  if (!known_ || !on_time || window_ >= kWindow) {
    window_ = 0;
    window_q_ = q;
  }
  level_ = std::min(level_, store_ + committed_);
  if (!known_ || !same_body) smoothed_weight_ = weight;
  add(difference(weight, smoothed_weight_), smoothed_weight_, 1 - std::exp(-dt / late_));
  mass_.compute(M, 1e-14 * M.trace());
  known_ = true;
  q_ = q;
  weight_ = weight;
}

namespace {

/// Returns the torque of the dampers if no reference moved, n.
JointVector torque_against(const ImpedanceLaw::Input& law) noexcept {
  const auto& [robot, q, qd, impedance, null_space, references, clamp, wrench, integral] = law;
  JointVector back = JointVector::Zero(qd.size()), result = back;
  add(qd, back, -1);
  add_product(impedance.joint_damping, back, result);
  if (impedance.task_weight > 0) {
    const Matrix6 C = impedance.base.damping + turned(impedance.tool.damping, robot.R_BT);
    add_torque(robot.J, C * twist(robot.J, back), result);
    if (impedance.null_space()) {
      add(null_space.damper(impedance.null_damping, back), result);
      if (impedance.null_damping_ratio > 0) add(null_space.ratio_damper(back), result);
    }
  }
  return result;
}

}  // namespace

bool EnergyTank::limit(const ImpedanceLaw::Input& law, const JointVector& weight,
                       LawTorque& asked) noexcept {
  constexpr double kReserve = 0.01;  // of the store
  const Impedance& impedance = law.impedance;
  JointVector pull = JointVector::Zero(law.q.size());
  double energy = 0;
  if (impedance.joint_weight > 0) {
    const JointVector error = difference(law.references.joint.position(), law.q);
    add_product(impedance.joint_stiffness, error, pull);
    energy += 0.5 * product(error, pull);
  }
  if (impedance.task_weight > 0) {
    energy += 0.5 * asked.tip_error.dot(asked.tip_pull);
    add_torque(law.robot.J, asked.tip_pull, pull);
    if (asked.posture_error.size() == pull.size()) {
      add(law.null_space.spring(impedance.null_stiffness, asked.posture_error), pull);
      for (Eigen::Index i = 0; i < pull.size(); ++i) {
        energy +=
            0.5 * impedance.null_stiffness[i] * asked.posture_error[i] * asked.posture_error[i];
      }
    }
  }
  energy = std::max(0.0, energy);  // of a K that couples what the error clamp shortens apart
  const JointVector against = torque_against(law), moving = difference(asked.dampers, against);
  JointVector further = difference(asked.torque, against);
  add(pull, further, -1);
  add(weight, further, -1);

  double fade = 0;  // s
  for (Eigen::Index i = 0; i < pull.size(); ++i) {
    const double largest = std::abs(against[i]) + std::abs(pull[i]) + std::abs(further[i]);
    fade = std::max(fade, largest * per_rate_[i]);
  }
  const double lasts = period_ + 0.5 * fade;
  JointVector motion = law.qd;
  mass_.multiply_LT(motion.data());
  const double speed = motion.norm(), there = std::max(0.0, level_ - kReserve * store_);
  double left = std::max(
      0.0, std::sqrt(speed * speed + 2 * there) - speed - under_way() - lasts * size(against));
  const auto spend = [&left, lasts](double most) {
    const double wanted = lasts * most, spent = std::min(wanted, left);
    left -= spent;
    return wanted > spent ? spent / wanted : 1;
  };
  share_ = energy > there ? there / energy : 1;
  share_ *= spend(share_ * size(pull));
  committed_ = share_ * energy;
  if (share_ < 1) {
    weakened_ = impedance;
    weakened_.joint_stiffness *= share_;
    weakened_.base.stiffness *= share_;
    weakened_.tool.stiffness *= share_;
    weakened_.null_stiffness *= share_;
  }
  const double fed = spend(size(further));
  add(pull, asked.torque, share_ - 1);
  add(further, asked.torque, fed - 1);
  add(moving, asked.dampers, fed - 1);
  asked.tip_wrench += (share_ - 1) * asked.tip_pull;
  // The weight that the torque will meet: one that comes late feeds a moving arm.
  add(difference(weight, smoothed_weight_), asked.torque);
  return share_ < 1 || fed < 1;
}

double EnergyTank::size(JointVector torque) const noexcept {
  mass_.solve_L(torque.data());
  return torque.norm();
}

double EnergyTank::under_way() const noexcept {
  if (applied_ == 0) return 0;
  double sum = lag_ * sizes_[(applied_ - 1) % sizes_.size()];
  for (std::size_t k = 1; k <= std::min(delay_, applied_); ++k) {
    sum += period_ * sizes_[(applied_ - k) % sizes_.size()];
  }
  return sum;
}

void EnergyTank::apply(const JointVector& torque) noexcept {
  if (applied_ == 0) acting_ = torque;
  add(difference(torque, acting_), acting_, passed_);
  const std::size_t slot = applied_++ % torques_.size();
  torques_[slot] = acting_;
  sizes_[slot] = known_ ? size(difference(acting_, weight_)) : 0;
}

}  // namespace dashpot::controller
