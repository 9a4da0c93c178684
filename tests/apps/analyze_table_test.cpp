// The table that `dashpot analyze` prints for people, and other output of the program.
#include <dashpot/tests/apps/json_result.hpp>

#include <gmock/gmock.h>

#include <cstdlib>
#include <sstream>

namespace dashpot::tests {
namespace {

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

std::string table_of(const Outcome& outcome) {
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, IsEmpty());
  return outcome.out;
}

std::size_t widest_line(const std::string& text) {
  std::size_t widest = 0;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) widest = std::max(widest, line.size());
  return widest;
}

TEST(AnalyzeTable, ShowsTheModesOfThePaper) {
  const std::string text = table_of(run_program({"analyze", example("chain3.yaml")}));
  EXPECT_THAT(text, StartsWith("3 coordinates: 2 vibration modes, 1 zero mode\n"));
  EXPECT_THAT(text, ContainsRegex("\n +1 +40\\.2214 +6\\.40144 +0\\.255794 +underdamped"));
  EXPECT_THAT(text, ContainsRegex("\n +2 +30\\.9783 +4\\.93036 +0\\.0976200 +underdamped"));
  EXPECT_THAT(text, ContainsRegex("-10\\.2884 +\\+- 38\\.8833i"));
  EXPECT_THAT(text, HasSubstr("Rank: 1 zero mode; smallest frequency kept 30.9, largest dropped"));
  EXPECT_THAT(text, HasSubstr(", independent."));
  EXPECT_THAT(text, HasSubstr("eliminates q1.\n"));
  EXPECT_THAT(text, HasSubstr("q1 + q2 + q3"));  // the shape of the zero mode
  EXPECT_THAT(text, ContainsRegex("\n +0\\.3 +0\\.0047613 +0\\.003968 +0\\.0027945"));
  EXPECT_THAT(text, Not(HasSubstr("\033")));  // on no terminal
  EXPECT_LE(widest_line(text), 100u);
  for (const std::string name : {"chain3_impulse.yaml", "baxter7.yaml"}) {
    EXPECT_LE(widest_line(table_of(run_program({"analyze", example(name)}))), 100u) << name;
  }
}

TEST(AnalyzeTable, TellsTheSharesOfTheModesInAMotion) {
  const std::string release =
      "{mass: [[1, 0], [0, 1]], stiffness: [[2, -1], [-1, 2]], initial_position: [1, 0], "
      "times: [0]";
  const std::string text = table_of(analyze_text(release + "}"));
  EXPECT_THAT(text, ContainsRegex("\n +1 +1\\.7321 +0 +75\\.0 +0\\.500, 0\\.500\n"));
  EXPECT_THAT(text, ContainsRegex("\n +2 +1\\.0000 +0 +25\\.0 +0\\.500, 0\\.500\n"));
  // The first mode, in which q1 and q2 move against each other, does not move the task p = q1 + q2.
  const Json result =
      analyze_json(release + ", jacobian: [[1, 1]], task_stiffness: [[0]]}")["response"]["shares"];
  EXPECT_NEAR(result["energy"][0].get<double>(), 0.75, 1e-12);
  EXPECT_NEAR(result["amplitude"][0][0].get<double>(), 0, 1e-12);
  EXPECT_NEAR(result["amplitude"][1][0].get<double>(), 1, 1e-12);
  EXPECT_NEAR(result["cross"].get<double>(), 0, 1e-12);
}

TEST(AnalyzeTable, SaysWhatIsSpecialAboutASystem) {
  const std::string general =
      table_of(analyze_text("{mass: [[1]], damping: [[1]], stiffness: [[1]], jacobian: [[1]], "
                            "task_damping: [[1]], jacobian_rate: [[1]]}"));
  EXPECT_THAT(general, Not(HasSubstr("Note")));  // 1 x 1 is symmetric
  const std::string coupled = table_of(analyze_text(
      "{mass: [[1, 0], [0, 1]], damping: [[1, 0], [0, 0]], stiffness: [[1, -1], [-1, 1]]}"));
  EXPECT_THAT(coupled, HasSubstr("Note: the damping couples zero modes and vibrations"));
  EXPECT_THAT(coupled, HasSubstr(", solved together."));
  EXPECT_THAT(table_of(analyze_text("{mass: [[1]], stiffness: [[1]]}")),
              HasSubstr("Note: no damping given: taken as zero"));
}

TEST(AnalyzeTable, HeadsTheSystemsOfAListWithTheirIndex) {
  EXPECT_THAT(table_of(analyze_text("[{mass: [[1]], damping: [[5]], stiffness: [[4]]}, "
                                    "{mass: [[1]], stiffness: [[0]]}]")),
              AllOf(StartsWith("[0] 1 coordinate: 1 vibration mode, no zero modes\n"),
                    ContainsRegex("overdamped +-1\\.00000 +-4\\.00000"),
                    HasSubstr("\n[1] 1 coordinate: no vibration modes, 1 zero mode\n")));
  EXPECT_EQ(table_of(analyze_text("mass: []")),
            "no coordinates: no vibration modes, no zero modes\n");
  EXPECT_EQ(table_of(analyze_text("[]")), "no systems\n");
}

