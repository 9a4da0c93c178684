// The stiffness of an arm that holds a load: against differences of the law's torque and the
// load's. python/tests/test_mujoco.py has the modes of the motion under a load.
#include <dashpot/controller/law/impedance_law.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/vibration/closed_loop.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cmath>
#include <limits>
#include <string>

namespace dashpot::controller {
namespace {

using Eigen::MatrixXd;
using Eigen::Quaterniond;
using testing::near;
using testing::Random;

constexpr ErrorClamp kUnclamped{std::numeric_limits<double>::infinity(),
                                std::numeric_limits<double>::infinity()};

/// An arm of seven joints whose springs hold a wrench of the world at q.
struct HeldLoad {
  RobotModel model;
  DynamicsKernel kernel{model};
  JointVector q, rest = JointVector::Zero(7);
  DynamicsResult robot;
  Impedance impedance{7};
  TipWrenches wrenches;
  JointVector weights = JointVector::LinSpaced(7, 0.3, 3);
  SpringReferences references{{JointVector::Ones(7), JointVector::Ones(7), 1, 1, 1, 1, 0.01, 0},
                              1e-3};

  explicit HeldLoad(Random& random, const testing::Arm& arm = testing::arms()[0])
      : model(testing::arm_model(arm)), q(random.vector(7)), robot(at(q)) {
    wrenches.world << 20 * random.vector(3), 2 * random.vector(3);
    wrenches.commanded << 10 * random.vector(3), random.vector(3);
  }
  /// Moves to a posture that is nearly singular in the directions of the springs.
  void approach_singularity(Random& random) {
    NullSpace null_space;
    double w = 1;
    for (int tries = 0; tries < 5000 && !(w < 0.8 * TaskInertia::kNearlySingular && w > 1e-6);
         ++tries) {
      q = random.vector(7);
      for (const int i : {1, 3, 5}) q[i] *= random.uniform(0, 0.2);
      robot = at(q);
      null_space.compute(robot, impedance);
      w = null_space.inertia().regularity();
    }
  }
  DynamicsResult at(const JointVector& there) const {
    DynamicsResult result;
    kernel.evaluate(there, rest, result);
    return result;
  }
  /// Moves the springs' rest so that they hold the load, with the posture's springs deflected by p.
  /// Returns the error e there.
  Vector6 hold(const JointVector& p = JointVector::Zero(7)) {
    const Matrix6 K_C = impedance.base.stiffness + turned(impedance.tool.stiffness, robot.R_BT);
    Vector6 e = Vector6::Zero();
    if (impedance.task_weight > 0 && !K_C.isZero(0)) {
      // Where a direction has no spring, the deflection is the least one, with springs scaled to 1.
      Vector6 unit = Vector6::Zero();
      for (int i = 0; i < 6; ++i) unit[i] = K_C(i, i) > 0 ? 1 / std::sqrt(K_C(i, i)) : 0;
      Eigen::CompleteOrthogonalDecomposition<Matrix6> solved;
      solved.setThreshold(1e-10);
      solved.compute(unit.asDiagonal() * K_C * unit.asDiagonal());
      const Vector6 load =
          impedance.task_weight * (wrenches.world + wrenches.commanded) + wrenches.posture;
      e = -unit.cwiseProduct(Vector6(solved.solve(unit.cwiseProduct(load))));
    }
    references.joint.start(q);
    references.posture.start(q + p);
    references.tip.start(robot.p_BT_B + e.head<3>(),
                         quaternion(Eigen::Vector3d(e.tail<3>())) * Quaterniond(robot.R_BT));
    return e;
  }
  /// Returns the torque of springs, feed-forward and world.
  JointVector torque(ImpedanceLaw& law, Load load, const JointVector& there,
                     const JointVector& qd) const {
    const DynamicsResult now = at(there);
    NullSpace null_space(weights);
    null_space.compute(now, impedance);
    LawTorque result;
    law.torque({now, there, qd, impedance, null_space, references, kUnclamped, wrenches.commanded},
               result);
    JointVector tau = result.torque;
    Vector6 f = wrenches.world;
    if (load == Load::kToolWrench) {
      const Eigen::Matrix3d turn = now.R_BT * robot.R_BT.transpose();
      f << turn * wrenches.world.head<3>(), turn * wrenches.world.tail<3>();
    }
    const Jacobian& J = load == Load::kJointTorques ? robot.J : now.J;
    return tau + JointVector(J.transpose() * f);
  }
};

/// The impedance with the projector of a number, or on its way to the next one.
Impedance projected(Setpoint setpoint, int number, double s) {
  const auto with = [&](int i) {
    setpoint.gains.null_projector =
        kNullProjectors[static_cast<std::size_t>(i) % kNullProjectors.size()].second;
    return Impedance(setpoint, 7);
  };
  return s == 0 ? with(number) : blend(with(number), with(number + 1), s);
}

Gains springs(Random& random) {
  Gains gains;
  gains.joint_stiffness = 100 * random.spd(7);
  gains.joint_damping = MatrixXd::Zero(7, 7);
  gains.task_stiffness = 300 * random.spd(6);
  gains.task_damping = Matrix6::Zero();
  gains.null_stiffness = gains.null_damping = JointVector::Zero(7);
  return gains;
}

/// -df/dx_i of a torque.
template <class Torque>
MatrixXd falling(const Torque& torque) {
  constexpr double kStep = 1e-5;
  MatrixXd result(7, 7);
  for (int i = 0; i < 7; ++i) {
    const JointVector d = kStep * JointVector::Unit(7, i);
    result.col(i) = (torque(JointVector(-d)) - torque(d)) / (2 * kStep);
  }
  return result;
}

TEST(LoadStiffness, IsTheDerivativeOfAllTorques) {
  Random random(411);
  for (int k = 0; k < 60; ++k) {
    HeldLoad held(random);
    const bool loaded = k % 5 > 0;
    Setpoint setpoint;
    setpoint.gains = springs(random);
    if (!loaded) {  // the loop as it is analysed: null space and dampers, too
      held.wrenches = {};
      setpoint.gains.joint_damping = 10 * random.spd(7);
      setpoint.gains.task_damping = 20 * random.spd(6);
      setpoint.gains.null_stiffness = 20 * random.vector(7).cwiseAbs();
      setpoint.gains.null_damping = 2 * random.vector(7).cwiseAbs();
    }
    const Impedance joint(setpoint, 7);
    setpoint.mode = Mode::kCartesian;
    setpoint.gains.frame = k % 2 == 0 ? Frame::kBase : Frame::kTool;
    const Impedance tip = projected(setpoint, k, k % 3 == 0 ? 0.3 : 0);
    held.impedance = k % 4 < 2 ? tip : k % 8 < 4 ? joint : blend(joint, tip, 0.4);
    held.hold();
    ImpedanceLaw law(held.model, {false, false, false, false, true});
    for (const Load load : {Load::kBaseWrench, Load::kToolWrench, Load::kJointTorques}) {
      SCOPED_TRACE(std::to_string(k) + ", load " + std::to_string(static_cast<int>(load)));
      const MatrixXd K = falling(
          [&](const JointVector& d) { return held.torque(law, load, held.q + d, held.rest); });
      const MatrixXd C =
          falling([&](const JointVector& d) { return held.torque(law, load, held.q, d); });
      const JointMatrix added =
          stiffness_under_load(held.robot, held.impedance, load, held.wrenches);
      analysis::System<kMaxJoints> system;
      NullSpace null_space(held.weights);
      null_space.compute(held.robot, held.impedance);
      Settings settings;
      settings.task_terms.load = load;
      closed_loop(held.robot, held.rest, {held.impedance, null_space, held.rest, held.wrenches},
                  settings, system);
      EXPECT_TRUE(near(system.mass, held.robot.M, 0));
      EXPECT_TRUE(near(system.damping, C, 1e-6 * C.norm()));
      EXPECT_TRUE(near(system.stiffness, K, (loaded ? 1e-7 : 1e-6) * K.norm()));
      if (loaded) {
        EXPECT_GT(added.norm(), 1e-3 * K.norm()) << "else it shows nothing";
        continue;
      }
      EXPECT_TRUE(system.symmetric());
      const MatrixXd W = system.stiffness_factor;
      EXPECT_TRUE(near(W.transpose() * W, system.stiffness, 1e-12 * K.norm()));
      break;
    }
  }
}

/// It also holds with deflected posture springs: N' and J# change with q, and next to a singularity
/// the inertia's regularisation as well.
TEST(LoadStiffness, IsTheDerivativeOfPostureSpringsToo) {
  Random random(415);
  double most = 0;
  int singular = 0, regular = 0;
  for (const testing::Arm& arm : testing::all_arms()) {
    if (testing::arm_model(arm).dof() != 7) continue;
    for (int k = 0; k < 24; ++k) {
      SCOPED_TRACE(std::string(arm.file) + ", " + std::to_string(k));
      HeldLoad held(random, arm);
      Setpoint setpoint;
      setpoint.mode = Mode::kCartesian;
      setpoint.gains = springs(random);
      setpoint.gains.null_stiffness = 20 * random.vector(7).cwiseAbs();
      setpoint.gains.frame = k % 2 == 0 ? Frame::kBase : Frame::kTool;
      if (k % 4 > 1) setpoint.gains.directions[static_cast<std::size_t>(k / 4)] = false;
      held.impedance = projected(setpoint, k / 4, k % 3 == 1 ? 0.4 : 0);
      if (k % 3 == 0) held.approach_singularity(random);
      NullSpace null_space(held.weights);
      null_space.compute(held.robot, held.impedance);
      const JointVector p = 0.2 * random.vector(7);
      ImpedanceLaw law(held.model, {false, false, false, false, true});
      LawTorque asked;
      JointVector error = p;
      Vector6 e;
      // In part without a projector, the tip's error depends on the posture's and reversely.
      for (int i = 0; i < (null_space.unprojected_share() > 0 ? 50 : 1); ++i) {
        held.wrenches.posture =
            null_space.unprojected_share() *
            null_space.wrench_of(held.impedance.null_stiffness.cwiseProduct(error));
        e = held.hold(p);
        law.torque({held.robot, held.q, held.rest, held.impedance, null_space, held.references,
                    kUnclamped, held.wrenches.commanded},
                   asked);
        error = asked.posture_error;
      }
      // Beyond 2 rad a deflection counts as one of 2 rad.
      if (e.tail<3>().norm() > 2) continue;
      const bool near_it =
          null_space.of_projector().nearly_singular() || null_space.inertia().nearly_singular();
      ++(near_it ? singular : regular);
      const NullSpaceChange change(held.kernel, held.q, held.robot, null_space, k % 2 == 1);
      const LoadedPosture posture{change, error};
      for (const Load load : {Load::kBaseWrench, Load::kToolWrench, Load::kJointTorques}) {
        const MatrixXd K = falling(
            [&](const JointVector& d) { return held.torque(law, load, held.q + d, held.rest); });
        const JointMatrix added =
            stiffness_under_load(held.robot, held.impedance, load, held.wrenches, &posture);
        const JointMatrix before =
            stiffness_under_load(held.robot, held.impedance, load, held.wrenches);
        analysis::System<kMaxJoints> system;
        Settings settings;
        settings.task_terms.load = load;
        closed_loop(held.robot, held.rest,
                    {held.impedance, null_space, held.rest, held.wrenches,
                     Posture{&held.kernel, &held.q, error, held.rest}},
                    settings, system);
        EXPECT_TRUE(near(system.stiffness, K, (near_it ? 1e-4 : 1e-6) * K.norm()))
            << (system.stiffness - K).norm() / K.norm() << ", "
            << null_space.inertia().regularity();
        most = std::max(most, (added - before).norm() / K.norm());
      }
    }
  }
  EXPECT_GT(most, 0.1) << "else it shows nothing";
  EXPECT_GT(singular, 30);
  EXPECT_GT(regular, 60);
}

/// In motion N turns, so that its dampers brake motions that moved only the tip a moment ago.
TEST(LoadStiffness, OfDampersUnderWayIsTheirDerivative) {
  Random random(416);
  double most = 0;
  for (const testing::Arm& arm : testing::all_arms()) {
    if (testing::arm_model(arm).dof() != 7) continue;
    for (int k = 0; k < 8; ++k) {
      SCOPED_TRACE(std::string(arm.file) + ", " + std::to_string(k));
      HeldLoad held(random, arm);
      held.wrenches = {};
      Setpoint setpoint;
      setpoint.mode = Mode::kCartesian;
      setpoint.gains = springs(random);
      setpoint.gains.task_stiffness.setZero();
      setpoint.gains.null_damping = 2 * random.vector(7).cwiseAbs();
      setpoint.gains.frame = k % 2 == 0 ? Frame::kBase : Frame::kTool;
      held.impedance = projected(setpoint, k / 2 % 3, k % 4 == 3 ? 0.4 : 0);  // not without one
      held.hold();
      ImpedanceLaw law(held.model, {false, false, false, false, false});
      NullSpace null_space(held.weights);
      null_space.compute(held.robot, held.impedance);
      if (null_space.of_projector().regularity() < 3e-3) continue;
      const JointVector qd = null_space.explained(random.vector(6));
      const MatrixXd K = falling([&](const JointVector& d) {
        return held.torque(law, Load::kBaseWrench, held.q + d, qd);
      });
      Settings settings;
      settings.task_terms.jacobian_rate = true;
      analysis::System<kMaxJoints> system;
      closed_loop(held.robot, qd,
                  {held.impedance, null_space, held.rest, held.wrenches,
                   Posture{&held.kernel, &held.q, held.rest, held.rest}},
                  settings, system);
      EXPECT_TRUE(near(system.stiffness, K, 1e-7 * K.norm()));
      most = std::max(most, K.norm());
    }
  }
  EXPECT_GT(most, 1) << "else it shows nothing";
}

/// A dead weight at the tip and translational springs that hold it are as without the weight.
TEST(LoadStiffness, IsNoneOfAWeightOnSpringsOfTranslation) {
  Random random(412);
  HeldLoad held(random);
  held.wrenches.world << 0, 0, -70, 0, 0, 0;
  held.wrenches.commanded.setZero();
  held.impedance.task_weight = 1;
  held.impedance.base.stiffness.diagonal() << 2000, 1500, 1000, 50, 60, 70;
  EXPECT_LT(
      stiffness_under_load(held.robot, held.impedance, Load::kBaseWrench, held.wrenches).norm(),
      1e-10);
  const JointMatrix paper =
      stiffness_under_load(held.robot, held.impedance, Load::kJointTorques, held.wrenches);
  EXPECT_TRUE(near(paper, geometric_stiffness(held.robot.J, held.wrenches.world), 1e-10));
  EXPECT_GT(paper.norm(), 10);
}

/// Directions without springs carry nothing, and a deflection without bound counts as a bounded
/// one.
TEST(LoadStiffness, IsFiniteWhereSpringsCannotHoldTheLoad) {
  Random random(413);
  HeldLoad held(random);
  held.wrenches.world << 0, 0, 0, 1e6, -1e6, 1e6;
  held.impedance.task_weight = 1;
  held.impedance.base.stiffness.diagonal() << 2000, 0, 1000, 50, 1e-9, 0;
  for (const Load load : {Load::kBaseWrench, Load::kToolWrench, Load::kJointTorques}) {
    const JointMatrix K = stiffness_under_load(held.robot, held.impedance, load, held.wrenches);
    EXPECT_TRUE(K.allFinite());
    EXPECT_LT(K.norm(), 1e9);
  }
}

TEST(LoadStiffness, AnEnvironmentAddsItsSpringsAndDampers) {
  Random random(414);
  HeldLoad held(random);
  Environment environment;
  environment.tip_stiffness << 100, 200, 300, 4, 5, 6;
  environment.tip_damping << 1, 2, 3, 0.4, 0.5, 0.6;
  environment.joint_stiffness = JointVector::LinSpaced(7, 1, 7);
  environment.joint_damping = JointVector::LinSpaced(7, 0.1, 0.7);
  Setpoint setpoint;
  setpoint.gains = springs(random);
  NullSpace null_space;
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    setpoint.mode = mode;
    Impedance impedance(setpoint, 7);
    analysis::System<kMaxJoints> before, after;
    const Acting acting{impedance, null_space, held.rest, {}};
    Settings settings;
    closed_loop(held.robot, held.rest, acting, settings, before);
    settings.environment = environment;
    closed_loop(held.robot, held.rest, acting, settings, after);
    const MatrixXd J = held.robot.J;
    MatrixXd K = J.transpose() * environment.tip_stiffness.asDiagonal() * J;
    MatrixXd C = J.transpose() * environment.tip_damping.asDiagonal() * J;
    K.diagonal() += environment.joint_stiffness;
    C.diagonal() += environment.joint_damping;
    EXPECT_TRUE(near(after.stiffness - before.stiffness, K, 1e-9));
    EXPECT_TRUE(near(after.damping - before.damping, C, 1e-9));
    EXPECT_TRUE(
        near(after.stiffness_factor.transpose() * after.stiffness_factor, after.stiffness, 1e-9));
    const PassivePart part = passive_part(held.robot.J, environment, JointMatrix::Zero(7, 7));
    EXPECT_TRUE(near(part.stiffness, K, 1e-10));
    EXPECT_TRUE(near(part.damping, C, 1e-10));
  }
}

}  // namespace
}  // namespace dashpot::controller
