#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/text/printable.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <new>
#include <stdexcept>
#include <string>

namespace dashpot::apps {
namespace {

constexpr int kFailure = 1;
constexpr int kBadInput = 2;

/// Says what went wrong, and returns `status`.
int report(const std::string& message, int status) {
  print_error(message);
  return status;
}

/// Says which subcommand `word` may mean, the one with the longest common beginning, or names all
/// of them; empty if it is one.
std::string nearest_subcommand(const CLI::App& program, const std::string& word) {
  std::string nearest, all;
  std::size_t longest = 1;  // a single letter says nothing
  for (const CLI::App* command : program.get_subcommands([](const CLI::App*) { return true; })) {
    const std::string name = command->get_name();
    if (command->check_name(word)) return "";
    all += (all.empty() ? "" : ", ") + name;
    const auto end = std::mismatch(name.begin(), name.end(), word.begin(), word.end()).first;
    const auto common = static_cast<std::size_t>(end - name.begin());
    if (common <= longest) continue;
    longest = common;
    nearest = name;
  }
  return nearest.empty() ? "there are " + all : "did you mean " + nearest + "?";
}

int run(int argc, char** argv) {
  CLI::App program("Vibration analysis of second-order systems and impedance-controlled robots",
                   "dashpot");
  program.set_version_flag("--version", "dashpot " DASHPOT_VERSION);
  program.require_subcommand(0, 1);
  program.footer(kExitStatusHelp);
  add_analyze(program);
  add_inspect(program);
  add_monitor(program);
  add_export(program);
  add_design(program);
  add_audit(program);
  add_identify(program);
  add_check_model(program);
  add_run(program);
  add_tune(program);
  add_command(program);
  add_drive(program);
  add_fake_driver(program);

  if (argc > 1 && argv[1][0] != '-') {
    const std::string meant = nearest_subcommand(program, argv[1]);
    if (!meant.empty()) {
      return report("dashpot: '" + std::string(argv[1]) + "' is no subcommand; " + meant +
                        " (dashpot --help)",
                    kBadInput);
    }
  }
  const auto name = [&program] {
    const auto chosen = program.get_subcommands();
    return "dashpot" + (chosen.empty() ? "" : " " + chosen.front()->get_name());
  };
  try {
    program.parse(argc, argv);
    if (!program.get_subcommands().empty()) return 0;
    return report("dashpot: a subcommand is needed (dashpot --help)", kBadInput);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return program.exit(error);  // --help, --version
    return report(name() + ": " + error.what() + " (" + name() + " --help)", kBadInput);
  } catch (const InputError& error) {
    return report(name() + ": " + error.what(), kBadInput);
  } catch (const std::bad_alloc&) {
    return report(name() + ": out of memory", kFailure);
  } catch (const std::exception& error) {
    return report(name() + ": " + error.what(), kFailure);
  }
}

}  // namespace

void print(const std::string& text) {
  print_styled(text::printable(text, "\n"));
}

void print_styled(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0) {
    throw std::runtime_error("cannot write to standard output");
  }
}

void print_error(const std::string& message) {
  std::fprintf(stderr, "%s\n", controller::one_line(message).c_str());
}

}  // namespace dashpot::apps

int main(int argc, char** argv) {
  try {
    return dashpot::apps::run(argc, argv);
  } catch (...) {
    std::fputs("dashpot: out of memory\n", stderr);
    return 1;
  }
}
