// The C interface, driven as a host does that loads the library at run time.
#include <dashpot/controller/controller.hpp>
#include <dashpot/tests/plugin/panda_host.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gmock/gmock.h>

#include <array>
#include <limits>
#include <set>
#include <thread>

namespace dashpot::tests {
namespace {

using controller::Config;
using controller::Controller;
using controller::JointVector;
using Eigen::Map;
using Eigen::VectorXd;

TEST(Plugin, KnowsItsVersionOnly) {
  const PluginInterface interface = plugin_interface();
  EXPECT_EQ(interface(0), nullptr);
  EXPECT_EQ(interface(DASHPOT_PLUGIN_VERSION + 1), nullptr);
  const dashpot_plugin* plugin = interface(DASHPOT_PLUGIN_VERSION);
  ASSERT_NE(plugin, nullptr);
  EXPECT_EQ(plugin->version, DASHPOT_PLUGIN_VERSION);
  EXPECT_EQ(plugin->struct_size, sizeof(dashpot_plugin));
}

TEST(Plugin, SaysWhyItCannotBeCreated) {
  EXPECT_EQ(plugin().create(nullptr), nullptr);
  EXPECT_STREQ(plugin().last_error(), "a required pointer is NULL");
  EXPECT_EQ(plugin().create("no-such-file.yaml"), nullptr);
  EXPECT_STREQ(plugin().last_error(),
               "no-such-file.yaml: cannot be opened: No such file or directory");
  EXPECT_EQ(create(panda() + "limits:\n  torque: 80 lbf\n"), nullptr);
  EXPECT_THAT(plugin().last_error(),
              ::testing::EndsWith("arm.yaml: limits.torque: is not a number but '80 lbf': unknown "
                                  "unit 'lbf' (line 3)"));
  std::thread([] { EXPECT_STREQ(plugin().last_error(), ""); }).join();
  EXPECT_NE(create(panda()), nullptr);
  EXPECT_STREQ(plugin().last_error(), "");
}

TEST(Plugin, TellsWhatItControls) {
  const Handle arm = create(panda() + "control: {period: 2 ms}\n");
  EXPECT_EQ(plugin().joints(arm.get()), 7u);
  EXPECT_STREQ(plugin().joint_name(arm.get(), 0), "panda_joint1");
  EXPECT_STREQ(plugin().joint_name(arm.get(), 6), "panda_joint7");
  EXPECT_EQ(plugin().joint_name(arm.get(), 7), nullptr);
  EXPECT_EQ(plugin().period(arm.get()), 0.002);
}

TEST(Plugin, HasATextForEverythingItReturns) {
  std::set<std::string> texts;
  for (std::int32_t code = DASHPOT_UNSTABLE_GAINS; code <= DASHPOT_NOT_FINITE; ++code) {
    texts.insert(plugin().status_text(code));
  }
  EXPECT_EQ(texts.size(), 33u);
  EXPECT_FALSE(texts.count("unknown status"));
  for (const std::int32_t code :
       {DASHPOT_UNSTABLE_GAINS - 1, DASHPOT_NOT_FINITE + 1, 1000, -1000}) {
    EXPECT_STREQ(plugin().status_text(code), "unknown status");
  }
  EXPECT_STREQ(plugin().status_text(DASHPOT_OK), "ok");
  EXPECT_STREQ(plugin().kind_text(DASHPOT_UNDERDAMPED), "underdamped");
  EXPECT_STREQ(plugin().kind_text(DASHPOT_SOFT), "soft");
  EXPECT_STREQ(plugin().kind_text(DASHPOT_SOFT + 1), "unknown kind");
  EXPECT_STREQ(plugin().kind_text(-1), "unknown kind");
}

/// It gives the torque, status, snapshot and modes of the C++ class on the same random ticks.
TEST(Plugin, IsTheController) {
  testing::Random random(711);
  const std::string text = panda() + "analysis: {every: 3}\n";
  const Config config = load(text);
  Controller controller(config.model, config.settings);
  Host host(create(text), panda_posture());
  controller::Setpoint setpoint = config.settings.initial;
  std::vector<double> goal = panda_posture();
  for (int tick = 0; tick < 300; ++tick) {
    for (std::size_t i = 0; i < 7; ++i) {
      host.position[i] = panda_posture()[i] + 1e-3 * random.uniform(-1, 1);
      host.velocity[i] = 0.1 * random.uniform(-1, 1);
      goal[i] = panda_posture()[i] + 0.2 * random.uniform(-1, 1);
    }
    const dashpot_setpoint wanted = host.joint_setpoint(goal);
    const std::int32_t status = host.tick(&wanted);
    controller::RobotState state;
    state.time = host.time;
    state.position = joint_vector(host.position);
    state.velocity = joint_vector(host.velocity);
    setpoint.time = state.time;
    setpoint.joint_position = joint_vector(goal);
    JointVector torque;
    ASSERT_EQ(static_cast<int>(controller.update(state, setpoint, torque)), status);
    ASSERT_EQ(joint_vector(host.torque), torque) << "tick " << tick;
  }
  const dashpot_snapshot snapshot = host.snapshot();
  EXPECT_EQ(snapshot.tick, 300u);
  EXPECT_EQ(snapshot.time, host.time);
  EXPECT_EQ(snapshot.joints, 7u);
  EXPECT_EQ(snapshot.restarts, 1u);
  EXPECT_EQ(Map<const VectorXd>(snapshot.torque, 7), joint_vector(host.torque));
  EXPECT_EQ(Map<const VectorXd>(snapshot.position, 7), joint_vector(host.position));
  EXPECT_EQ(Map<const Eigen::Vector3d>(snapshot.tip_position), controller.snapshot().tip.position);
  EXPECT_EQ((Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(snapshot.tip_rotation)),
            controller.snapshot().tip.rotation);
  EXPECT_EQ(Map<const VectorXd>(snapshot.reference_joint_position, 7),
            controller.snapshot().reference_position);

  const dashpot_modes modes = host.modes();
  const controller::Vibration& vibration = controller.vibration();
  EXPECT_EQ(modes.tick, vibration.tick);
  EXPECT_EQ(modes.tick, 298u);
  ASSERT_EQ(modes.count, 7u);
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(modes.modes[i].natural_frequency, vibration.modes[i].natural_frequency);
    EXPECT_EQ(modes.modes[i].damping_ratio, vibration.modes[i].damping_ratio);
    EXPECT_EQ(modes.modes[i].eigenvalue_bound, vibration.modes[i].error_bound);
    EXPECT_EQ(modes.modes[i].kind, static_cast<int>(vibration.modes[i].kind));
    EXPECT_EQ(modes.modes[i].shape_imag[3], vibration.modes[i].shape[3].imag());
    EXPECT_LE(modes.modes[i].eigenvalue_bound, 1e-6);
  }
}

/// Without any set-point the arm stays where it was found, far beyond the watchdog's times.
TEST(Plugin, HoldsStillWithoutASetpoint) {
  for (const std::string mode : {"", kCartesian}) {
    const Config config = load(panda() + mode);
    Host host = panda_host(mode);
    ASSERT_NO_FATAL_FAILURE(run_simulated(config.model, host, 3000)) << mode;
    for (std::size_t i = 0; i < 7; ++i) EXPECT_NEAR(host.position[i], panda_posture()[i], 2e-2);
    EXPECT_LT(joint_vector(host.velocity).norm(), 1e-2);
  }
}

/// Not even at the first tick, before it is known where the springs are to stay.
TEST(Plugin, HidesNoStatusWithoutASetpoint) {
  for (const std::string mode : {"", "control: {mode: cartesian}\n"}) {
    std::vector<double> posture = panda_posture();
    posture[3] = -0.08;  // 0.01 rad from its limit
    Host host(create(panda() + mode), posture);
    for (int k = 0; k < 3; ++k) EXPECT_EQ(host.tick(), DASHPOT_NEAR_JOINT_LIMIT) << mode << k;
  }
}

TEST(Plugin, GoesToASetpointFromTheOtherThreadsSide) {
  const Config config = load(panda());
  Host host = panda_host();
  std::vector<double> goal = panda_posture();
  goal[0] += 0.3;
  goal[3] -= 0.2;
  const dashpot_setpoint setpoint = host.joint_setpoint(goal);
  for (int k = 0; k < 40; ++k) {
    ASSERT_EQ(plugin().set_setpoint(host.controller.get(), &setpoint), DASHPOT_OK);
    ASSERT_NO_FATAL_FAILURE(run_simulated(config.model, host, 100));
  }
  for (std::size_t i = 0; i < 7; ++i) EXPECT_NEAR(host.position[i], goal[i], 2e-2);
  EXPECT_EQ(host.snapshot().reference_joint_position[0], goal[0]);
}

TEST(Plugin, TakesASecondSetpointOfTheSameTime) {
  Host host = panda_host();
  std::vector<double> goal = panda_posture();
  goal[0] += 0.3;
  dashpot_setpoint setpoint = host.joint_setpoint(goal, host.time);
  ASSERT_EQ(plugin().set_setpoint(host.controller.get(), &setpoint), DASHPOT_OK);
  ASSERT_EQ(host.tick(), DASHPOT_OK);
  goal[0] -= 0.6;
  setpoint.joint_position = goal.data();
  ASSERT_EQ(plugin().set_setpoint(host.controller.get(), &setpoint), DASHPOT_OK);
  for (int k = 0; k < 100; ++k) ASSERT_EQ(host.tick(), DASHPOT_OK);
  EXPECT_LT(host.snapshot().reference_joint_position[0], panda_posture()[0]);
}

/// Whoever gave the set-point, and whether or not there is one; a repeated one is not a new one.
TEST(Plugin, StopsUntilThereIsANewSetpoint) {
  for (const char* watchdog : {"", "watchdog: {setpoint_hold: 0, setpoint_damp: 0}\n"}) {
    Host host = panda_host(watchdog);
    dashpot_controller* const arm = host.controller.get();
    dashpot_setpoint setpoint = host.joint_setpoint(panda_posture(), host.time + 1'000'000);
    for (const dashpot_setpoint* given : {static_cast<const dashpot_setpoint*>(nullptr),
                                          static_cast<const dashpot_setpoint*>(&setpoint)}) {
      ASSERT_LT(host.tick(given), DASHPOT_SETPOINT_STALE);
      ASSERT_EQ(plugin().stop(arm), DASHPOT_OK);
      for (int tick = 0; tick < 100; ++tick) ASSERT_EQ(host.tick(given), DASHPOT_SETPOINT_LOST);
      ASSERT_EQ(plugin().release(arm), DASHPOT_OK);  // there is no fault
      ASSERT_EQ(plugin().set_gains(arm, std::array{panda_gains()}.data()), DASHPOT_OK);
      ASSERT_EQ(host.tick(given), DASHPOT_SETPOINT_LOST);
      setpoint.time = host.time;
      ASSERT_LT(host.tick(&setpoint), DASHPOT_SETPOINT_STALE);
    }
    ASSERT_EQ(plugin().stop(arm), DASHPOT_OK);
    ASSERT_EQ(plugin().reset(arm, nullptr), DASHPOT_OK);
    ASSERT_LT(host.tick(), DASHPOT_SETPOINT_STALE);
  }
}

TEST(Plugin, NamesTheStatusesThatNeedTheRobotsBrakes) {
  using controller::Status;
  const std::set<Status> doubts{Status::kStateFrozen, Status::kStateContradictory,
                                Status::kBrakeDoubted};
  for (int code = DASHPOT_OK; code <= DASHPOT_NOT_FINITE; ++code) {
    const auto status = static_cast<Status>(code);
    const bool doubted = doubts.count(status) > 0;
    EXPECT_EQ(controller::needs_brakes(status, Status::kOk), doubted) << code;
    EXPECT_EQ(controller::needs_brakes(status, Status::kTimeGap),
              doubted || status >= Status::kStateNotFinite)
        << code;
  }
}

TEST(Plugin, NeedsTheRobotsBrakesWhenTheFaultOfALostStateLatches) {
  EXPECT_EQ(plugin().needs_brakes(nullptr), 0);
  Host host(create(panda()), panda_posture());
  dashpot_controller* const arm = host.controller.get();
  EXPECT_EQ(plugin().needs_brakes(arm), 0);
  host.tick();
  EXPECT_EQ(plugin().needs_brakes(arm), 0);
  host.velocity[2] = std::numeric_limits<double>::quiet_NaN();
  for (int tick = 1; tick <= 30; ++tick) {
    EXPECT_EQ(host.tick(), DASHPOT_STATE_NOT_FINITE);
    const bool latched = host.snapshot().fault != DASHPOT_OK;
    EXPECT_EQ(plugin().needs_brakes(arm), latched ? 1 : 0) << tick;
    EXPECT_EQ(latched, tick > 10) << tick;  // watchdog.longest_gap
  }
  host.velocity[2] = 0;
  for (int tick = 0; tick < 100; ++tick) host.tick();
  EXPECT_EQ(host.snapshot().fault, DASHPOT_STATE_NOT_FINITE);  // it holds the arm again
  EXPECT_EQ(plugin().needs_brakes(arm), 0);
}

TEST(Plugin, IsResetToHoldWhereTheRobotIs) {
  Host host(create(panda()), panda_posture());
  std::vector<double> goal = panda_posture();
  goal[1] += 0.5;
  const dashpot_setpoint setpoint = host.joint_setpoint(goal);
  for (int tick = 0; tick < 100; ++tick) host.tick(&setpoint);
  ASSERT_GT(std::abs(host.snapshot().reference_joint_position[1] - panda_posture()[1]), 1e-4);
  const std::vector<double> acting = host.torque;
  host.time -= 500'000'000;  // forgotten as well
  ASSERT_EQ(plugin().reset(host.controller.get(), acting.data()), DASHPOT_OK);
  ASSERT_LE(host.tick(), DASHPOT_TORQUE_LIMITED);
  EXPECT_EQ(Map<const VectorXd>(host.snapshot().reference_joint_position, 7),
            joint_vector(panda_posture()));
  const VectorXd limit = 0.001 * load(panda()).settings.limits.torque_rate;
  EXPECT_TRUE(((joint_vector(host.torque) - joint_vector(acting)).cwiseAbs().array() <=
               limit.array() * (1 + 1e-12))
                  .all());
  ASSERT_EQ(plugin().set_setpoint(host.controller.get(), &setpoint), DASHPOT_OK);  // too early
  const std::vector<double> before = host.torque;
  ASSERT_EQ(plugin().reset(host.controller.get(), nullptr), DASHPOT_OK);
  host.tick();
  EXPECT_EQ(Map<const VectorXd>(host.snapshot().reference_joint_position, 7),
            joint_vector(panda_posture()));
  // Without a torque that acts, from the last one.
  EXPECT_TRUE(((joint_vector(host.torque) - joint_vector(before)).cwiseAbs().array() <=
               limit.array() * (1 + 1e-12))
                  .all());
}

/// Starts from the weight, told or not, and judges the gains of the configuration where the robot
/// is.
TEST(Plugin, StartsFromTheWeight) {
  const VectorXd weight =
      controller::evaluate(load(panda()).model, joint_vector(panda_posture()), VectorXd::Zero(7))
          .gravity;
  for (const bool started : {true, false}) {
    Host host(create(panda()), panda_posture());
    if (started) {
      ASSERT_EQ(plugin().start(host.controller.get(), panda_posture().data(), nullptr), DASHPOT_OK);
    }
    EXPECT_EQ(host.tick(), DASHPOT_OK);
    EXPECT_TRUE(testing::near(joint_vector(host.torque), weight, 1e-9));
  }
  Host host(create(panda() + "watchdog: {start_torque: none}\n"), panda_posture());
  const std::vector<double> acting(7, 5.0);
  ASSERT_EQ(plugin().start(host.controller.get(), panda_posture().data(), acting.data()),
            DASHPOT_OK);
  host.tick();
  EXPECT_LE((joint_vector(host.torque) - VectorXd::Constant(7, 5)).cwiseAbs().maxCoeff(), 1 + 1e-9);
  EXPECT_EQ(host.tick(), DASHPOT_TORQUE_LIMITED);
  EXPECT_EQ(plugin().start(host.controller.get(), nullptr, nullptr), DASHPOT_NULL_ARGUMENT);
}

/// Degrees, and a torque that holds another arm: a base tilted by 30 degrees, or 3 kg at the tip.
TEST(Plugin, RefusesAStartThatCannotBe) {
  const controller::RobotModel model = load(panda()).model;
  const VectorXd q = joint_vector(panda_posture()), rest = VectorXd::Zero(7);
  const auto there = controller::evaluate(model, q, rest);
  controller::ModelOptions tilted;
  tilted.gravity = {0, 4.905, -8.496};
  const auto leaning = controller::RobotModel::from_urdf_file(urdf_path("panda.urdf"), model.base(),
                                                              model.tip(), tilted);
  const VectorXd loaded = there.gravity + 3 * 9.81 * there.J.row(2).transpose();
  const VectorXd degrees = q * 180 / 3.14159265, beyond = VectorXd::Unit(7, 0) * 3.05;
  const struct {
    VectorXd position, torque;
    const char* said;
  } starts[] = {{degrees, {}, "if these are degrees"},
                {beyond, {}, "joint 'panda_joint1' at 3.05 rad is outside its limits"},
                {VectorXd::Unit(7, 0) * 2.95 + q, {}, ""},
                {q, 1.1 * there.gravity, ""},
                {q, controller::evaluate(leaning, q, rest).gravity, "is the base tilted"},
                {q, loaded, "the payload another"}};
  for (const char* given : {"0.25", "none"}) {
    const Handle arm = create(panda() + "watchdog: {start_torque: " + given + "}\n");
    ASSERT_NE(arm, nullptr) << plugin().last_error();
    for (const auto& [position, torque, said] : starts) {
      const bool any = torque.size() > 0, taken = *said == 0 || (any && given[0] == 'n');
      EXPECT_EQ(plugin().start(arm.get(), position.data(), any ? torque.data() : nullptr),
                taken ? DASHPOT_OK : DASHPOT_WRONG_VALUE)
          << said;
      EXPECT_THAT(plugin().last_error(), ::testing::HasSubstr(taken ? "" : said));
    }
  }
}

/// A wrist that weighs next to nothing tolerates less damping than a shoulder.
TEST(Plugin, RefusesGainsThatTheSampledLoopDoesNotBear) {
  const std::string stiff = "gains: {joint: {stiffness: 100, damping: [20, 20, 20, 20, 20, ";
  // The last joint turns about its own axis: its inertia is the same everywhere.
  EXPECT_EQ(create(panda() + stiff + "20, 20]}}\n"), nullptr);
  EXPECT_THAT(plugin().last_error(),
              ::testing::HasSubstr(
                  ".yaml: gains: with the joint gains the sampled loop has a gain margin of"));
  EXPECT_THAT(plugin().last_error(), ::testing::HasSubstr("at best, wherever the robot is"));
  EXPECT_NE(create(panda() + stiff + "20, 20]}}\nlimits: {gain_margin: 1}\n"), nullptr);
  // Above its base a stretched arm has a tenth of the inertia that the first joint has elsewhere.
  const Handle arm = create(panda() + stiff + "2, 0.5]}}\n");
  ASSERT_NE(arm, nullptr) << plugin().last_error();
  EXPECT_EQ(plugin().start(arm.get(), panda_posture().data(), nullptr), DASHPOT_OK);
  const std::array<double, 7> upright{0, 0, 0, -0.1, 0, 0.1, 0};
  EXPECT_EQ(plugin().start(arm.get(), upright.data(), nullptr), DASHPOT_UNSTABLE_GAINS);
  EXPECT_THAT(plugin().last_error(),
              ::testing::StartsWith("with the joint gains the sampled loop has"));

  Host host(create(panda()), panda_posture());
  host.tick();
  std::array<double, 49> damping{};
  dashpot_gains gains = panda_gains();
  gains.joint_damping = damping.data();
  for (std::size_t i = 0; i < 7; ++i) damping[8 * i] = 20;
  double margin = 0;
  EXPECT_EQ(plugin().judge_gains(host.controller.get(), &gains, nullptr, &margin),
            DASHPOT_UNSTABLE_GAINS);
  EXPECT_GT(margin, 0.05);
  EXPECT_LT(margin, 1);
  EXPECT_EQ(plugin().set_gains(host.controller.get(), &gains), DASHPOT_UNSTABLE_GAINS);
  const Handle fresh = create(panda());  // the position of its robot is unknown
  EXPECT_EQ(plugin().set_gains(fresh.get(), &gains), DASHPOT_UNSTABLE_GAINS);
  for (std::size_t i = 0; i < 7; ++i) damping[8 * i] = 20 * 0.45 * margin;
  EXPECT_EQ(plugin().set_gains(fresh.get(), &gains), DASHPOT_OK);
  EXPECT_EQ(plugin().judge_gains(host.controller.get(), &gains, panda_posture().data(), &margin),
            DASHPOT_OK);
  EXPECT_EQ(margin, 2);
  EXPECT_EQ(plugin().set_gains(host.controller.get(), &gains), DASHPOT_OK);
}

/// Nothing of the ticks before a reset is left to read.
TEST(Plugin, HasNoModesAfterAReset) {
  for (const char* where : {"inline", "background"}) {
    Host host = panda_host("analysis: {where: " + std::string(where) + "}\n");
    dashpot_controller* const arm = host.controller.get();
    auto modes = sized<dashpot_modes>();
    while (plugin().read_modes(arm, &modes) != DASHPOT_OK) host.tick();
    ASSERT_EQ(plugin().reset(arm, host.torque.data()), DASHPOT_OK);
    EXPECT_EQ(plugin().read_modes(arm, &modes), DASHPOT_NOTHING_YET);
    host.position[1] += 0.1;
    while (plugin().read_modes(arm, &modes) != DASHPOT_OK) host.tick();
    EXPECT_EQ(modes.position[1], host.position[1]);
    EXPECT_EQ(modes.count, 7u);
  }
}

}  // namespace
}  // namespace dashpot::tests
