#pragma once
#include <dashpot/controller/input_error.hpp>

#include <CLI/App.hpp>
#include <string>

// One function for each subcommand: adds it, with its options, to the program. The subcommand runs
// when the command line is parsed. It throws InputError for bad input (exit status 2) and another
// exception for any other failure (exit status 1), and prints only if all went well.

namespace dashpot::apps {

/// For the help text of the program and of each subcommand.
inline constexpr const char* kExitStatusHelp =
    "Exit status: 0 if all went well, 2 if the input or the command line is bad, 130 if Ctrl-C "
    "ended\n"
    "it early, 1 if anything else failed, or a loop ended with a latched fault.";

/// For the help text of subcommands that take physical quantities.
inline constexpr const char* kUnitsHelp =
    "Numbers are in SI units; a number with another unit is converted: '30 deg', 1ms, 20Nm/rad.\n";

using controller::InputError;

void add_analyze(CLI::App& program);
void add_inspect(CLI::App& program);
void add_monitor(CLI::App& program);
void add_export(CLI::App& program);
void add_design(CLI::App& program);
void add_audit(CLI::App& program);
void add_contact(CLI::App& program);
void add_identify(CLI::App& program);
void add_check_model(CLI::App& program);
void add_calibrate(CLI::App& program);
void add_run(CLI::App& program);
void add_tune(CLI::App& program);
void add_command(CLI::App& program);
void add_drive(CLI::App& program);
void add_fake_driver(CLI::App& program);

/// Writes all of `text` to standard output, with control characters as escapes (files and messages
/// hold names that others chose). Throws std::runtime_error if that fails.
void print(const std::string& text);

/// Prints text with the program's own escape sequences: text::printable() must have been applied to
/// all of `text` that comes from elsewhere.
void print_styled(const std::string& text);

/// Writes one line to standard error, printable whatever is in `message`.
void print_error(const std::string& message);

}  // namespace dashpot::apps
