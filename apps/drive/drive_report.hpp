#pragma once
#include <dashpot/apps/drive/drive_session.hpp>
#include <dashpot/apps/identify/identify_writer.hpp>
#include <dashpot/apps/loop/command_report.hpp>

#include <optional>
#include <string>

namespace dashpot::apps {

/// The summary of `dashpot drive`.
struct DriveReport {
  std::string config;  ///< the file
  lcmtypes::DriverKind driver = lcmtypes::DriverKind::kIiwa;
  bool dry_run = false;
  bool running = false;  ///< the conversation has begun
  std::string ended;     ///< why, in one line
  DriveRecord drive;
  LoopRecord loop;
  lcmtypes::PublisherCounters messages;
  std::optional<CommandReport> commands;     ///< if commands were enabled
  std::optional<IdentifyReport> identified;  ///< from the motion after an excitation
};

/// For people: lines, each ended by a newline.
std::string to_table(const DriveReport& report);
/// One JSON object. docs/drive.md lists the keys.
std::string to_json(const DriveReport& report);

}  // namespace dashpot::apps
