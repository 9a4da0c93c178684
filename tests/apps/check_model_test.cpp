// `dashpot check-model`: what a user sees, and what is refused.
#include <dashpot/lcmtypes/driver.hpp>
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/torque_record.hpp>

#include <array>
#include <cstdio>
#include <functional>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// A Panda whose configuration has comments and no payload.
std::string panda_config(const Scratch& scratch) {
  return scratch.write("arm.yaml",
                       "# my arm\nrobot:\n  urdf: " + testing::arm_path("panda") +
                           "  # as delivered\n  base: panda_link0\n  tip: panda_hand_tcp\n"
                           "  payload:  # nothing yet\n    mass: 0 kg  # to be weighed\n"
                           "control: {mode: joint}  # and so on\n");
}

const identification::TorqueRecord& panda_record() {
  static const identification::TorqueRecord record = [] {
    testing::RecordedArm arm({testing::arm_path("panda"), "panda_link0", "panda_hand_tcp", {}});
    arm.center.resize(7);
    arm.center << 0.2, -0.4, 0.3, -1.9, 0.1, 1.7, 0.6;
    arm.coulomb << 0.8, 1.0, 0.6, 0.9, 0.4, 0.3, 0.2;
    arm.viscous << 0.5, 0.8, 0.3, 0.6, 0.2, 0.1, 0.05;
    arm.description.options.payload = {
        1.3, {0.02, -0.03, 0.05}, Eigen::Matrix3d::Identity() * 0.003};
    arm.duration = 8;
    arm.rate = 100;
    return arm.record(21);
  }();
  return record;
}

/// A CSV file of seven columns of positions called by `position`, and seven of torques.
std::string csv(const std::function<std::string(int)>& position, double factor,
                const std::function<std::string(int)>& torque, const std::vector<int>& order) {
  const identification::TorqueRecord& record = panda_record();
  std::string text = "time [s]";
  for (const int j : order) text += "," + position(j);
  for (const int j : order) text += "," + torque(j);
  text += "\n";
  const auto add = [&](double value) { text += printed(",%.7f", value); };
  for (Eigen::Index i = 0; i < record.time.size(); ++i) {
    text += printed("%g", 0.5 + record.time[i]);  // whole: without a point
    for (const int j : order) add(factor * record.position(j, i));
    for (const int j : order) add(record.torque(j, i));
    text += "\n";
  }
  return text;
}

const std::vector<int> kInOrder = {0, 1, 2, 3, 4, 5, 6};

std::function<std::string(int)> numbered(const std::string& before, const std::string& after = "") {
  return [before, after](int j) { return before + std::to_string(j + 1) + after; };
}

Json check(const Words& arguments) {
  return parse(run_program(joined({"check-model", "--json"}, arguments)));
}

TEST(CheckModelProgram, TellsFrictionAndPayloadOfAFile) {
  const Scratch scratch;
  const std::string config = panda_config(scratch);
  const std::string text = csv(numbered("q"), 1, numbered("tau_J_"), kInOrder);
  const std::string file = scratch.write("a.csv", text);
  const Json found = check({file, "--config", config});
  EXPECT_EQ(found["torques"], "whole");
  ASSERT_EQ(found["joints"].size(), 7U);
  const std::array<double, 7> coulomb{0.8, 1.0, 0.6, 0.9, 0.4, 0.3, 0.2};
  for (std::size_t j = 0; j < 7; ++j) {
    const Json& joint = found["joints"][j];
    EXPECT_NEAR(joint["coulomb_friction"].get<double>(), coulomb[j], 0.05);
    EXPECT_GT(joint["coulomb_friction_std"].get<double>(), 0);
    EXPECT_LT(joint["residual_rms"]["after"].get<double>(), 0.04);
    EXPECT_GT(joint["residual_rms"]["before"].get<double>(), 0.15);
    EXPECT_TRUE(joint["suspicious"].is_null()) << joint.dump();
  }
  EXPECT_NEAR(found["payload"]["mass"].get<double>(), 1.3, 0.02);
  EXPECT_NEAR(found["payload"]["center"][2].get<double>(), 0.05, 0.01);
  EXPECT_TRUE(found["payload"]["determined"].get<bool>());
  EXPECT_THAT(found["order"].dump(), "[]");
  const std::string other = scratch.write("b.csv", text + "\n");  // no copy
  const Outcome table = run_program({"check-model", file, other, "--config", config});
  EXPECT_EQ(table.status, 0);
  EXPECT_THAT(table.out, HasSubstr("panda_joint7"));
  EXPECT_THAT(table.out, HasSubstr("Payload: 1."));
  EXPECT_THAT(table.out, HasSubstr("No joint is suspicious."));
}

