// The messages contain the samples, and their definitions do not change.
#include <dashpot/lcmtypes/message_check.hpp>
#include <dashpot/tests/lcmtypes/random_samples.hpp>
#include <dashpot/tests/support/places.hpp>

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <string>

namespace dashpot::lcmtypes {
namespace {

using ::testing::ElementsAreArray;

/// The rotation matrix of w, x, y, z, by Rodrigues' formula in the quaternion's entries.
Eigen::Matrix3d rotation_of(const double (&q)[4]) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  Eigen::Matrix3d R;
  R << 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),  //
      2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),   //
      2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y);
  return R;
}

TEST(Messages, SayTheUnitOrMeaningOfEveryField) {
  const std::regex field(R"(^\s+(int\d+_t|double|boolean)\s+\w+(\[\w+\])*;(.*)$)");
  const std::regex comment(R"(^\s*// \S.*)");
  int fields = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(DASHPOT_SOURCE_DIR) + "/lcmtypes")) {
    if (entry.path().extension() != ".lcm") continue;
    std::ifstream file(entry.path());
    std::smatch match;
    for (std::string line, before; std::getline(file, line); before = line) {
      if (!std::regex_match(line, match, field)) continue;
      ++fields;
      const std::string rest = match[3];
      EXPECT_TRUE(std::regex_match(rest, comment) || std::regex_match(before, comment))
          << entry.path() << ": " << line;
    }
  }
  EXPECT_GT(fields, 50);
}

TEST(StateMessage, SaysWhatTheSampleSays) {
  Random random(901);
  for (int n = 1; n <= controller::kMaxJoints; ++n) {
    const StateSample sample = random_state(random, n);
    const Bytes bytes = bytes_of(message_of<state_t>(sample));
    state_t message;
    ASSERT_TRUE(decode(bytes.data(), bytes.size(), message));
    const controller::Snapshot& snapshot = sample.snapshot;
    EXPECT_EQ(message.n, n);
    EXPECT_EQ(message.utime, sample.utime);
    EXPECT_EQ(message.tick, static_cast<std::int64_t>(snapshot.tick));
    EXPECT_EQ(message.restarts, static_cast<std::int64_t>(snapshot.restarts));
    EXPECT_EQ(message.mode, static_cast<int>(snapshot.mode));
    EXPECT_EQ(message.status, static_cast<int>(snapshot.status));
    EXPECT_THAT(message.joint_position, ElementsAreArray(list(snapshot.position)));
    EXPECT_THAT(message.joint_velocity, ElementsAreArray(list(snapshot.velocity)));
    EXPECT_THAT(message.joint_torque, ElementsAreArray(list(snapshot.torque)));
    EXPECT_THAT(message.law_torque, ElementsAreArray(list(snapshot.law_torque)));
    EXPECT_THAT(message.reference_joint_position,
                ElementsAreArray(list(snapshot.reference_position)));
    EXPECT_THAT(message.tip_position, ElementsAreArray(list(snapshot.tip.position)));
    EXPECT_THAT(message.reference_tip_position,
                ElementsAreArray(list(snapshot.reference_tip.position)));
    EXPECT_TRUE(rotation_of(message.tip_quaternion).isApprox(snapshot.tip.rotation, 1e-14));
    EXPECT_TRUE(rotation_of(message.reference_tip_quaternion)
                    .isApprox(snapshot.reference_tip.rotation, 1e-14));
    EXPECT_GE(message.tip_quaternion[0], 0);
    EXPECT_THAT(message.tip_error, ElementsAreArray(list(snapshot.tip_error)));
    EXPECT_THAT(message.tip_wrench, ElementsAreArray(list(snapshot.tip_wrench)));
    EXPECT_EQ(message.joint_damping_ratio, snapshot.joint_damping_ratio);
    EXPECT_EQ(message.task_damping_ratio, snapshot.task_damping_ratio);
    EXPECT_EQ(message.damping_level, snapshot.damping_level);
    EXPECT_EQ(message.energy_store, snapshot.energy_store);
    EXPECT_EQ(message.spring_share, snapshot.spring_share);
    EXPECT_EQ(message.payload_mass, snapshot.payload.mass);
    EXPECT_THAT(message.payload_center, ElementsAreArray(list(snapshot.payload.center)));
    EXPECT_THAT(message.tool_position, ElementsAreArray(list(snapshot.tool.position)));
    EXPECT_TRUE(rotation_of(message.tool_quaternion).isApprox(snapshot.tool.rotation, 1e-14));
    EXPECT_EQ(message.tick_time, sample.health.tick_time);
    EXPECT_EQ(message.longest_tick_time, sample.health.longest_tick_time);
    EXPECT_EQ(message.overruns, sample.health.overruns);
    EXPECT_EQ(message.fault, static_cast<int>(snapshot.fault));
    EXPECT_EQ(message.fault_tick, sample.health.fault_tick);
    const CommandTally& commands = sample.health.commands;
    EXPECT_THAT(message.verdicts, ElementsAreArray(commands.verdicts));
    EXPECT_EQ(message.last_refusal, static_cast<int>(commands.last_refusal));
    EXPECT_EQ(message.last_refusal_utime, commands.last_refusal_utime);
    EXPECT_EQ(message.last_refused_sender, commands.last_refused_sender);
    EXPECT_EQ(message.commander, commands.commander);
    EXPECT_EQ(message.commands_accepted, commands.verdicts[0]);
    std::int64_t all = 0;
    for (const std::int64_t verdict : commands.verdicts) all += verdict;
    EXPECT_EQ(message.commands_rejected, all - commands.verdicts[0]);
  }
}

