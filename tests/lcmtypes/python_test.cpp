// A log read in Python, with types from the stock generator, contains the published samples.
#include <dashpot/lcmtypes/publisher.hpp>
#include <dashpot/tests/lcmtypes/random_samples.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/scratch.hpp>

#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

namespace dashpot::lcmtypes {
namespace {

using tests::Scratch;

/// Runs a command of the shell; its output, or a failure that shows what it complained of.
std::string run(const Scratch& scratch, const std::string& command) {
  const std::string line = command + " >" + scratch.path("out") + " 2>" + scratch.path("err");
  EXPECT_EQ(std::system(line.c_str()), 0) << command << '\n' << scratch.read("err");
  return scratch.read("out");
}

/// Modes as they come from the analysis: frequency, ratio and eigenvalues agree.
void make_consistent(Random& random, ModesSample& sample) {
  for (std::size_t i = 0; i < static_cast<std::size_t>(sample.vibration.count); ++i) {
    controller::VibrationMode& mode = sample.vibration.modes[i];
    const analysis::Complex first(-random.uniform(0.1, 5), random.uniform(1, 30));
    mode.eigenvalues = {first, std::conj(first)};
    mode.natural_frequency = std::abs(first);
    mode.damping_ratio = -first.real() / std::abs(first);
    mode.damped_frequency = first.imag();
  }
}

TEST(Python, ReadsALogWithGeneratedTypes) {
  const Scratch scratch;
  Random random(971);
  std::vector<StateSample> states;
  std::vector<ModesSample> modes;
  {
    std::vector<std::unique_ptr<Sink>> sinks;
    sinks.push_back(make_log_sink(scratch.path("a.lcm")));
    Publisher publisher(std::move(sinks));
    for (int n = 1; n <= controller::kMaxJoints; ++n) {
      states.push_back(random_state(random, n));
      modes.push_back(random_modes(random, n));
      make_consistent(random, modes.back());
      publisher.offer(states.back());
      publisher.offer(modes.back());
      publisher.publish_pending();
    }
  }
  const std::string source = DASHPOT_SOURCE_DIR;
  run(scratch,
      "lcm-gen --python --ppath " + scratch.path("types") + " " + source + "/lcmtypes/*.lcm");
  const std::string output = run(scratch, "python3 -B " + source + "/tests/lcmtypes/read_log.py " +
                                              scratch.path("types") + " " + scratch.path("a.lcm"));
  const auto read = nlohmann::json::parse(output);
  ASSERT_EQ(read["states"].size(), states.size());
  ASSERT_EQ(read["modes"].size(), modes.size());
  for (std::size_t i = 0; i < states.size(); ++i) {
    const controller::Snapshot& snapshot = states[i].snapshot;
    const auto& state = read["states"][i];
    EXPECT_EQ(state["tick"], snapshot.tick);
    EXPECT_EQ(state["q"], list(snapshot.position));
    EXPECT_EQ(state["torque"], list(snapshot.torque));
    double quaternion[4];
    write_quaternion(snapshot.tip.rotation, quaternion);
    EXPECT_EQ(state["quaternion"], std::vector<double>(quaternion, quaternion + 4));
    const controller::Vibration& vibration = modes[i].vibration;
    const auto& message = read["modes"][i];
    EXPECT_EQ(message["q"], list(vibration.position));
    for (std::size_t k = 0; k < static_cast<std::size_t>(vibration.count); ++k) {
      EXPECT_EQ(message["frequency"][k], vibration.modes[k].natural_frequency);
      EXPECT_EQ(message["label"][k], vibration.modes[k].label);
      const Eigen::VectorXd shape = vibration.modes[k].shape.real();
      EXPECT_EQ(message["shape"][k], list(shape));
    }
  }
}

}  // namespace
}  // namespace dashpot::lcmtypes