TEST(CheckModelProgram, FindsColumnsByJointNamesAndUnits) {
  const Scratch scratch;
  const std::string config = panda_config(scratch);
  const std::vector<int> mixed = {3, 1, 6, 0, 2, 5, 4};
  const double degree = 57.29577951308232;
  const std::string file =
      scratch.write("a.csv", csv(numbered("panda_joint", "_pos [deg]"), degree,
                                 numbered("panda_joint", "_effort [N m]"), mixed));
  const Json found = check({file, "--config", config});
  EXPECT_NEAR(found["payload"]["mass"].get<double>(), 1.3, 0.02);
  EXPECT_THAT(found["order"].dump(), "[]");
  // Columns without meaningful names.
  const std::function<std::string(int)> letters = [](int j) {
    return std::string(1, static_cast<char>('a' + j));
  };
  const std::function<std::string(int)> capitals = [](int j) {
    return std::string(1, static_cast<char>('A' + j));
  };
  const std::string plain = scratch.write("b.csv", csv(letters, 1, capitals, mixed));
  expect_refusal(run_program({"check-model", plain, "--config", config}),
                 "no columns are known to be the positions of all 7 joints");
  const Json named = check(
      {plain, "--config", config, "--positions", "a,b,c,d,e,f,g", "--torques", "A,B,C,D,E,F,G"});
  EXPECT_NEAR(named["payload"]["mass"].get<double>(), 1.3, 0.02);
  const Json wrong = check(
      {plain, "--config", config, "--positions", "a,b,c,d,e,f,g", "--torques", "A,D,C,B,E,F,G"});
  EXPECT_THAT(wrong["order"].dump(), HasSubstr("1, 4, 3, 2, 5, 6, 7"));
}

TEST(CheckModelProgram, WritesTheGravityOfAnArmThatHangs) {
  const Scratch scratch;
  const std::string up = panda_config(scratch),
                    file = scratch.write("a.csv", csv(numbered("q"), 1, numbered("tau"), kInOrder));
  std::string text = text_of(up);
  text.replace(text.find("robot:"), 6, "robot:\n  gravity: [0, 0, 9.81]");
  const std::string down = scratch.write("down.yaml", text), mended = scratch.path("mended.yaml");
  const Outcome table = run_program({"check-model", file, "--config", down, "--write", mended});
  EXPECT_THAT(table.out, HasSubstr("match an arm with robot.gravity: [0, 0, -9.81], not the"));
  EXPECT_THAT(text_of(mended), HasSubstr("gravity: [0, 0, -9.81]"));
  EXPECT_EQ(check({file, "--config", mended})["gravity"], Json());
  EXPECT_EQ(check({file, "--config", down})["gravity"], Json({0, 0, -9.81}));
}

TEST(CheckModelProgram, RefusesInOneLineThatNamesTheColumn) {
  const Scratch scratch;
  const std::string config = panda_config(scratch);
  const std::string degrees =
      scratch.write("deg.csv", csv(numbered("q"), 57.3, numbered("tau"), kInOrder));
  const Outcome outcome = run_program({"check-model", degrees, "--config", config});
  expect_refusal(outcome, "far beyond the limits of joint 'panda_joint1' in rad; degrees need");
  EXPECT_THAT(outcome.err, HasSubstr("deg.csv: q1: "));
  std::string text = csv(numbered("q"), 1, numbered("tau"), kInOrder);
  expect_refusal(run_program({"check-model", scratch.write("q.csv", text), "--config", config,
                              "--torques", "q1,q2,q3,q4,q5,q6,q7"}),
                 "--torques: q1 is in rad, N m or N is wanted");
  text.replace(text.find('\n', 2000) + 1, 1, "x");
  expect_refusal(run_program({"check-model", scratch.write("x.csv", text), "--config", config}),
                 "x.csv: line ");
  expect_refusal(run_program({"check-model", degrees, "--config", scratch.path("none.yaml")}),
                 "none.yaml");
  expect_refusal(run_program({"check-model", degrees, "--config", config, "--write", config}),
                 "--write");
  // Velocities in degrees without a unit.
  std::string rates = "time";
  for (int j = 1; j < 8; ++j) rates += ",q" + std::to_string(j);
  for (int j = 1; j < 8; ++j) rates += ",dq" + std::to_string(j);
  for (int j = 1; j < 8; ++j) rates += ",tau" + std::to_string(j);
  for (int i = 0; i < 300; ++i) {
    rates += "\n" + std::to_string(0.01 * i);
    for (int j = 0; j < 7; ++j) rates += "," + std::to_string(0.3 * std::sin(0.02 * i));
    for (int j = 0; j < 7; ++j) rates += "," + std::to_string(57.3 * 0.6 * std::cos(0.02 * i));
    for (int j = 0; j < 7; ++j) rates += ",1";
  }
  expect_refusal(run_program({"check-model", scratch.write("v.csv", rates), "--config", config}),
                 "v.csv: dq1: 57.");
}

