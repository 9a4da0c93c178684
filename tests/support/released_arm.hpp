#pragma once
// The real controller and the simulator's arm, which share no code, in one loop; and what it takes
// to displace the arm and let it go.

#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/sim/arm.hpp>
#include <dashpot/sim/plant.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/state_fit.hpp>
#include <dashpot/tests/support/twin_models.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

namespace dashpot::testing {

/// Springs and dampers at the tip with which, friction apart, the modes have these frequencies
/// (rad/s) and about these ratios: with A = J M^-1 J' = L L' and a rotation R,
///     K_C = F diag(omega^2) F',  C_C = F D (1 + coupling S) D F',  F = L^-T R,
/// D^2 = diag(2 zeta omega) and S random, symmetric positive definite, of size one.
inline controller::Gains tip_gains(const TwinModels& twin, const controller::JointVector& q,
                                   const Eigen::VectorXd& omega, const Eigen::VectorXd& zeta,
                                   double coupling, Random& random) {
  using Eigen::MatrixXd;
  const auto robot = evaluate(twin.model, q, controller::JointVector::Zero(q.size()));
  const MatrixXd M = robot.M, J = robot.J, A = J * M.llt().solve(J.transpose());
  const MatrixXd R = Eigen::HouseholderQR<MatrixXd>(random.matrix(6, 6)).householderQ();
  const MatrixXd F = A.llt().matrixU().solve(R);
  const MatrixXd D = (2 * zeta.cwiseProduct(omega)).cwiseSqrt().asDiagonal();
  const MatrixXd S = random.spd(6);
  const MatrixXd K = F * omega.cwiseAbs2().asDiagonal() * F.transpose();
  const MatrixXd C =
      F * D * (MatrixXd::Identity(6, 6) + coupling / S.norm() * S) * D * F.transpose();
  controller::Gains gains;
  gains.task_stiffness = 0.5 * (K + K.transpose());
  gains.task_damping = 0.5 * (C + C.transpose());
  gains.null_stiffness = gains.null_damping = controller::JointVector::Zero(q.size());
  return gains;
}

/// The direction of the self-motion of an arm with one joint too many, n, M-orthonormal.
inline Eigen::VectorXd self_motion(const TwinModels& twin, const controller::JointVector& q) {
  const auto robot = evaluate(twin.model, q, controller::JointVector::Zero(q.size()));
  const Eigen::MatrixXd J = robot.J, M = robot.M;
  const Eigen::VectorXd u = Eigen::FullPivLU<Eigen::MatrixXd>(J).kernel().col(0);
  return u / std::sqrt(u.dot(M * u));
}

/// Settings with these Cartesian gains from the first tick on and nothing that interferes.
inline controller::Settings release_settings(const TwinModels& twin, const controller::Gains& gains,
                                             double period) {
  controller::Settings settings = controller::default_settings(twin.model);
  settings.period = period;
  settings.motion.gain_time = period;
  settings.motion.smoothing = 20 * period;
  settings.watchdog.setpoint_hold = settings.watchdog.setpoint_damp = 0;
  settings.analysis.share = 1;
  settings.analysis.every = 1'000'000'000;  // at the first tick only
  settings.initial.mode = controller::Mode::kCartesian;
  const controller::Gains before = settings.initial.gains;
  settings.initial.gains = gains;
  settings.initial.gains.joint_stiffness = before.joint_stiffness;
  settings.initial.gains.joint_damping = before.joint_damping;
  return settings;
}

/// Any torque may act, and an arm may stand still to the last bit.
inline void allow_any_torque(controller::Settings& settings) {
  settings.watchdog.feedback = 0;
  settings.limits.beyond_model = true;
  settings.limits.torque.setConstant(1e4);
  settings.limits.torque_rate.setConstant(1e6);
}

/// The controller starts with its springs at rest at q0, and what it is `told` is attached; then a
/// hand leads the arm smoothly along q0 + s dq, holds it there, and lets go.
class ReleasedArm {
 public:
  controller::Controller controller;
  /// The modes that the controller finds at q0.
  controller::Vibration vibration;
  analysis::System<controller::kMaxJoints> closed_loop;
  controller::Status worst = controller::Status::kOk;  ///< of all ticks
  controller::JointVector torque;                      ///< of the last tick

