#pragma once
#include <dashpot/apps/identify/identify_writer.hpp>
#include <dashpot/controller/robot_types.hpp>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// The excitation that a loop added to the tip's wrench while it made a log.
struct LogExcitation {
  bool chirp = false;
  std::function<controller::Vector6(double)> wrench;  ///< at a time from the first tick, s
};

/// The options of `dashpot identify`.
struct IdentifyCommand {
  std::vector<std::string> files;
  std::string channels, inputs, against, calibrate, output, plot;
  FileHints hints = {};
  std::optional<double> from, to;
  int order = 0;
  bool ambient = false;
  bool excited = false;
  bool large_motion = false;  ///< large motion is treated as linear
  bool json = false;
  std::optional<LogExcitation> excitation = {};
  /// Called with the share that is done; true ends the search with the results so far.
  std::function<bool(double)> stop = {};
};

/// Throws controller::InputError.
IdentifyReport identify_files(const IdentifyCommand& command);

/// The modes in an LCM log of an excited arm, beside the modes that a configuration predicts. If it
/// fails, a note in the report says why.
IdentifyReport identify_log(const std::string& log, const std::string& config,
                            const LogExcitation& excitation);

}  // namespace dashpot::apps
