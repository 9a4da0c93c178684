// Arms that hold a load, or touch something elastic: the modes that the controller predicts there
// against modes that a fit finds in the simulated motion after small releases.
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/base/orientation.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/vibration/closed_loop.hpp>
#include <dashpot/tests/support/released_arm.hpp>

#include <gtest/gtest.h>

#include <cstdio>
#include <optional>
#include <string>
#include <vector>

namespace dashpot {
namespace {

using controller::Environment;
using controller::JointMatrix;
using controller::JointVector;
using controller::Load;
using controller::Mode;
using controller::Vector6;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Random;
using testing::TwinModels;

/// The load of the world: a wrench that is `wrench` at rest, and an environment.
struct World {
  Load load = Load::kBaseWrench;
  Vector6 wrench = Vector6::Zero();
  Environment environment;
  std::optional<sim::Wall> wall;  ///< all of both comes from it
};

/// An arm at rest at q0, where its springs hold the load.
class LoadedArm {
 public:
  LoadedArm(const TwinModels& twin, const controller::Settings& settings, const JointVector& q0,
            const World& world)
      : twin_(twin),
        q0_(q0),
        world_(world),
        rest_(evaluate(twin.model, q0, JointVector::Zero(q0.size()))),
        controller_(twin.model, settings),
        setpoint_(settings.initial) {
    hold_load(settings.initial.gains);
    const JointVector none = JointVector::Zero(q0.size());
    controller_.reset(rest_.gravity);
    const int ticks = static_cast<int>(2 / settings.period);  // until the references are there
    for (int k = 0; k < ticks; ++k) tick(q0, none);
    controller_.closed_loop(system);
    sim::PlantOptions options;
    options.period = settings.period;
    options.initial_torque = torque_ + outside(q0, none);
    options_ = options;
  }

  analysis::System<controller::kMaxJoints> system;  ///< that the controller predicts
  controller::Status worst = controller::Status::kOk;

  /// Lets go at q0 + dq. Deviations from q0.
  testing::Recording record(const JointVector& dq, int ticks) {
    sim::ArmOptions arm_options;
    arm_options.coulomb_friction = false;
    arm_options.wall = world_.wall;
    if (dead_wrench()) arm_options.wrenches = {{0, 1e9, world_.wrench}};
    sim::Arm arm(twin_.robot, arm_options);
    sim::Plant plant(arm, options_, q0_ + dq);
    testing::Recording recording{MatrixXd(q0_.size(), ticks), MatrixXd(q0_.size(), ticks)};
    for (int k = -40; k < ticks; ++k) {
      if (k >= 0) {
        recording.position.col(k) = plant.position() - q0_;
        recording.velocity.col(k) = plant.velocity();
      }
      const JointVector q = plant.measured().position, v = plant.measured().velocity;
      tick(q, v);
      EXPECT_EQ(plant.step(torque_ + outside(q, v)), sim::Status::kOk);
    }
    return recording;
  }

 private:
  bool dead_wrench() const { return world_.load == Load::kBaseWrench && !world_.wall; }
  /// The goal at which the springs hold the load at q0.
  void hold_load(const controller::Gains& gains) {
    setpoint_.joint_position = q0_;
    setpoint_.tip_pose = {rest_.p_BT_B, rest_.R_BT};
    if (setpoint_.mode == Mode::kJoint) {
      const MatrixXd K = gains.joint_stiffness;
      setpoint_.joint_position -= JointVector(K.llt().solve(rest_.J.transpose() * world_.wrench));
      return;
    }
    MatrixXd K = gains.task_stiffness;
    if (gains.frame == controller::Frame::kTool) {
      K = controller::turned(gains.task_stiffness, rest_.R_BT);
    }
    const Vector6 e = -K.llt().solve(world_.wrench);
    setpoint_.tip_pose.position += e.head<3>();
    setpoint_.tip_pose.rotation =
        controller::quaternion(Eigen::Vector3d(e.tail<3>())).toRotationMatrix() * rest_.R_BT;
  }
  /// Torques at the joints that the simulator's arm does not have by itself.
  JointVector outside(const JointVector& q, const JointVector& qd) const {
    const auto robot = evaluate(twin_.model, q, qd);
    JointVector tau = JointVector::Zero(q.size());
    if (world_.load == Load::kJointTorques) tau += rest_.J.transpose() * world_.wrench;
    if (world_.load == Load::kToolWrench) {
      const Matrix3d turn = robot.R_BT * rest_.R_BT.transpose();
      Vector6 f;
      f << turn * world_.wrench.head<3>(), turn * world_.wrench.tail<3>();
      tau += robot.J.transpose() * f;
    }
    const Environment& environment = world_.environment;
    if (environment.none() || world_.wall) return tau;
    const Eigen::AngleAxisd turned(robot.R_BT * rest_.R_BT.transpose());
    Vector6 away;
    away << robot.p_BT_B - rest_.p_BT_B, turned.angle() * turned.axis();
    const Vector6 twist = robot.J * qd;
    tau -= robot.J.transpose() * (environment.tip_stiffness.cwiseProduct(away) +
                                  environment.tip_damping.cwiseProduct(twist));
    tau -= environment.joint_stiffness.cwiseProduct(q - q0_);
    tau -= environment.joint_damping.cwiseProduct(qd);
    return tau;
  }
  void tick(const JointVector& q, const JointVector& qd) {
    state_.time += std::llround(1e9 * controller_.settings().period);
    state_.position = q;
    state_.velocity = qd;
    state_.external_wrench = world_.wrench;
    setpoint_.time = state_.time;
    worst = controller::worse(worst, controller_.update(state_, setpoint_, torque_));
  }

