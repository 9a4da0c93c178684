// The robot and its modes at a posture, from the plugin, without a loop and beside one.
#include <dashpot/tests/plugin/panda_host.hpp>
#include <dashpot/tests/support/matrices.hpp>

#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <limits>
#include <string>
#include <thread>
#include <vector>

namespace dashpot::tests {
namespace {

using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::near;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

MatrixXd rows(const double* values, int m, int n) {
  return Map<const RowMajor>(values, m, n);
}

dashpot_dynamics dynamics(const Handle& arm, const std::vector<double>& q,
                          const double* velocity = nullptr) {
  auto result = sized<dashpot_dynamics>();
  EXPECT_EQ(plugin().evaluate(arm.get(), q.data(), velocity, &result), DASHPOT_OK);
  return result;
}

struct Found {
  dashpot_closed_loop loop{};
  dashpot_modes modes{};
};

Found analyze(const Handle& arm, std::int32_t mode, const dashpot_gains* gains = nullptr,
              const std::vector<double>& q = panda_posture()) {
  Found found;
  found.loop.struct_size = sizeof found.loop;
  found.modes.struct_size = sizeof found.modes;
  EXPECT_EQ(plugin().analyze(arm.get(), q.data(), mode, gains, &found.loop, &found.modes),
            DASHPOT_OK)
      << plugin().last_error();
  return found;
}

TEST(PluginPosture, HasTheDynamicsOfTheRobot) {
  const Handle arm = create(panda());
  const std::vector<double> q = panda_posture();
  const std::vector<double> qd = {0.1, -0.2, 0.3, 0.4, -0.5, 0.6, 0.7};
  const dashpot_dynamics at = dynamics(arm, q, qd.data());
  EXPECT_EQ(at.joints, 7u);
  const auto expected =
      controller::evaluate(load(panda()).model, joint_vector(q), joint_vector(qd));
  EXPECT_EQ(rows(at.mass, 7, 7), MatrixXd(expected.M));
  EXPECT_EQ(Map<const VectorXd>(at.coriolis, 7), VectorXd(expected.coriolis));
  EXPECT_EQ(Map<const VectorXd>(at.gravity, 7), VectorXd(expected.gravity));
  EXPECT_EQ(Map<const VectorXd>(at.jacobian_dot_qd, 6), VectorXd(expected.Jdot_qd));
  EXPECT_EQ(VectorXd::Zero(7), (Map<const VectorXd>(dynamics(arm, q).coriolis, 7)));
  EXPECT_EQ(rows(at.jacobian, 6, 7), MatrixXd(expected.J));
  EXPECT_EQ((Map<const Eigen::Vector3d>(at.tip_position)), expected.p_BT_B);
  const MatrixXd R = rows(at.tip_rotation, 3, 3);
  EXPECT_EQ(R, MatrixXd(expected.R_BT));
}

/// controller/loop_system_test.cpp compares them with the modes of a controller there.
TEST(PluginPosture, HasTheLoopOfEitherMode) {
  const Handle arm = create(panda());
  MatrixXd K = 100 * MatrixXd::Identity(7, 7), C = 3 * MatrixXd::Identity(7, 7);
  K(1, 2) = K(2, 1) = 20;
  const MatrixXd friction = 0.003 * MatrixXd::Identity(7, 7);  // as in the URDF
  dashpot_gains gains = panda_gains();
  gains.joint_stiffness = K.data();
  gains.joint_damping = C.data();
  const Found joint = analyze(arm, DASHPOT_MODE_JOINT, &gains);
  const Found tip = analyze(arm, DASHPOT_MODE_CARTESIAN, &gains);
  EXPECT_EQ(rows(joint.loop.stiffness, 7, 7), K);
  EXPECT_TRUE(near(rows(joint.loop.damping, 7, 7), C + friction, 1e-12));
  EXPECT_FALSE(near(rows(tip.loop.stiffness, 7, 7), K, 1));
  for (const Found& found : {joint, tip}) {
    EXPECT_EQ(found.modes.count, 7u);
    EXPECT_EQ(found.modes.origin, DASHPOT_DIRECT);
    EXPECT_EQ(Map<const VectorXd>(found.modes.position, 7), joint_vector(panda_posture()));
  }
}

TEST(PluginPosture, KnowsARobotWithoutSprings) {
  const Handle arm = create(panda());
  const MatrixXd none = MatrixXd::Zero(7, 7), C = 3 * MatrixXd::Identity(7, 7);
  dashpot_gains gains = panda_gains();
  gains.joint_stiffness = none.data();
  gains.joint_damping = C.data();
  const Found found = analyze(arm, DASHPOT_MODE_JOINT, &gains);
  EXPECT_EQ(found.modes.count, 0u);
  EXPECT_EQ(found.modes.zero_modes, 7u);
  EXPECT_EQ(rows(found.loop.damping, 7, 7)(0, 0), 3 + 0.003);
}

/// Beside a loop on another thread, which continues as if without the call.
TEST(PluginPosture, DisturbsNoLoop) {
  std::vector<double> torques[2];
  for (const bool asked : {false, true}) {
    Host host = panda_host();
    host.velocity[2] = 0.3;
    std::atomic<bool> done = false;
    std::thread other([&] {
      while (asked && !done) {
        analyze(host.controller, DASHPOT_MODE_CARTESIAN);
        dynamics(host.controller, panda_posture());
      }
    });
    for (int tick = 0; tick < 300; ++tick) {
      host.tick();
      host.position[2] += 3e-4;
      torques[asked].insert(torques[asked].end(), host.torque.begin(), host.torque.end());
    }
    done = true;
    other.join();
  }
  EXPECT_EQ(torques[0], torques[1]);
}

TEST(PluginPosture, RefusesWhatIsWrong) {
  const Handle arm = create(panda());
  const double* q = panda_posture().data();
  Found found;
  dashpot_dynamics at{};
  const auto analyzed = [&](const double* where, std::int32_t mode,
                            const dashpot_gains* gains = nullptr) {
    return plugin().analyze(arm.get(), where, mode, gains, &found.loop, &found.modes);
  };
  EXPECT_EQ(analyzed(q, DASHPOT_MODE_JOINT), DASHPOT_WRONG_STRUCT_SIZE);
  found.loop.struct_size = sizeof found.loop;
  EXPECT_EQ(analyzed(q, DASHPOT_MODE_JOINT), DASHPOT_WRONG_STRUCT_SIZE);
  found.modes.struct_size = sizeof found.modes;
  EXPECT_EQ(analyzed(q, DASHPOT_MODE_JOINT), DASHPOT_OK);
  EXPECT_EQ(plugin().evaluate(arm.get(), q, nullptr, &at), DASHPOT_WRONG_STRUCT_SIZE);
  at.struct_size = sizeof at;
  EXPECT_EQ(plugin().evaluate(arm.get(), q, nullptr, nullptr), DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(plugin().evaluate(arm.get(), nullptr, nullptr, &at), DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(plugin().evaluate(nullptr, q, nullptr, &at), DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(analyzed(nullptr, DASHPOT_MODE_JOINT), DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(plugin().analyze(nullptr, q, DASHPOT_MODE_JOINT, nullptr, nullptr, nullptr),
            DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(analyzed(q, 2), DASHPOT_WRONG_VALUE);
  std::vector<double> bad = panda_posture();
  bad[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(analyzed(bad.data(), DASHPOT_MODE_JOINT), DASHPOT_WRONG_VALUE);
  EXPECT_EQ(plugin().evaluate(arm.get(), bad.data(), nullptr, &at), DASHPOT_WRONG_VALUE);
  EXPECT_EQ(plugin().evaluate(arm.get(), q, bad.data(), &at), DASHPOT_WRONG_VALUE);
  dashpot_gains gains = panda_gains();
  const MatrixXd K = -MatrixXd::Identity(7, 7);
  gains.joint_stiffness = K.data();
  EXPECT_EQ(analyzed(q, DASHPOT_MODE_JOINT, &gains), DASHPOT_WRONG_VALUE);
  EXPECT_NE(std::string(plugin().last_error()).find("joint_stiffness"), std::string::npos);
  EXPECT_EQ(plugin().analyze(arm.get(), q, DASHPOT_MODE_JOINT, nullptr, nullptr, nullptr),
            DASHPOT_OK);
}

TEST(PluginPosture, IsCreatedFromText) {
  const auto create_from = [](const std::string& text, const char* directory) {
    return Handle(plugin().create_from_text(text.c_str(), directory));
  };
  const Handle arm = create_from(panda() + "control: {period: 2 ms}\n", nullptr);
  ASSERT_NE(arm, nullptr) << plugin().last_error();
  EXPECT_EQ(plugin().period(arm.get()), 0.002);
  const std::string models = std::filesystem::path(urdf_path("panda.urdf")).parent_path();
  const std::string near = "{robot: {urdf: panda.urdf, base: panda_link0, tip: panda_hand_tcp}}";
  EXPECT_NE(create_from(near, models.c_str()), nullptr) << plugin().last_error();
  EXPECT_EQ(create_from(near, "/nowhere"), nullptr);
  EXPECT_NE(std::string(plugin().last_error()).find("/nowhere/panda.urdf"), std::string::npos);
  EXPECT_EQ(create_from(panda() + "limit: 3\n", nullptr), nullptr);
  EXPECT_EQ(std::string(plugin().last_error()).find("limit: unknown key; "), 0u);
  EXPECT_EQ(plugin().create_from_text(nullptr, nullptr), nullptr);
}

}  // namespace
}  // namespace dashpot::tests
