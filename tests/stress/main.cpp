// Drives everything with hostile input and ill-conditioned systems: dashpot_stress PART, or `all`.
#include <dashpot/tests/stress/part.hpp>

#include <sys/wait.h>
#include <unistd.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using namespace dashpot::stress;  // NOLINT(google-build-using-namespace)

constexpr int kFailure = 1, kBadInput = 2;

/// Exit status of a part.
int run(const Part& part, const Request& request) try {
  const bool good = part.run(request);
  std::fflush(stdout);
  return good ? 0 : kFailure;
} catch (const std::exception& error) {
  std::fflush(stdout);
  std::fprintf(stderr, "dashpot_stress %s: %s\n", part.name, error.what());
  return kFailure;
}

/// A part with one of its amounts, in a process of its own.
class Job {
 public:
  Job(const Part& part, const Amount& amount, Request request) : part_(part), request_(request) {
    request_.kind = amount.kind;
    request_.count = request.brief ? amount.brief : amount.count;
  }

  void change_count(double count) { request_.count = count; }
  const Part& part() const { return part_; }
  bool started() const { return process_ > 0; }
  bool ended() const { return ended_; }
  bool good() const { return good_; }

  void start() {
    output_ = std::tmpfile();
    if (output_ == nullptr) throw std::runtime_error("no temporary file");
    std::fflush(stdout);
    process_ = fork();
    if (process_ < 0) throw std::runtime_error("no process");
    if (process_ > 0) return;
    dup2(fileno(output_), STDOUT_FILENO);
    dup2(fileno(output_), STDERR_FILENO);
    _exit(run(part_, request_));
  }

  /// Takes the exit status, if the process is this one.
  void end(pid_t process, int status) {
    if (process != process_) return;
    ended_ = true;
    good_ = WIFEXITED(status) && WEXITSTATUS(status) == 0;
    died_ = !WIFEXITED(status);
  }

  void print() {
    std::printf("== %s%s%s\n", part_.name, request_.kind.empty() ? "" : " ", request_.kind.c_str());
    std::rewind(output_);
    std::array<char, 4096> text{};
    for (std::size_t size = 0; (size = std::fread(text.data(), 1, text.size(), output_)) > 0;) {
      std::fwrite(text.data(), 1, size, stdout);
    }
    std::fclose(output_);
    if (!good_) std::printf("%s: %s\n", part_.name, died_ ? "DIED" : "FAILED");
    std::fflush(stdout);
  }

 private:
  const Part& part_;
  Request request_;
  std::FILE* output_ = nullptr;
  pid_t process_ = 0;
  bool ended_ = false, good_ = false, died_ = false;
};

/// Runs so many jobs at a time, and prints what they say in their order. Whether all are well.
bool run_side_by_side(std::vector<Job>& jobs, std::size_t at_a_time) {
  std::size_t started = 0, ended = 0, printed = 0;
  while (printed < jobs.size()) {
    while (started < jobs.size() && started - ended < at_a_time) jobs[started++].start();
    int status = 0;
    const pid_t process = wait(&status);
    if (process < 0) throw std::runtime_error("a process was lost");
    for (Job& job : jobs) job.end(process, status);
    ++ended;
    while (printed < jobs.size() && jobs[printed].ended()) jobs[printed++].print();
  }
  std::string failed;
  for (const Job& job : jobs) {
    const std::string name = std::string(" ") + job.part().name;
    if (!job.good() && failed.find(name) == std::string::npos) failed += name;
  }
  if (!failed.empty()) std::printf("Failed:%s\n", failed.c_str());
  return failed.empty();
}

/// What CLI11 fills in.
struct Options {
  Request request;
  std::size_t jobs = static_cast<std::size_t>(std::max(1L, sysconf(_SC_NPROCESSORS_ONLN)));
};

CLI::Validator above_zero() {
  return {[](const std::string& text) {
            char* end = nullptr;
            const double value = std::strtod(text.c_str(), &end);
            return *end == '\0' && value > 0 && value < 1e18 ? "" : text + " is no number above 0";
          },
          ""};
}

void add_seed(CLI::App& command, Request& request) {
  command.add_option("SEED", request.seed, "of the random numbers")
      ->capture_default_str()
      ->check(CLI::Validator(
          [](const std::string& text) {
            const bool digits = text.find_first_not_of("0123456789") == std::string::npos;
            return digits ? "" : text + " is no seed";
          },
          ""));
}

