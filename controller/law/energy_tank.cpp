#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/law/energy_tank.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::controller {

EnergyTank::EnergyTank(const RobotModel& model, const Settings& settings)
    : store_(settings.energy.from == Energy::From::kTank ? settings.energy.store : 0),
      period_(settings.period),
      weakened_(model.dof()),
      delay_(static_cast<std::size_t>(settings.analysis.sampled.delay)),
      viscous_(model.joint_values(&Joint::viscous_friction)),
      coulomb_(model.joint_values(&Joint::coulomb_friction)) {
  reset();
}

void EnergyTank::reset() noexcept {
  level_ = store_;
  applied_ = 0;
  known_ = false;
  no_springs();
}

void EnergyTank::count_work(const JointVector& q, const JointVector& weight, double dt) noexcept {
  constexpr double kLostOfCoulomb = 0.0028;  // rad/s: c v tanh(v / 0.01 rad/s) >= c (|v| - this)
  if (known_ && applied_ > delay_) {
    const JointVector& tau = torques_[(applied_ - 1 - delay_) % torques_.size()];
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      const double dq = q[i] - q_[i];
      const double dissipated = viscous_[i] * dq * dq / dt +
                                coulomb_[i] * std::max(0.0, std::abs(dq) - kLostOfCoulomb * dt);
      level_ -= (tau[i] - 0.5 * (weight_[i] + weight[i])) * dq - dissipated;
    }
    level_ = std::min(level_, store_ + committed_);
  }
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
    if (impedance.null_space()) add(null_space.damper(impedance.null_damping, back), result);
    if (impedance.null_damping_ratio > 0) add(null_space.ratio_damper(back), result);
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
  const double there = std::max(0.0, level_ - kReserve * store_);
  share_ = std::min(energy > there ? there / energy : 1, affordable(product(pull, law.qd), there));
  committed_ = share_ * energy;
  if (share_ < 1) {
    weakened_ = impedance;
    weakened_.joint_stiffness *= share_;
    weakened_.base.stiffness *= share_;
    weakened_.tool.stiffness *= share_;
    weakened_.null_stiffness *= share_;
  }
  JointVector further = difference(asked.torque, torque_against(law));
  add(pull, further, -1);
  add(weight, further, -1);
  const double fed = affordable(product(further, law.qd), there - committed_);
  add(pull, asked.torque, share_ - 1);
  add(further, asked.torque, fed - 1);
  return share_ < 1 || fed < 1;
}

double EnergyTank::affordable(double power, double energy) const noexcept {
  const double spent = 2 * (static_cast<double>(delay_) + 1) * period_ * power;
  return spent > energy ? std::max(0.0, energy / spent) : 1;
}

void EnergyTank::apply(const JointVector& torque) noexcept {
  torques_[applied_++ % torques_.size()] = torque;
}

}  // namespace dashpot::controller