TEST(AnalyzeTable, SplitsTheResponseOfManyJoints) {
  std::string unit, ones;
  for (int i = 0; i < 9; ++i) {
    unit += "[";
    for (int j = 0; j < 9; ++j) unit += i == j ? "1," : "0,";
    unit += "],";
    ones += "1,";
  }
  const std::string text = table_of(analyze_text("{mass: [" + unit + "], stiffness: [" + unit +
                                                 "], force: [" + ones + "], times: [1]}"));
  EXPECT_THAT(text, ContainsRegex("t, s +q1 .* q7\n"));
  EXPECT_THAT(text, ContainsRegex("t, s +q8 +q9\n"));
  EXPECT_LE(widest_line(text), 100u);
}

TEST(Program, ExplainsItself) {
  EXPECT_EQ(table_of(run_program({"--version"})), "dashpot " DASHPOT_VERSION "\n");
  EXPECT_THAT(table_of(run_program({"--help"})),
              AllOf(HasSubstr("analyze"), HasSubstr("\nExit status: 0 if ")));
  for (const char* name : {"analyze", "inspect", "design", "run", "export", "monitor"}) {
    const std::string help = table_of(run_program({name, "--help"}));
    EXPECT_THAT(help, HasSubstr("\nExit status: 0 if ")) << name;
    if (name != std::string("analyze")) continue;
    for (const char* word :
         {"mass", "damping", "stiffness", "jacobian", "task_damping", "task_stiffness",
          "jacobian_rate", "jacobian_derivatives", "wrench", "initial_position", "initial_velocity",
          "impulse", "force", "times", "--json", "--soft-frequency", "--residual", "--pivot"}) {
      EXPECT_THAT(help, HasSubstr(word));
    }
  }
}

TEST(Program, FailsIfItCannotWrite) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  const Outcome outcome = run_program({"analyze", example("chain3.yaml")}, "", "/dev/full");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_EQ(outcome.err,
            "dashpot analyze: cannot write to standard output: No space left on device\n");
}

/// The second number from the end of each line of an underdamped mode.
TEST(AnalyzePlot, DrawsEigenvaluesAndShapes) {
  if (std::system("command -v gnuplot >/dev/null") != 0) GTEST_SKIP() << "there is no gnuplot";
  const Scratch scratch;
  const std::string file = scratch.path("a 'b'.svg");
  const auto drawn = [&](const std::string& system, const std::string& text) {
    const Outcome outcome = run_program({"analyze", "-", "--plot", file}, system);
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return scratch.read("a 'b'.svg").find(">" + text + "<") != std::string::npos;
  };
  const std::string system =
      "{mass: [[1, 0], [0, 1]], stiffness: [[900, 0], [0, 4]], damping: [[300, 0], [0, 0.8]]}";
  for (const char* text : {"-: 2 coordinates, 2 vibration modes, no zero modes", "0.7",
                           "1: 30.00 rad/s, 5.00", "2: 2.000 rad/s, 0.200", "&lt;- 1: -297"}) {
    EXPECT_TRUE(drawn(system, text)) << text;
  }
  // The other eigenvalues fill the picture in spite of the fast one.
  EXPECT_TRUE(drawn(system, "-2"));
  EXPECT_FALSE(drawn(system, "-50"));
  EXPECT_TRUE(drawn("{mass: [[1]], stiffness: [[900]], damping: [[300]]}", "-50"));
  EXPECT_TRUE(drawn("{mass: [[1]], stiffness: [[-900]]}", "1: unstable"));
  expect_refusal(run_program({"analyze", "-", "--plot", file}, "{mass: [[1]], stiffness: [[0]]}"),
                 "--plot: there are no modes to draw");
  const std::string two = "[{mass: [[1]], stiffness: [[1]]}, {mass: [[1]], stiffness: [[1]]}]";
  expect_refusal(run_program({"analyze", "-", "--plot", file}, two),
                 "--plot: draws one system; there are 2");
  expect_refusal(run_program({"analyze", example("chain3.yaml"), "--plot", "x.pdf"}),
                 "--plot: x.pdf: has to end with .svg or .png");
}

std::vector<double> column_of_bounds(const std::string& text) {
  std::vector<double> bounds;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.find("underdamped") == std::string::npos) continue;
    std::istringstream words(line);
    std::vector<std::string> all;
    for (std::string word; words >> word;) all.push_back(word);
    bounds.push_back(std::stod(all.at(all.size() - 2)));
  }
  return bounds;
}

TEST(AnalyzeTable, RoundsBoundsUp) {
  std::string systems;
  for (int i = 1; i <= 60; ++i) {
    systems += "- {mass: [[2, 1], [1, 3]], damping: [[0.1, 0], [0, 0.2]], stiffness: [[" +
               std::to_string(4 + i) + ", 1], [1, 7]]}\n";
  }
  const std::vector<double> printed = column_of_bounds(table_of(analyze_text(systems)));
  const Json exact = analyze_json(systems);
  ASSERT_EQ(printed.size(), 120u);
  for (std::size_t i = 0; i < printed.size(); ++i) {
    const double bound = exact[i / 2]["modes"][i % 2]["error_bound"];
    EXPECT_GE(printed[i], bound);
    EXPECT_LE(printed[i], 1.1 * bound);
  }
}

}  // namespace
}  // namespace dashpot::tests