void add_short(CLI::App& command, Request& request) {
  command.add_flag("--short", request.brief, "do little, to see that it works");
}

std::string shown(double count) {
  std::string text = std::to_string(count);
  return text.substr(0, text.find_last_not_of('0')).substr(0, text.find('.'));
}

void add_part(CLI::App& program, const Part& part, Options& options, int& status) {
  std::string help = part.help;
  std::vector<std::string> kinds;
  for (const Amount& amount : part.amounts) {
    if (*amount.kind == '\0') continue;
    kinds.emplace_back(amount.kind);
    help += std::string("\n  ") + amount.kind + ": " + amount.what;
  }
  CLI::App& command = *program.add_subcommand(part.name, help);
  Request& request = options.request;
  if (!kinds.empty()) {
    command.add_option("KIND", request.kind, "of the above")
        ->required()
        ->check(CLI::IsMember(kinds));
  }
  if (*part.unit != '\0') {
    std::string counts;
    for (const Amount& amount : part.amounts) {
      counts += (counts.empty() ? "" : ", ") + shown(amount.count) +
                (*amount.kind == '\0' ? "" : std::string(" ") + amount.kind);
    }
    command.add_option(part.unit, request.count, "how many; without it " + counts)
        ->check(above_zero());
  }
  add_short(command, request);
  for (const std::string& option : part.more) {
    if (option == "SEED") add_seed(command, request);
    if (option == "TIMES") {
      command.add_option("TIMES", request.times, "as fast as real time")->check(above_zero());
    }
    if (option == "PLUGIN") {
      command.add_option("PLUGIN", request.plugins,
                         "[LABEL=]FILE, today's without it; the last "
                         "one has to keep what is promised");
    }
    if (option == "--verbose") command.add_flag(option, request.verbose, "show each case");
  }
  command.callback([&part, &request, &status] {
    for (const Amount& amount : part.amounts) {
      if (request.kind != amount.kind) continue;
      if (request.count == 0) request.count = request.brief ? amount.brief : amount.count;
      status = run(part, request);
      return;
    }
  });
}

void add_all(CLI::App& program, Options& options, int& status) {
  CLI::App& command = *program.add_subcommand(
      "all", "Run all parts but search and soak, and print what they say in this order");
  command.add_option("TICKS", options.request.count, "of the controller; without it ten million")
      ->check(above_zero());
  add_seed(command, options.request);
  add_short(command, options.request);
  command.add_option("--jobs", options.jobs, "how many run at a time; without it one a processor")
      ->check(above_zero());
  command.callback([&options, &status] {
    std::vector<Job> jobs;
    for (const Part& part : parts()) {
      if (part.place == 0) continue;
      for (const Amount& amount : part.amounts) {
        if (!amount.of_all) continue;
        jobs.emplace_back(part, amount, options.request);
        const bool ticks = options.request.count > 0 && part.unit == std::string("TICKS");
        if (ticks) jobs.back().change_count(options.request.count);
      }
    }
    status = run_side_by_side(jobs, options.jobs) ? 0 : kFailure;
  });
}

}  // namespace

int main(int argc, char** argv) {
  std::sort(parts().begin(), parts().end(), [](const Part& a, const Part& b) {
    return (a.place == 0 ? 1000 : a.place) < (b.place == 0 ? 1000 : b.place);
  });
  CLI::App program("Drive everything with hostile input and ill-conditioned systems",
                   "dashpot_stress");
  program.require_subcommand(1);
  program.footer("Exit status: 0 all is well, 1 something is not, 2 bad arguments.");
  Options options;
  int status = 0;
  for (const Part& part : parts()) add_part(program, part, options, status);
  add_all(program, options, status);
  try {
    program.parse(argc, argv);
    return status;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return program.exit(error);  // --help
    const auto chosen = program.get_subcommands();
    const std::string name =
        "dashpot_stress" + (chosen.empty() ? "" : " " + chosen.front()->get_name());
    std::fprintf(stderr, "%s: %s (%s --help)\n", name.c_str(), error.what(), name.c_str());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "dashpot_stress: %s\n", error.what());
    return kFailure;
  }
  return kBadInput;
}
