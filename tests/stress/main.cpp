// Drives everything with hostile input and ill-conditioned systems: dashpot_stress PART, or `all`.
#include <dashpot/tests/stress/part.hpp>

#include <sys/wait.h>
#include <unistd.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
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
struct Job {
  const Part* part;
  Request request;
  std::FILE* output = nullptr;
  pid_t process = 0;
  bool ended = false;
  int status = 0;  ///< of wait()
};

void start(Job& job) {
  job.output = std::tmpfile();
  std::fflush(stdout);
  job.process = job.output == nullptr ? -1 : fork();
  if (job.process < 0) throw std::runtime_error("no process or no temporary file");
  if (job.process > 0) return;
  dup2(fileno(job.output), STDOUT_FILENO);
  dup2(fileno(job.output), STDERR_FILENO);
  _exit(run(*job.part, job.request));
}

void print(const Job& job) {
  std::printf("== %s %s\n", job.part->name, job.request.kind.c_str());
  std::rewind(job.output);
  for (int c = 0; (c = std::fgetc(job.output)) != EOF;) std::putchar(c);
  std::fclose(job.output);
  if (job.status != 0) std::printf("FAILED%s\n", WIFEXITED(job.status) ? "" : " by a signal");
  std::fflush(stdout);
}

/// Runs so many jobs at a time, and prints what they say in their order. Whether all are well.
bool run_side_by_side(std::vector<Job>& jobs, std::size_t at_a_time) {
  std::size_t started = 0, ended = 0, printed = 0;
  std::string failed;
  while (printed < jobs.size()) {
    while (started < jobs.size() && started - ended < at_a_time) start(jobs[started++]);
    int status = 0;
    const pid_t process = wait(&status);
    if (process < 0) throw std::runtime_error("a process was lost");
    for (Job& job : jobs) {
      if (job.process == process) job.ended = true, job.status = status, ++ended;
    }
    for (; printed < jobs.size() && jobs[printed].ended; ++printed) {
      const Job& job = jobs[printed];
      print(job);
      if (job.status != 0) failed += " " + (job.part->name + (" " + job.request.kind));
    }
  }
  if (!failed.empty()) std::printf("Failed:%s\n", failed.c_str());
  return failed.empty();
}

CLI::Validator above_zero() {
  return {[](const std::string& text) {
            char* end = nullptr;
            const double value = std::strtod(text.c_str(), &end);
            return *end == '\0' && value > 0 && value < 1e18 ? ""
                                                             : text + " is not a number above 0";
          },
          ""};
}

/// Adds the options of each part and of `all`.
void add_options(CLI::App& command, const std::vector<std::string>& more, Request& request) {
  command.add_flag("--short", request.brief, "do little, to see that it works");
  for (const std::string& option : more) {
    if (option == "SEED") {
      command.add_option(option, request.seed, "of the random numbers, or 1")->check(above_zero());
    }
    if (option == "TIMES") {
      command.add_option(option, request.times, "as fast as real time")->check(above_zero());
    }
    if (option == "PLUGIN") {
      command.add_option(option, request.plugins, "[LABEL=]FILE of several, or today's");
    }
    if (option == "--verbose") command.add_flag(option, request.verbose, "show each case");
  }
}

void add_part(CLI::App& program, const Part& part, Request& request, int& status) {
  std::string help = part.help;
  std::vector<std::string> kinds;
  for (const Amount& amount : part.amounts) {
    if (*amount.kind == '\0') continue;
    kinds.emplace_back(amount.kind);
    help += std::string("\n  ") + amount.kind + ": " + amount.what + "; " +
            std::to_string(std::lround(amount.count)) + " without " + part.unit;
  }
  CLI::App& command = *program.add_subcommand(part.name, help);
  if (!kinds.empty()) {
    command.add_option("KIND", request.kind, "see above")->required()->check(CLI::IsMember(kinds));
  }
  if (*part.unit != '\0') {
    const std::string count = std::to_string(std::lround(part.amounts.front().count));
    command.add_option(part.unit, request.count, kinds.empty() ? "or " + count : "how many")
        ->check(above_zero());
  }
  add_options(command, part.more, request);
  command.callback([&part, &request, &status] {
    for (const Amount& amount : part.amounts) {
      if (request.kind != amount.kind) continue;
      if (request.count == 0) request.count = request.brief ? amount.brief : amount.count;
      status = run(part, request);
    }
  });
}

void add_all(CLI::App& program, Request& request, std::size_t& at_a_time, int& status) {
  CLI::App& command = *program.add_subcommand(
      "all", "Run all parts but soak, and print what they say in this order");
  command.add_option("TICKS", request.count, "of the controller")->check(above_zero());
  add_options(command, {"SEED"}, request);
  command.add_option("--jobs", at_a_time, "at a time, or as many as there are processors")
      ->check(above_zero());
  command.callback([&request, &at_a_time, &status] {
    std::vector<Job> jobs;
    for (const Part& part : parts()) {
      for (const Amount& amount : part.amounts) {
        if (part.place == 0 || !amount.of_all) continue;
        Job& job = jobs.emplace_back(Job{&part, request});
        job.request.kind = amount.kind;
        if (request.count > 0 && part.unit == std::string("TICKS")) continue;
        job.request.count = request.brief ? amount.brief : amount.count;
      }
    }
    status = run_side_by_side(jobs, at_a_time) ? 0 : kFailure;
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
  Request request;
  auto at_a_time = static_cast<std::size_t>(std::max(1L, sysconf(_SC_NPROCESSORS_ONLN)));
  int status = 0;
  for (const Part& part : parts()) add_part(program, part, request, status);
  add_all(program, request, at_a_time, status);
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