  ReleasedArm(const TwinModels& twin, const controller::Settings& settings,
              const controller::JointVector& q0, const controller::JointVector& dq,
              sim::PlantOptions plant_options = {}, sim::ArmOptions arm_options = {},
              const controller::Attachment* told = nullptr)
      : controller(twin.model, settings), setpoint_(settings.initial) {
    const double T = settings.period;
    const controller::JointVector none = controller::JointVector::Zero(q0.size());
    const auto robot = evaluate(told ? twin.model.with(*told) : twin.model, q0, none);
    if (told != nullptr) controller.attach(*told);
    setpoint_.joint_position = q0;
    setpoint_.tip_pose = {robot.p_BT_B, robot.R_BT};
    controller.reset(robot.gravity);
    tick(q0, none);
    vibration = controller.vibration();
    controller.closed_loop(closed_loop);
    const int ticks = std::max(50, static_cast<int>(std::ceil(dq.norm() / (0.3 * T))));
    for (int k = 1; k <= ticks && !dq.isZero(0); ++k) {
      const double s = static_cast<double>(k) / ticks;
      tick(q0 + s * s * (3 - 2 * s) * dq, 6 * s * (1 - s) / (ticks * T) * dq);
    }
    plant_options.period = T;
    plant_options.initial_torque = torque;  // all the while
    arm_options.coulomb_friction = false;
    arm_.emplace(twin.robot, arm_options);
    plant_.emplace(*arm_, plant_options, q0 + dq);
  }
  ReleasedArm(const ReleasedArm&) = delete;
  ReleasedArm& operator=(const ReleasedArm&) = delete;

  sim::Arm& arm() { return *arm_; }
  const sim::Plant& plant() const { return *plant_; }

  sim::Status step() {
    tick(plant_->measured().position, plant_->measured().velocity);
    return plant_->step(torque);
  }

  /// Every so many ticks of `ticks`, after `skipped` ticks; deviations from q0.
  testing::Recording record(const controller::JointVector& q0, int ticks, int every = 1,
                            int skipped = 0) {
    for (int k = 0; k < skipped; ++k) EXPECT_EQ(step(), sim::Status::kOk);
    testing::Recording recording{Eigen::MatrixXd(q0.size(), ticks / every),
                                 Eigen::MatrixXd(q0.size(), ticks / every)};
    for (int k = 0; k < ticks; ++k) {
      if (k % every == 0) {
        recording.position.col(k / every) = plant_->position() - q0;
        recording.velocity.col(k / every) = plant_->velocity();
      }
      EXPECT_EQ(step(), sim::Status::kOk);
    }
    return recording;
  }

 private:
  void tick(const controller::JointVector& q, const controller::JointVector& qd) {
    state_.time += std::llround(1e9 * controller.settings().period);
    state_.position = q;
    state_.velocity = qd;
    setpoint_.time = state_.time;
    worst = controller::worse(worst, controller.update(state_, setpoint_, torque));
  }

  controller::RobotState state_;
  controller::Setpoint setpoint_;
  std::optional<sim::Arm> arm_;
  std::optional<sim::Plant> plant_;
};

/// Largest differences between modes that were seen and modes that were predicted.
struct Worst {
  double frequency = 0;  ///< relative
  double ratio = 0;
  int modes = 0;

  /// Compares the fitted mode next to `eigenvalue` with this frequency and ratio; both have to be
  /// within these differences.
  void add(const testing::StateFit& fit, analysis::Complex eigenvalue, double omega, double zeta,
           double most_frequency, double most_ratio) {
    const auto& seen =
        *std::min_element(fit.modes.begin(), fit.modes.end(), [&](const auto& a, const auto& b) {
          return std::abs(a.eigenvalues[0] - eigenvalue) < std::abs(b.eigenvalues[0] - eigenvalue);
        });
    const double off = std::abs(seen.natural_frequency / omega - 1);
    const double ratio_off = std::abs(seen.damping_ratio - zeta);
    EXPECT_LT(off, most_frequency) << seen.natural_frequency;
    EXPECT_LT(ratio_off, most_ratio) << seen.damping_ratio;
    frequency = std::max(frequency, off);
    ratio = std::max(ratio, ratio_off);
    ++modes;
  }
  /// Compares with a mode of a sampled loop.
  void add(const testing::StateFit& fit, const analysis::SampledMode& mode, double most_frequency,
           double most_ratio) {
    add(fit, mode.eigenvalues[0], mode.natural_frequency, mode.damping_ratio, most_frequency,
        most_ratio);
  }
};

inline analysis::Spectrum<controller::kMaxJoints> spectrum_of(
    const analysis::System<controller::kMaxJoints>& system) {
  analysis::Spectrum<controller::kMaxJoints> spectrum;
  analysis::SpectrumSolver<controller::kMaxJoints>().solve(system, spectrum);
  return spectrum;
}

}  // namespace dashpot::testing
