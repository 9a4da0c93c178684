// Mistakes of a new user are answered in one line that says what to write.
#include <dashpot/tests/apps/run_program.hpp>
#include <dashpot/tests/apps/scene_run.hpp>

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <sstream>

namespace dashpot::tests {
namespace {

const Words kStiffness = {"--stiffness", "200,200,200,20,20,20"};

TEST(Mistakes, InNamesOfSubcommandsAreGuessed) {
  for (const auto& [word, meant] : {std::pair("analyse", "analyze"),
                                    {"RUN", "run"},
                                    {"mointor", "monitor"},
                                    {"idnetify", "identify"},
                                    {"checkmodel", "check-model"},
                                    {"insp", "inspect"}}) {
    expect_refusal(run_program({word, "x"}), std::string("did you mean ") + meant + "?");
  }
  expect_refusal(run_program({"help"}), "dashpot --help is meant");
  expect_refusal(run_program({"version"}), "dashpot --version is meant");
  expect_refusal(run_program({"x"}), "there are analyze, inspect, ");
}

TEST(Mistakes, InNamesOfOptionsAreGuessed) {
  const std::string file = example("chain3.yaml");
  expect_refusal(run_program({"analyze", file, "--jsn"}), "--jsn; did you mean --json?");
  expect_refusal(run_program({"analyze", file, "--soft-freq=1"}), "did you mean --soft-frequency?");
  expect_refusal(run_program(joined(of_panda("audit", kStiffness), {"--damping_factor", "2"})),
                 "did you mean --damping-factor?");
  const Outcome other = run_program({"analyze", file, "--wrongness"});
  expect_refusal(other, "--wrongness");
  EXPECT_THAT(other.err, ::testing::Not(::testing::HasSubstr("did you mean")));
}

TEST(Mistakes, InListsOfNumbersAreNamed) {
  expect_refusal(run_program(of_panda("inspect", {"--q", "0 0 0 -1.5 0 1.5 0"})),
                 "--q: 1 number, expected 7, with commas between them");
  const Outcome one = run_program(of_panda("inspect", {"--q", "30 deg"}));
  expect_refusal(one, "--q: 1 number, expected 7");
  EXPECT_THAT(one.err, ::testing::Not(::testing::HasSubstr("commas")));
}

TEST(Mistakes, InWhatGoesTogetherAreNamed) {
  expect_refusal(run_program(joined({"design", example("chain3.yaml"), "--damping-ratio", "1"},
                                    {"--urdf", "a.urdf"})),
                 "FILE: does not go with --urdf: give one of them");
  expect_refusal(run_program({"design", "--damping-ratio", "1"}), "FILE: give a file, or --urdf");
  const Scratch scratch;
  expect_refusal(run_program({"export", scratch.write("a.lcm", "")}),
                 "dashpot export: --mcap, --csv: one of them is needed");
  expect_refusal(run_program(joined(of_panda("audit", kStiffness),
                                    {"--damping-factor", "2", "--samples", "5", "--seed", "-1"})),
                 "--seed");
}

TEST(Mistakes, InKindsOfFilesAreNamed) {
  const Scratch scratch;
  const std::string folder = scratch.path("folder");
  std::filesystem::create_directory(folder);
  for (const Words& words :
       {Words{"export", folder, "--csv", scratch.path("a.csv")}, Words{"monitor", "--log", folder},
        joined(of_panda("audit", kStiffness), {"--damping-factor", "2", "--log", folder})}) {
    const Outcome outcome = run_program(words);
    EXPECT_NE(outcome.status, 0) << words[0];
    EXPECT_THAT(outcome.err, ::testing::HasSubstr("cannot read the log: Is a directory"));
  }
  expect_refusal(run_program({"inspect", "--urdf", scratch.write("a.yaml", "mass: 1"), "--base",
                              "a", "--tip", "b"}),
                 "a.yaml: is no robot description: it has no XML in it");
}

TEST(Mistakes, OfACommandAreNamedBeforeALoopIsAwaited) {
  for (const auto& [words, text] :
       {std::pair(Words{}, "says nothing"),
        {Words{"--payload", "heavy"}, "--payload: "},
        {Words{"--stiffness", "1,2", "--damping-ratio", "1"}, "--stiffness: 2 numbers, expected "},
        {Words{"--tip-position", "1"}, "--tip-position: 1 number, expected 3"}}) {
    expect_refusal(run_program(joined(words.empty() ? Words{"command"} : joined({"command"}, words),
                                      {"--lcm-url", own_url(), "--timeout", "0.01"})),
                   text);
  }
}

/// A file without a line of names is read with what the command says of it.
TEST(Mistakes, OfACheckOfNumbersAloneCanBeMended) {
  const Scratch scratch;
  std::ostringstream text;
  text.precision(12);
  for (int i = 0; i < 4000; ++i) {
    for (int k = 0; k < 7; ++k) text << 0.3 * std::sin(0.001 * i * (k + 3)) << ",";
    for (int k = 0; k < 7; ++k) text << std::cos(0.002 * i * (k + 2)) << (k < 6 ? "," : "\n");
  }
  const Words check = {"check-model", scratch.write("a.csv", text.str()), "--config",
                       scene("panda_release_c1")};
  expect_refusal(run_program(check), "--positions: no columns are known to be");
  std::string names;
  for (const char* name : {"q", "tau"}) {
    for (int k = 1; k <= 7; ++k) {
      names += (names.empty() ? "" : ",") + std::string(name) + std::to_string(k) +
               (name[0] == 'q' ? " [rad]" : " [N m]");
    }
  }
  const Outcome outcome = run_program(joined(check, {"--rate", "1000", "--columns", names}));
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, ::testing::HasSubstr("s of motion, means over"));
}

}  // namespace
}  // namespace dashpot::tests
