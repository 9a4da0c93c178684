#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/text/printable.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <new>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace dashpot::apps {
namespace {

constexpr int kFailure = 1;
constexpr int kBadInput = 2;
constexpr int kInterrupted = 130;

/// Says what went wrong, and returns `status`.
int report(const std::string& message, int status) {
  print_error(message);
  return status;
}

/// Edit distance: letters to change, add or leave out to make one word of the other.
std::size_t distance(const std::string& one, const std::string& other) {
  std::vector<std::size_t> row(other.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= one.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= other.size(); ++j) {
      const std::size_t replaced = diagonal + (std::tolower(one[i - 1]) != other[j - 1] ? 1 : 0);
      diagonal = std::exchange(row[j], std::min({replaced, row[j] + 1, row[j - 1] + 1}));
    }
  }
  return row.back();
}

/// The name that `word` may stand for: it begins with `word` or is few letters away; otherwise "".
std::string nearest(const std::string& word, const std::vector<std::string>& names) {
  std::string result;
  std::size_t least = 1 + word.size() / 3;
  for (const std::string& name : names) {
    const std::size_t letters =
        word.size() > 2 && name.starts_with(word) ? 0 : distance(word, name);
    if (letters > least || (letters == least && !result.empty())) continue;
    least = letters;
    result = name;
  }
  return result;
}

/// Says which subcommand `word` may mean, or names all of them; empty if it is one.
std::string meant_subcommand(const CLI::App& program, const std::string& word) {
  std::vector<std::string> names;
  std::string all;
  for (const CLI::App* command : program.get_subcommands([](const CLI::App*) { return true; })) {
    if (command->check_name(word)) return "";
    all += (all.empty() ? "" : ", ") + command->get_name();
    names.push_back(command->get_name());
    for (const std::string& alias : command->get_aliases()) names.push_back(alias);
  }
  if (word == "help" || word == "version") return "dashpot --" + word + " is meant";
  const std::string name = nearest(word, names);
  return name.empty() ? "there are " + all : "did you mean " + name + "?";
}

/// "; did you mean --json?" for the first unknown option among the words; otherwise "".
std::string meant_option(const CLI::App& command, int argc, char** argv) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  for (int i = 1; i < argc; ++i) {
    std::string word = argv[i];
    word.resize(std::min(word.size(), word.find('=')));
    if (!word.starts_with("--") || word.size() < 4) continue;
    if (std::find(names.begin(), names.end(), word) != names.end()) continue;
    const std::string name = nearest(word, names);
    return name.empty() ? "" : "; did you mean " + name + "?";
  }
  return "";
}

/// Help in lines of at most 100 columns.
class NarrowHelp : public CLI::Formatter {
 public:
  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    constexpr std::size_t kColumns = 100;
    std::istringstream lines(CLI::Formatter::make_option(option, is_positional));
    std::string result;
    for (std::string line; std::getline(lines, line); result += line + "\n") {
      while (line.size() > kColumns) {
        const std::size_t at = line.rfind(' ', kColumns);
        if (at <= get_column_width()) break;  // a long word
        result.append(line, 0, at).append("\n");
        line.replace(0, at + 1, get_column_width(), ' ');
      }
    }
    return result;
  }
};

int run(int argc, char** argv) {
  CLI::App program("Vibration analysis of second-order systems and impedance-controlled robots",
                   "dashpot");
  program.formatter(std::make_shared<NarrowHelp>());
  program.set_version_flag("--version", "dashpot " DASHPOT_VERSION);
  program.require_subcommand(0, 1);
  program.footer(kExitStatusHelp);
  add_analyze(program);
  add_inspect(program);
  add_monitor(program);
  add_export(program);
  add_design(program);
  add_audit(program);
  add_contact(program);
  add_identify(program);
  add_check_model(program);
  add_calibrate(program);
  add_run(program);
  add_tune(program);
  add_command(program);
  add_drive(program);
  add_fake_driver(program);

  if (argc > 1 && argv[1][0] != '-') {
    const std::string meant = meant_subcommand(program, argv[1]);
    if (!meant.empty()) {
      return report("dashpot: '" + std::string(argv[1]) + "' is not a subcommand; " + meant +
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
    const auto chosen = program.get_subcommands();
    // The value of an unknown option is taken for a CONFIG, which excludes others.
    const bool unknown = error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError) ||
                         error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExcludesError);
    const std::string meant =
        unknown ? meant_option(chosen.empty() ? program : *chosen.front(), argc, argv) : "";
    return report(name() + ": " + error.what() + meant + " (" + name() + " --help)", kBadInput);
  } catch (const InputError& error) {
    return report(name() + ": " + error.what(), kBadInput);
  } catch (const Interrupted& end) {
    return report(name() + ": interrupted: " + end.what(), kInterrupted);
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
  clear_progress();
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0) {
    throw std::runtime_error(std::string("cannot write to standard output: ") +
                             std::strerror(errno));
  }
}

void print_error(const std::string& message) {
  clear_progress();
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