TEST(CheckModelProgram, WritesTheConfigurationAndKeepsTheRest) {
  const Scratch scratch;
  const std::string config = panda_config(scratch);
  const std::string file = scratch.write("a.csv", csv(numbered("q"), 1, numbered("tau"), kInOrder));
  const std::string written = scratch.path("new.yaml");
  check({file, "--config", config, "--write", written});
  const std::string text = scratch.read("new.yaml");
  for (const char* kept : {"# my arm\n", "# as delivered\n", "payload:  # nothing yet\n",
                           "  # to be weighed\n", "control: {mode: joint}  # and so on\n"}) {
    EXPECT_THAT(text, HasSubstr(kept));
  }
  EXPECT_THAT(text, HasSubstr("    mass: 1."));
  EXPECT_THAT(text, HasSubstr("coulomb_friction: [0.79"));
  EXPECT_THAT(text, Not(HasSubstr("0 kg")));
  const Json again = check({file, "--config", written});
  EXPECT_LT(again["joints"][1]["residual_rms"]["before"].get<double>(), 2);  // 5.5
  EXPECT_NEAR(again["payload"]["mass"].get<double>(), 1.3, 0.02);

  // A configuration that cannot be changed in place.
  const std::string anchors = scratch.write(
      "anchors.yaml", "robot: {urdf: " + testing::arm_path("panda") +
                          ", base: panda_link0, tip: panda_hand_tcp, viscous_friction: &a [0, 0, "
                          "0, 0, 0, 0, 0], coulomb_friction: *a}\ncontrol: {mode: joint}\n");
  const Json noted = check({file, "--config", anchors, "--write", scratch.path("n.yaml")});
  EXPECT_THAT(noted["notes"].dump(), HasSubstr("were not kept"));
  EXPECT_EQ(run_program({"check-model", file, "--config", scratch.path("n.yaml")}).status, 0);
}

/// A log of a Panda's driver with the torques of panda_record(), and with commands if `commanded`
/// gives the torque of the command that answers a sample.
std::string driver_log(const std::function<controller::JointVector(Eigen::Index)>& commanded = {}) {
  const identification::TorqueRecord& record = panda_record();
  std::string log;
  std::uint64_t events = 0;
  const auto add = [&log](std::uint64_t number, int bytes) {
    for (int i = bytes - 1; i >= 0; --i) log += static_cast<char>(number >> (8 * i) & 0xFF);
  };
  const auto add_event = [&](std::int64_t utime, const std::string& channel, const auto& message) {
    std::vector<std::uint8_t> bytes;
    lcmtypes::encode(lcmtypes::DriverKind::kPanda, message, bytes);
    add(0xEDA1DA01, 4);
    add(events++, 8);
    add(static_cast<std::uint64_t>(utime), 8);
    add(channel.size(), 4);
    add(bytes.size(), 4);
    log += channel;
    log.append(bytes.begin(), bytes.end());
  };
  for (Eigen::Index i = 0; i < record.time.size(); ++i) {
    lcmtypes::DriverStatus status;
    status.utime = 1'700'000'000'000'000 + std::llround(1e6 * record.time[i]);
    status.position = record.position.col(i);
    status.velocity.setZero(7);
    status.torque = record.torque.col(i);
    status.external.setZero(7);
    add_event(status.utime, "PANDA_STATUS", status);
    if (!commanded) continue;
    lcmtypes::DriverCommand command;
    command.torque = commanded(i);
    add_event(status.utime, "PANDA_COMMAND", command);
  }
  return log;
}