TEST(StateMessage, FillsUpWhatIsNotThereYet) {
  Random random(902);
  StateSample sample = random_state(random, 7);
  sample.health = {};  // before the end of the first tick
  sample.snapshot.torque.resize(0);
  sample.snapshot.velocity = random.vector(9);
  const auto message = message_of<state_t>(sample);
  EXPECT_THAT(message.joint_torque, ElementsAreArray(std::vector<double>(7, 0.0)));
  EXPECT_THAT(message.joint_velocity, ElementsAreArray(list(sample.snapshot.velocity.head(7))));
  for (const std::int64_t count : std::initializer_list<std::int64_t>{
           message.tick_time, message.longest_tick_time, message.overruns, message.fault_tick}) {
    EXPECT_EQ(count, 0);
  }
}

TEST(SampledModesMessage, SaysWhatTheSampleSays) {
  Random random(907);
  for (int n = 1; n <= controller::kMaxJoints; ++n) {
    const SampledModesSample sample = random_sampled_modes(random, n);
    const Bytes bytes = bytes_of(message_of<sampled_modes_t>(sample));
    sampled_modes_t message;
    ASSERT_TRUE(decode(bytes.data(), bytes.size(), message));
    const controller::SampledVibration& vibration = sample.vibration;
    EXPECT_EQ(message.n, n);
    EXPECT_EQ(message.num_modes, vibration.count);
    EXPECT_EQ(message.utime, sample.utime);
    EXPECT_EQ(message.tick, static_cast<std::int64_t>(vibration.tick));
    EXPECT_EQ(message.status, static_cast<int>(vibration.status));
    EXPECT_THAT(message.joint_position, ElementsAreArray(list(vibration.position)));
    EXPECT_EQ(message.spectral_radius, vibration.spectral_radius);
    EXPECT_EQ(message.gain_margin, vibration.gain_margin);
    EXPECT_EQ(static_cast<std::uint32_t>(message.assumes), vibration.assumes);
    for (std::size_t i = 0; i < static_cast<std::size_t>(vibration.count); ++i) {
      const controller::SampledVibrationMode& mode = vibration.modes[i];
      EXPECT_EQ(message.continuous_frequency[i], mode.continuous_frequency);
      EXPECT_EQ(message.continuous_ratio[i], mode.continuous_ratio);
      EXPECT_EQ(message.natural_frequency[i], mode.natural_frequency);
      EXPECT_EQ(message.damping_ratio[i], mode.damping_ratio);
      EXPECT_EQ(message.damped_frequency[i], mode.damped_frequency);
      EXPECT_EQ(message.kind[i], static_cast<int>(mode.kind));
    }
  }
}

TEST(ModesMessage, SaysWhatTheSampleSays) {
  Random random(903);
  for (int n = 1; n <= controller::kMaxJoints; ++n) {
    const ModesSample sample = random_modes(random, n);
    const Bytes bytes = bytes_of(message_of<modes_t>(sample));
    modes_t message;
    ASSERT_TRUE(decode(bytes.data(), bytes.size(), message));
    const controller::Vibration& vibration = sample.vibration;
    EXPECT_EQ(message.n, n);
    EXPECT_EQ(message.num_modes, vibration.count);
    EXPECT_EQ(message.zero_modes, vibration.zero_modes);
    EXPECT_EQ(message.utime, sample.utime);
    EXPECT_EQ(message.tick, static_cast<std::int64_t>(vibration.tick));
    EXPECT_EQ(message.origin,
              vibration.origin == analysis::SpectrumOrigin::kTracked  ? modes_t::TRACKED
              : vibration.origin == analysis::SpectrumOrigin::kReused ? modes_t::REUSED
                                                                      : modes_t::DIRECT);
    EXPECT_THAT(message.joint_position, ElementsAreArray(list(vibration.position)));
    for (std::size_t i = 0; i < static_cast<std::size_t>(vibration.count); ++i) {
      const controller::VibrationMode& mode = vibration.modes[i];
      EXPECT_EQ(message.label[i], vibration.modes[i].label);
      EXPECT_EQ(message.kind[i], static_cast<int>(mode.kind));
      for (std::size_t k = 0; k < 2; ++k) {
        EXPECT_EQ(message.eigenvalue_real[i][k], mode.eigenvalues[k].real());
        EXPECT_EQ(message.eigenvalue_imag[i][k], mode.eigenvalues[k].imag());
      }
      EXPECT_EQ(message.natural_frequency[i], mode.natural_frequency);
      EXPECT_EQ(message.damping_ratio[i], mode.damping_ratio);
      EXPECT_EQ(message.damped_frequency[i], mode.damped_frequency);
      EXPECT_EQ(message.eigenvalue_bound[i], mode.error_bound);
      EXPECT_EQ(message.natural_frequency_bound[i], mode.natural_frequency_bound);
      EXPECT_EQ(message.damping_ratio_bound[i], mode.damping_ratio_bound);
      const Eigen::VectorXd real = mode.shape.real(), imag = mode.shape.imag();
      EXPECT_THAT(message.shape_real[i], ElementsAreArray(list(real)));
      EXPECT_THAT(message.shape_imag[i], ElementsAreArray(list(imag)));
    }
  }
}

// One packet of LCM's multicast holds 1435 bytes; longer messages come in fragments.
TEST(Messages, OfSevenJointsTakeOnePacketForTheStateAndTwoForTheModes) {
  Random random(904);
  EXPECT_LE(bytes_of(message_of<state_t>(random_state(random, 7))).size(), 1435u);
  ModesSample modes = random_modes(random, 7);
  modes.vibration.count = 6;
  EXPECT_LE(bytes_of(message_of<modes_t>(modes)).size(), 2 * 1435u);
}

}  // namespace
}  // namespace dashpot::lcmtypes