  const TwinModels& twin_;
  JointVector q0_;
  World world_;
  controller::DynamicsResult rest_;
  controller::Controller controller_;
  controller::Setpoint setpoint_;
  controller::RobotState state_;
  JointVector torque_;
  sim::PlantOptions options_;
};

struct Case {
  const char* name;
  Load load;
  Mode mode;
  controller::Frame frame;
  bool environment;
  friend void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }
};

/// Frequencies, rad/s, and ratios of the modes that springs and dampers of the tip make, unloaded.
const VectorXd kOmega{{12, 15, 19, 24, 30, 40}}, kZeta{{0.2, 0.5, 0.3, 0.6, 0.4, 0.25}};

controller::Settings loaded_settings(const TwinModels& twin, const controller::Gains& gains,
                                     Load load) {
  controller::Settings settings = release_settings(twin, gains, 2.5e-4);
  settings.task_terms.load = load;
  testing::allow_any_torque(settings);
  settings.motion.linear_velocity = settings.motion.angular_velocity = 1;
  return settings;
}

World empty_world(Load load, Eigen::Index n) {
  World world{load, Vector6::Zero(), {}, {}};
  world.environment.joint_stiffness = world.environment.joint_damping = JointVector::Zero(n);
  return world;
}

/// Scaled so that the tip gives way by a tenth of a metre, or of a radian, at most.
Vector6 random_wrench(const controller::Matrix6& K_C, Random& random) {
  Vector6 wrench;
  wrench << random.vector(3), 0.1 * random.vector(3);
  const Vector6 e = K_C.llt().solve(wrench);
  return 0.1 / std::max(e.head<3>().norm(), e.tail<3>().norm()) * wrench;
}

/// The modes of three releases.
testing::StateFit fit_of(LoadedArm& arm, double period, Eigen::Index n, int ticks, Random& random) {
  std::vector<testing::Recording> recordings;
  for (int k = 0; k < 3; ++k) recordings.push_back(arm.record(1e-7 * random.vector(n), ticks));
  EXPECT_EQ(arm.worst, controller::Status::kOk) << to_text(arm.worst);
  return testing::fit_states(recordings, period, arm.system.mass);
}

class LoadedModes : public ::testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(
    Loads, LoadedModes,
    ::testing::Values(
        Case{"base", Load::kBaseWrench, Mode::kCartesian, controller::Frame::kBase, false},
        Case{"base_on_tool_springs", Load::kBaseWrench, Mode::kCartesian, controller::Frame::kTool,
             false},
        Case{"base_on_joint_springs", Load::kBaseWrench, Mode::kJoint, controller::Frame::kBase,
             false},
        Case{"tool", Load::kToolWrench, Mode::kCartesian, controller::Frame::kBase, false},
        Case{"tool_on_joint_springs", Load::kToolWrench, Mode::kJoint, controller::Frame::kBase,
             false},
        Case{"torques", Load::kJointTorques, Mode::kCartesian, controller::Frame::kBase, false},
        Case{"environment", Load::kIgnored, Mode::kCartesian, controller::Frame::kBase, true},
        Case{"wall", Load::kBaseWrench, Mode::kCartesian, controller::Frame::kBase, true},
        Case{"environment_of_joint_springs", Load::kIgnored, Mode::kJoint, controller::Frame::kBase,
             true}),
    [](const auto& instance) { return std::string(instance.param.name); });

TEST_P(LoadedModes, AreThoseOfTheSimulatedMotion) {
  const Case& param = GetParam();
  const TwinModels twin(testing::arms()[2]);
  const int n = twin.dof();
  ASSERT_EQ(n, 6);
  testing::Worst worst;
  double moved = 0;
  for (int seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(static_cast<std::uint64_t>(seed));
    const JointVector q0 = random_posture(twin, random);
    const auto robot = evaluate(twin.model, q0, JointVector::Zero(n));
    controller::Gains gains = tip_gains(twin, q0, kOmega, kZeta, 0.3, random);
    const controller::Matrix6 K_C = gains.task_stiffness;
    if (param.frame == controller::Frame::kTool) {
      gains.frame = param.frame;
      gains.task_stiffness = controller::turned(gains.task_stiffness, robot.R_BT.transpose());
      gains.task_damping = controller::turned(gains.task_damping, robot.R_BT.transpose());
    }
    controller::Settings settings = loaded_settings(twin, gains, param.load);
    settings.initial.mode = param.mode;
    World world = empty_world(param.load, n);
    if (param.load == Load::kBaseWrench && param.environment) {
      const sim::Contact contact{gains.task_stiffness(2, 2), 0.1 * gains.task_damping(2, 2)};
      const Vector6 e = K_C.llt().solve(contact.stiffness * Vector6::Unit(2));
      const double depth = 0.05 / std::max(e.head<3>().norm(), e.tail<3>().norm());  // m
      world.wall = {robot.p_BT_B + depth * Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitZ(),
                    contact};
      world.wrench[2] = depth * contact.stiffness;
      world.environment.tip_stiffness[2] = contact.stiffness;
      world.environment.tip_damping[2] = contact.damping;
      settings.environment = world.environment;
    } else if (param.load != Load::kIgnored) {
      world.wrench = random_wrench(K_C, random);
      world.wrench *= std::min(1.0, 40 / world.wrench.head<3>().norm());
    }
    if (param.mode == Mode::kJoint) {
      const MatrixXd M = robot.M, L = M.llt().matrixL();
      const MatrixXd Q = Eigen::HouseholderQR<MatrixXd>(random.matrix(n, n)).householderQ();
      const MatrixXd F = L * Q;
      settings.initial.gains.joint_stiffness = F * kOmega.cwiseAbs2().asDiagonal() * F.transpose();
      settings.initial.gains.joint_damping =
          F * (2 * kZeta.cwiseProduct(kOmega)).asDiagonal() * F.transpose();
    }
    if (param.load == Load::kIgnored) {
      world.environment.tip_stiffness = gains.task_stiffness.diagonal();
      world.environment.tip_damping = 0.2 * gains.task_damping.diagonal();
      world.environment.joint_stiffness = 20 * robot.M.diagonal();
      world.environment.joint_damping = robot.M.diagonal();
      settings.environment = world.environment;
    }
    LoadedArm arm(twin, settings, q0, world);
    const testing::StateFit fit = fit_of(arm, settings.period, n, 1600, random);
    ASSERT_EQ(fit.modes.size(), 6u);

    analysis::SampledLoop loop;
    loop.period = settings.period;
    loop.friction = twin.friction();
    JointMatrix load = JointMatrix::Zero(n, n);
    if (param.load != Load::kIgnored) load = stiffness_of_load(robot.J, param.load, world.wrench);
    // Torques that are held from tick to tick act like the controller's.
    const bool held = param.load != Load::kBaseWrench;
    loop.gravity_gradient = twin.gravity_gradient(q0);
    if (!held) {
      const auto passive = passive_part(robot.J, world.environment, load);
      loop.passive_stiffness = passive.stiffness;
      loop.friction += passive.damping;
    }
    const analysis::SampledSpectrum sampled =
        sample_loop(arm.system, testing::spectrum_of(arm.system), loop);
    for (std::size_t k = 0; k < 6; ++k) worst.add(fit, sampled.modes[k], 1e-4, 1e-3);
    analysis::System<controller::kMaxJoints> unloaded = arm.system;  // as if nothing were there
    if (param.environment) {
      unloaded.stiffness -= passive_part(robot.J, world.environment, load).stiffness;
    } else {
      unloaded.stiffness -= stiffness_under_load(robot, controller::Impedance(settings.initial, n),
                                                 param.load, {world.wrench, Vector6::Zero()});
    }
    moved = std::max(
        moved, (unloaded.stiffness - arm.system.stiffness).norm() / arm.system.stiffness.norm());
  }
  std::printf(
      "%s, seeds 1 to 3: frequency within %.1e, ratio within %.1e; %.2g of K is the load's\n",
      param.name, worst.frequency, worst.ratio, moved);
  EXPECT_GT(moved, 1e-3);
}

}  // namespace
}  // namespace dashpot