TEST(CheckModelProgram, TakesMeasuredTorquesOfADriversLog) {
  const Scratch scratch;
  const Json found =
      check({scratch.write("panda.lcm", driver_log()), "--config", panda_config(scratch)});
  EXPECT_NEAR(found["payload"]["mass"].get<double>(), 1.3, 0.02);
  EXPECT_THAT(found["notes"].dump(), HasSubstr("that the driver measured"));
  EXPECT_THAT(found["notes"].dump(), Not(HasSubstr("tau_cmd")));
}

TEST(CheckModelProgram, TakesTheTorquesOfCommandsOnRequest) {
  const Scratch scratch;
  const std::string config = panda_config(scratch);
  const identification::TorqueRecord& record = panda_record();
  // Drives that act on nine tenths of the first joint's torque; a few commands are lost.
  const std::string file =
      scratch.write("bus.lcm", driver_log([&record](Eigen::Index i) -> controller::JointVector {
                      if (i % 50 == 7) return controller::JointVector();
                      controller::JointVector torque = record.torque.col(i);
                      torque[0] /= 0.9;
                      return torque;
                    }));
  const Json measured = check({file, "--config", config});
  EXPECT_NEAR(measured["joints"][0]["coulomb_friction"].get<double>(), 0.8, 0.05);
  EXPECT_THAT(measured["notes"].dump(), HasSubstr("--torques tau_cmd1,..."));
  const Json commanded = check({file, "--config", config, "--torques",
                                "tau_cmd1,tau_cmd2,tau_cmd3,tau_cmd4,tau_cmd5,tau_cmd6,tau_cmd7"});
  EXPECT_NEAR(commanded["joints"][0]["coulomb_friction"].get<double>(), 0.8 / 0.9, 0.05);
  EXPECT_NEAR(commanded["joints"][1]["coulomb_friction"].get<double>(), 1.0, 0.05);
  // Each command counts at its own status: a record has 10 ms from one to the next.
  EXPECT_NEAR(commanded["delay"].get<double>(), measured["delay"].get<double>(), 1e-3);
  EXPECT_NEAR(commanded["payload"]["mass"].get<double>(), 1.3, 0.02);
}

/// The simulator shares no mechanics with the controller's model.
TEST(CheckModelProgram, ReadsALogOfTheSimulator) {
  const Scratch scratch;
  const std::string robot = "robot: {urdf: " + testing::arm_path("panda") +
                            ", base: panda_link0, tip: panda_hand_tcp}\ncontrol: {mode: joint}\n";
  std::string scene = robot +
                      "simulation: {robot: {payload: {mass: 0.8 kg, center: [0, 0, 4 cm]}, "
                      "coulomb_friction: 0.5 N m, viscous_friction: 0.4 N m s/rad}, sensors: "
                      "{position_noise: 1e-5 rad}}\nscenario: {duration: 8, start: {position: [0, "
                      "-45 deg, 0, -135 deg, 0, 90 deg, 45 deg]}, steps: [";
  const std::array<const char*, 4> goals = {
      "[0.5, -0.4, 0.3, -1.8, 0.4, 1.9, 0.2]", "[-0.4, -0.9, -0.3, -2.3, -0.5, 1.3, 1.2]",
      "[0.3, -0.2, 0.5, -1.5, 0.8, 1.2, -0.5]", "[-0.3, -0.7, -0.5, -2, -0.2, 2.2, 0.9]"};
  for (std::size_t i = 0; i < goals.size(); ++i) {
    scene += std::string(i > 0 ? ", " : "") +
             "{at: " + std::to_string(0.2 + 2.0 * static_cast<double>(i)) +
             ", joint_position: " + goals[i] + "}";
  }
  const std::string log = scratch.path("run.lcm");
  const Outcome run =
      run_program({"run", scratch.write("scene.yaml", scene + "]}\n"), "--fast", "--log", log});
  ASSERT_EQ(run.status, 0) << run.err;
  const Json found = check({log, "--config", scratch.write("arm.yaml", robot)});
  EXPECT_EQ(found["torques"], "whole");
  EXPECT_NEAR(found["payload"]["mass"].get<double>(), 0.8, 0.02);
  EXPECT_NEAR(found["payload"]["center"][2].get<double>(), 0.04, 0.01);
  for (std::size_t j = 0; j < 5; ++j) {
    EXPECT_NEAR(found["joints"][j]["coulomb_friction"].get<double>(), 0.5, 0.05) << j;
    EXPECT_NEAR(found["joints"][j]["viscous_friction"].get<double>(), 0.4, 0.15) << j;
  }
}

}  // namespace
}  // namespace dashpot::tests
