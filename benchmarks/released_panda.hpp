#pragma once
// A Panda under Cartesian impedance control that is let go: one right-hand side for all
// integrators.
#include <dashpot/sim/dynamics/articulated_body.hpp>
#include <dashpot/sim/simulated_system.hpp>
#include <dashpot/tests/support/places.hpp>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <limits>
#include <string>

namespace dashpot::bench {

/// Without gravity, as a law that compensates it leaves the arm:
///   M(q) qdd + C(q, qd) qd = J' (K_C e - C_C v) - K_0 (q - q_0) - D_0 qd,
/// e the way from the tip to its goal (m, and the rotation vector, rad), v the tip's twist.
class ReleasedPanda : public sim::System {
 public:
  static constexpr int kJoints = 7;
  using State = std::array<double, 2 * kJoints>;  ///< q, qd

  /// `gain`: K_C = gain diag(1, 1, 1, 0.05, 0.05, 0.05), N/m and N m/rad.
  explicit ReleasedPanda(double gain)
      : System(kJoints), gain_(gain), robot_(read()), bodies_(robot_) {
    goal_ = pose_at(rest());
  }

  static State start() {
    State y{};
    for (int i = 0; i < kJoints; ++i) {
      y[static_cast<std::size_t>(i)] = rest()[static_cast<std::size_t>(i)] + kOffset;
    }
    return y;
  }

  /// y' at y = (q, qd)
  void derivative(const double* y, double* y_dot) noexcept {
    const double *q = y, *qd = y + kJoints;
    ++evaluations_;
    bodies_.move_to(q, qd);
    bodies_.push_tip(tip_wrench());
    std::array<double, kJoints> tau;
    for (std::size_t i = 0; i < kJoints; ++i) {
      tau[i] = -kPosture * (q[i] - rest()[i]) - kFriction * qd[i];
      y_dot[i] = qd[i];
    }
    bodies_.accelerations(tau.data(), y_dot + kJoints);
  }

  double begin_segment(double) noexcept override { return std::numeric_limits<double>::infinity(); }
  void rates(const sim::StateVector& y, sim::StateVector& y_dot) noexcept override {
    derivative(y.data(), y_dot.data());
    y_dot.tail<sim::kWorkChannels>().setZero();
  }
  sim::StoredEnergy stored_energy(const sim::StateVector&) noexcept override { return {}; }

  /// The wrench of springs and dampers for a tip at `pose` that moves with `twist`.
  sim::Vector6 wrench_of(const sim::Pose& pose, const sim::Vector6& twist) const noexcept {
    const Eigen::Matrix3d turn = goal_.rotation * pose.rotation.transpose();
    const Eigen::Vector3d axis(turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0),
                               turn(1, 0) - turn(0, 1));
    const double twice_sine = axis.norm();
    const double angle = std::atan2(twice_sine, turn.trace() - 1);
    const double scale = twice_sine > 1e-6 ? angle / twice_sine : 0.5;
    sim::Vector6 wrench;
    wrench.head<3>() = gain_ * (goal_.position - pose.position);
    wrench.tail<3>() = kTurning * gain_ * scale * axis;
    wrench.head<3>() -= std::sqrt(gain_) * kLinearDamping * twist.head<3>();
    wrench.tail<3>() -= std::sqrt(gain_) * kAngularDamping * twist.tail<3>();
    return wrench;
  }

  const sim::Robot& robot() const noexcept { return robot_; }
  /// Returns how often y' was evaluated so far.
  long evaluations() const noexcept { return evaluations_; }

  static const std::array<double, kJoints>& rest() noexcept {
    static constexpr std::array<double, kJoints> kRest = {0, -0.785, 0, -2.356, 0, 1.571, 0.785};
    return kRest;
  }
  static std::string file() { return DASHPOT_SOURCE_DIR "/sim/models/panda.urdf"; }

  static constexpr double kOffset = 0.05;          // of each joint at the start, rad
  static constexpr double kTurning = 0.05;         // m^2
  static constexpr double kLinearDamping = 0.3;    // N s/m per sqrt(N/m)
  static constexpr double kAngularDamping = 0.01;  // N m s/rad per sqrt(N/m)
  static constexpr double kPosture = 5;            // K_0, N m/rad
  static constexpr double kFriction = 0.3;         // D_0, N m s/rad

 private:
  static sim::Robot read() {
    sim::RobotParameters parameters;
    parameters.gravity.setZero();
    return sim::Robot::from_file(file(), "panda_link0", "panda_hand_tcp", parameters);
  }
  sim::Pose pose_at(const std::array<double, kJoints>& q) {
    constexpr std::array<double, kJoints> kAtRest{};
    bodies_.move_to(q.data(), kAtRest.data());
    return bodies_.tip_pose();
  }
  sim::Vector6 tip_wrench() const noexcept {
    return wrench_of(bodies_.tip_pose(), bodies_.tip_twist());
  }

  double gain_;
  sim::Robot robot_;
  sim::ArticulatedBody bodies_;
  sim::Pose goal_;
  long evaluations_ = 0;
};

}  // namespace dashpot::bench
