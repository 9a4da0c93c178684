// Commands to `dashpot run`: its option, its limits, and what the monitor shows.
#include <dashpot/lcmtypes/publish/encode.hpp>
#include <dashpot/lcmtypes/sink.hpp>
#include <dashpot/tests/apps/scene_run.hpp>

#include <gtest/gtest.h>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string complaint_about(const std::vector<std::string>& words) {
  const Outcome outcome = run_program(words);
  expect_refusal(outcome, "");
  return outcome.err;
}

TEST(RunCommands, AreNotTakenWhereTheyMakeNoSense) {
  EXPECT_EQ(complaint_about({"run", scene("ur5"), "--fast", "--commands"}),
            "dashpot run: --commands: is for real time: with --fast commands would come at no "
            "particular time\n");
}

TEST(RunCommands, AreSaidNotToBeTaken) {
  EXPECT_THAT(run_scene(scene("ur5"), {"--duration", "0.1"}).out,
              HasSubstr("\n  Commands: not taken (--commands)\n"));
  const Json result = run_json(scene("ur5"), {"--duration", "0.1"});
  EXPECT_EQ(result["commands"]["taken"], false);
  EXPECT_EQ(result["commands"]["verdicts"], Json::object());
  EXPECT_EQ(result["faults"], 0);
  EXPECT_EQ(result["fault"], nullptr);
}

/// The error of a scene with `limits` under the key `commands`.
std::string complaint_about_limits(const std::string& limits) {
  const Scratch scratch;
  const std::string path =
      changed(scratch, "ur5", "simulation:", "commands: {" + limits + "}\nsimulation:");
  const std::string said = complaint_about({"run", path, "--fast"});
  const std::string begin = "dashpot run: " + path + ": ";
  EXPECT_TRUE(said.starts_with(begin)) << said;
  return said.substr(begin.size());
}

TEST(RunCommands, HaveLimitsInTheScene) {
  EXPECT_EQ(complaint_about_limits("reach: 0 m"),
            "commands.reach: is 0 m, not positive (line 14)\n");
  EXPECT_EQ(complaint_about_limits("force: 20 m"),
            "commands.force: has a wrong unit: '20 m'; N is wanted (line 14)\n");
  EXPECT_EQ(complaint_about_limits("silence: 2 m"),
            "commands.silence: has a wrong unit: '2 m'; s is wanted (line 14)\n");
  EXPECT_EQ(complaint_about_limits("oldest: 4000 s"),
            "commands.oldest: is more than an hour (line 14)\n");
  EXPECT_THAT(complaint_about_limits("burst: 0"), HasSubstr("commands.burst: "));
  const std::string known = complaint_about_limits("forces: 1 N");
  EXPECT_THAT(known, HasSubstr("commands.forces: unknown key; the keys are "));
  // Each of them stands in the example.
  const std::string example = text_of(scene("panda"));
  const std::string given = example.substr(example.find("\ncommands:"));
  std::istringstream words(known.substr(known.find("keys are ") + 9));
  int keys = 0;
  for (std::string word; words >> word && word != "(line"; ++keys) {
    if (word.ends_with(',')) word.pop_back();
    EXPECT_THAT(given, HasSubstr("\n  " + word + ": "));
  }
  EXPECT_EQ(keys, 19);
}

TEST(MonitorOfCommands, ShowsFaultCommanderAndVerdicts) {
  const Scratch scratch;
  const std::string path = scratch.path("commands.lcm");
  const auto write = [&path](controller::Status fault, std::int64_t commander) {
    lcmtypes::StateSample sample;
    sample.utime = 1'700'000'000'000'000;
    sample.snapshot.tick = 700;
    for (auto* vector : {&sample.snapshot.position, &sample.snapshot.velocity}) vector->setZero(7);
    sample.snapshot.fault = fault;
    sample.health.fault_tick = fault == controller::Status::kOk ? 0 : 345;
    lcmtypes::CommandTally& commands = sample.health.commands;
    commands.commander = commander;
    if (commander != 0) {
      commands.verdicts[0] = 5;
      commands.verdicts[static_cast<std::size_t>(lcmtypes::CommandVerdict::kStale)] = 2;
      commands.verdicts[static_cast<std::size_t>(lcmtypes::CommandVerdict::kOtherSender)] = 1;
      commands.last_refusal = lcmtypes::CommandVerdict::kOtherSender;
      commands.last_refusal_utime = sample.utime - 2'500'000;
      commands.last_refused_sender = 99;
    }
    state_t message{};
    lcmtypes::fill(sample, message);
    std::vector<std::uint8_t> bytes;
    lcmtypes::encode(message, bytes);
    std::remove(path.c_str());
    EXPECT_TRUE(lcmtypes::make_log_sink(path)->send(lcmtypes::kStateChannel, bytes, sample.utime));
  };
  write(controller::Status::kVelocityLimit, 17);
  const std::string troubled = run_program({"monitor", "--log", path}).out;
  const std::string line = troubled.substr(0, troubled.find('\n'));
  EXPECT_THAT(line, HasSubstr("FAULT LATCHED at tick 345: velocity limit exceeded"));
  const std::string summary = troubled.substr(troubled.find('\n'));
  EXPECT_THAT(summary, HasSubstr("\n  FAULT LATCHED at tick 345: velocity limit exceeded"));
  EXPECT_THAT(
      summary,
      HasSubstr("\n  commands: 5 accepted, 3 rejected (2 too old, 1 another sender commands);"
                " sender 17 commands\n  last rejected 2.5 s before: another sender "
                "commands, of sender 99\n"));
  write(controller::Status::kOk, 0);
  const std::string calm = run_program({"monitor", "--log", path}).out;
  EXPECT_THAT(calm, Not(HasSubstr("LATCHED")));
  EXPECT_THAT(calm, HasSubstr("\n  commands: 0 accepted, 0 rejected; no commander\n"));
  EXPECT_THAT(calm, Not(HasSubstr("last rejected")));
}

}  // namespace
}  // namespace dashpot::tests
