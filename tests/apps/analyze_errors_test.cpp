// Errors of `dashpot analyze` for bad input: one line that names the key, status 2, no output.
#include <dashpot/tests/apps/run_program.hpp>

#include <gmock/gmock.h>

#include <vector>

namespace dashpot::tests {
namespace {

using ::testing::StartsWith;

void expect_refused(const Outcome& outcome, const std::string& start, const std::string& reason) {
  expect_refusal(outcome, reason);
  EXPECT_THAT(outcome.err, StartsWith(start));
}

const std::string kTwo =
    "mass: [[2, 0], [0, 1]]\ndamping: [[1, 0], [0, 1]]\nstiffness: [[3, -1], [-1, 1]]\n";
const std::string kMassAndDamping = "mass: [[2, 0], [0, 1]]\ndamping: [[1, 0], [0, 1]]\n";
const std::string kTask = "mass: [[2, 0], [0, 1]]\njacobian: [[1, 1]]\n";

/// The text after the file's name (a key with its colon), a part of the reason, and the input.
struct BadInput {
  std::string key, reason, text;
};

TEST(AnalyzeErrors, AreOneLineThatNamesTheKey) {
  const std::vector<BadInput> all = {
      // matrices

      {"mass: ", "missing", "stiffness: [[1]]\n"},
      {"stiffness: ", "missing", kMassAndDamping},
      {"mass: ", "2 x 3", "mass: [[1, 0, 0], [0, 1, 0]]\nstiffness: [[1, 0], [0, 1]]\n"},
      {"mass: ", "not symmetric", "mass: [[1, 0.5], [0, 1]]\nstiffness: [[1, 0], [0, 1]]\n"},
      {"mass: ", "not positive definite (line 1)",
       "mass: [[1, 2], [2, 1]]\nstiffness: [[1, 0], [0, 1]]\n"},
      {"mass: ", "not positive definite", "mass: [[0]]\nstiffness: [[1]]\n"},
      {"system: ", "too large or too small", "mass: [[1.7e308]]\nstiffness: [[1]]\n"},
      {"damping: ", "1 x 2", "mass: [[1]]\nstiffness: [[1]]\ndamping: [[1, 2]]\n"},
      {"damping: ", "(line 4)",
       "mass: [[2, 0], [0, 1]]\nstiffness: [[3, -1], [-1, 1]]\n\n"
       "damping: [[1, 0.1], [0, 1]]\n"},
      {"stiffness: ", "not symmetric", kMassAndDamping + "stiffness: [[1, 1], [0, 1]]\n"},
      {"stiffness: ", "expected 2 x 2", kMassAndDamping + "stiffness: [[1]]\n"},
      {"stiffness: ", "row 2 has 1 entries, row 1 has 2 (line 3)",
       kMassAndDamping + "stiffness: [[1, 0], [0]]\n"},
      {"stiffness: ", "row 1, entry 2 is not finite",
       kMassAndDamping + "stiffness: [[1, .nan], [0, 1]]\n"},
      {"damping: ", "row 2, entry 2 is not finite",
       "mass: [[2, 0], [0, 1]]\ndamping: [[1, 0], [0, -.inf]]\n"},
      {"mass: ", "not finite", "{\"mass\": [[NaN]], \"stiffness\": [[1]]}"},
      {"mass: ", "not finite", "mass: [[1e999]]\nstiffness: [[1]]\n"},
      {"mass: ", "row 1, entry 1 is not a number but 'one'", "mass: [[one]]\nstiffness: [[1]]\n"},
      {"mass: ", "'1.0kg'", "mass: [[1.0kg]]\nstiffness: [[1]]\n"},
      {"mass: ", "the text '1'", "mass: [['1']]\nstiffness: [[1]]\n"},
      {"mass: ", "nothing", "mass:\nstiffness: [[1]]\n"},
      {"mass: ", "nothing", "mass: [[null]]\nstiffness: [[1]]\n"},
      {"mass: ", "a list of rows is wanted", "mass: 1\n"},
      {"mass: ", "row 1: a list of numbers is wanted", "mass: [1, 1]\n"},
      {"mass: ", "not a number but a list", "mass: [[[1]]]\nstiffness: [[1]]\n"},
      {"mass: ", "a mapping", "mass: {a: 1}\n"},
      // taskspace

      {"task_stiffness: ", "jacobian", "mass: [[1]]\ntask_stiffness: [[1]]\n"},
      {"jacobian: ", "task_stiffness", kTwo + "jacobian: [[1, 1]]\n"},
      {"jacobian: ", "expected 1 x 2",
       "mass: [[2, 0], [0, 1]]\njacobian: [[1, 1, 1]]\ntask_stiffness: [[1]]\n"},
      {"task_stiffness: ", "expected 1 x 1", kTask + "task_stiffness: [[1, 0], [0, 1]]\n"},
      {"task_damping: ", "not symmetric",
       "mass: [[2, 0], [0, 1]]\njacobian: [[1, 1], [0, 1]]\n"
       "task_stiffness: [[1, 0], [0, 1]]\ntask_damping: [[1, 1], [0, 1]]\n"},
      {"jacobian_rate: ", "task_damping",
       kTask + "task_stiffness: [[1]]\njacobian_rate: [[0, 1]]\n"},
      {"jacobian_derivatives: ", "wrench",
       kTask + "task_stiffness: [[1]]\njacobian_derivatives: [[[0, 1]], [[1, 0]]]\n"},
      {"jacobian_derivatives: ", "(line 4)",
       kTask + "task_stiffness: [[1]]\njacobian_derivatives: [[[0, 1]]]\nwrench: [1]\n"},
      {"jacobian_derivatives[2]: ", "(line 4)",
       kTask + "task_stiffness: [[1]]\njacobian_derivatives: [[[0, 1]], [[1]]]\n"
               "wrench: [1]\n"},
      {"wrench: ", "expected 1 x 1",
       kTask + "task_stiffness: [[1]]\njacobian_derivatives: [[[0, 1]], [[1, 0]]]\n"
               "wrench: [1, 2]\n"},
      // vectors

      {"initial_position: ", "has 3 entries, mass has 2 rows (line 4)",
       kTwo + "initial_position: [0, 0, 1]\n"},
      {"initial_velocity: ", "has 1 entries", kTwo + "initial_velocity: [0]\ntimes: [1]\n"},
      {"impulse: ", "has 0 entries", kTwo + "impulse: []\n"},
      {"force: ", "has 3 entries", kTwo + "force: [1, 2, 3]\n"},
      {"force: ", "a list of numbers is wanted", kTwo + "force: 1\n"},
      {"force: ", "entry 2 is not finite", kTwo + "force: [0, .inf]\n"},
      {"times: ", "entry 1 is not a number", kTwo + "times: [soon]\n"},
      {"times: ", "entry 2 is negative", kTwo + "times: [0, -1]\n"},
      // keys

      {"stifness: ", "unknown key; the keys are mass, damping, stiffness",
       kTwo + "stifness: [[1]]\n"},
      {"a b: ", "unknown key", "\"a\\nb\": 1\n"},
      {"a\\x00b: ", "unknown key", "\"a\\0b\": 1\n"},
      {"mass: ", "duplicate key (line 4)", kTwo + "mass: [[1]]\n"},
      {"a key is a list", "", "? [mass]\n: 1\n"},
      {"[1].damping: ", "not finite: '.nan' (line 6)",
       "- mass: [[1]]\n  stiffness: [[1]]\n- mass: [[1]]\n  stiffness: [[1]]\n"
       "  damping:\n   - [.nan]\n"},
      {"[1].mass: ", "not positive definite (line 3)",
       "- mass: [[1]]\n  stiffness: [[1]]\n- mass: [[-1]]\n  stiffness: [[1]]\n"},
      {"[0]: ", "a mapping of keys to values is wanted, not '3'", "- 3\n"},
      {"[1].mas: ", "unknown key", "[{mass: [[1]], stiffness: [[1]]}, {mas: 1}]\n"},
      // files
      {"is empty", "", ""},
      {"is empty", "", "# mass\n"},
      {"a mapping of keys to values is wanted, not 'mass'", "", "mass\n"},
      {"is not YAML: ", "(line 2)", "mass: [[1]]\nstiffness: ]\n"},
      {"is not YAML: ", "", "mass: [[1, 2]\n"},
      {"is not YAML: ", "",
       std::string("\x7f"
                   "ELF\0\1\2",
                   7)},
      {"is compressed; unpack it first", "", std::string("\x1f\x8b\x08\0\0\0\"\\\x03", 8)},
      {"holds several documents; give a list instead", "", "---\n" + kTwo + "---\n" + kTwo},
      {"is not YAML: ", "", "mass: *m\n"},
      {"an alias refers to itself", "", "mass: &m [*m]\n"},
      {"[1].<<: ", "unknown key", "- &a {mass: [[1]], stiffness: [[1]]}\n- {<<: *a}\n"}};
  for (std::size_t i = 0; i < all.size(); ++i) {
    SCOPED_TRACE(all[i].text);
    const Words options = i % 4 == 0 ? Words{"--json"} : Words{};
    expect_refused(analyze_text(all[i].text, options), "dashpot analyze: -: " + all[i].key,
                   all[i].reason);
  }
}

TEST(AnalyzeErrors, NameTheFileOrTheOption) {
  const Scratch scratch;
  const std::string file = scratch.write("arm.yaml", "mass: [[1, 2]]\nstiffness: [[1]]\n");
  const std::string hint = "(dashpot analyze --help)", begin = "dashpot analyze: ";
  expect_refused(run_program({"analyze", file}), begin + file + ": mass: ", "1 x 2");
  expect_refused(run_program({"analyze", "no\nfile\r.yaml"}),
                 begin + "no file .yaml: ", "cannot be opened");
  expect_refused(run_program({"analyze", "no-such-file.yaml"}),
                 begin + "no-such-file.yaml: ", "No such file or directory");
  expect_refused(run_program({"analyze", scratch.path("")}), begin + scratch.path("") + ": ",
                 "Is a directory");
  expect_refused(run_program({"analyze"}), begin, hint);
  expect_refused(run_program({"analyze", "a", "b"}), begin, hint);
  expect_refused(run_program({"analyze", "-", "--nonsense"}), begin, "--nonsense");
  for (const std::string value : {"-1", "nan", "inf", "1x", "", "fast"}) {
    expect_refused(run_program({"analyze", "-", "--soft-frequency=" + value}), begin,
                   "--soft-frequency");
  }
  expect_refused(run_program({"analyze", "-", "--pivot", "first"}), begin, "--pivot");
  expect_refused(run_program({"analyze", "-", "--residual", "2"}), begin, "--residual");
  // Control characters are shown as escapes.
  expect_refused(analyze_text("\"\\e[2J\": 1\n"), begin + "-: \\x1b[2J: ", "unknown key");
  expect_refused(run_program({"analyze", "\x1b[31m\x9b.yaml"}),
                 begin + "\\x1b[31m\\x9b.yaml: ", "cannot be opened");
  expect_refused(run_program({"analyze", "-", "--\x1b[31m"}), begin, "\\x1b[31m");
}

std::string repeat(const std::string& text, std::size_t times) {
  std::string result;
  for (std::size_t i = 0; i < times; ++i) result += text;
  return result;
}

TEST(AnalyzeErrors, CatchNestingThatWouldOverflowTheStack) {
  const std::string start = "dashpot analyze: -: ";
  expect_refused(analyze_text(repeat("[", 3'000'000)), start, "nested too deeply");
  expect_refused(analyze_text(repeat("{a: ", 100'000)), start, "nested too deeply");
  expect_refused(analyze_text(repeat("- ", 100'000)), start, "nested too deeply");
  expect_refused(analyze_text(repeat("? ", 100'000)), start, "nested too deeply");
  expect_refused(analyze_text("mass: " + repeat("[", 50) + "1" + repeat("]", 50)), start,
                 "nested too deeply");
}

TEST(AnalyzeErrors, CatchTextThatWouldFillTheMemory) {
  const std::string start = "dashpot analyze: -: ";
  expect_refused(analyze_text(std::string((64u << 20) + 1, ' ')), start, "larger than 64 MiB");
  expect_refused(analyze_text("mass: [" + repeat("1,", 4'000'001) + "]"), start, "4000000 values");
  // Each list holds the one before ten times.
  std::string bomb = "a: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n";
  for (int i = 1; i < 12; ++i) {
    const std::string number = std::to_string(i);
    const std::string last = "*a" + std::to_string(i - 1) + ", ";
    bomb.append("b").append(number).append(": &a").append(number);
    bomb.append(" [").append(repeat(last, 10)).append("]\n");
  }
  expect_refused(analyze_text(bomb), start, "4000000 values");
  // A long text, a thousand times.
  const std::string long_text = "a: &a " + std::string(1u << 20, 'x') + "\nb: [";
  expect_refused(analyze_text(long_text + repeat("*a, ", 1000) + "]"), start, "64 MiB of text");
  // Each list is kept for its name, within the others.
  std::string named = "mass: ";
  for (int i = 0; i < 10; ++i) named += "&a" + std::to_string(i) + " [";
  named += repeat("1,", 600'000) + repeat("]", 10);
  expect_refused(analyze_text(named), start, "4000000 values");
}

}  // namespace
}  // namespace dashpot::tests
