#pragma once
#include <dashpot/controller/input_error.hpp>

#include <CLI/App.hpp>
#include <string>

// One function for each subcommand: adds it, with its options, to the program. The subcommand runs
// when the command line is parsed. It throws InputError for bad input (exit status 2) and any other
// exception for what is not the user's fault (exit status 1), and prints only when all went well.

namespace dashpot::apps {

/// For the help text of the program and of each subcommand.
inline constexpr const char* kExitStatusHelp =
    "Exit status: 0 if all went well, 2 if the input or the command line is bad, 1 if anything "
    "else\n"
    "failed.";

using controller::InputError;

void add_analyze(CLI::App& program);
void add_inspect(CLI::App& program);
void add_monitor(CLI::App& program);
void add_design(CLI::App& program);
void add_run(CLI::App& program);

/// Writes all of `text` to standard output. Throws std::runtime_error if that fails.
void print(const std::string& text);

}  // namespace dashpot::apps
