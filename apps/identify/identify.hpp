#pragma once
#include <dashpot/apps/identify/identify_writer.hpp>
#include <dashpot/controller/robot_types.hpp>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// What a loop was told to add to the tip's wrench while it made a log.
struct LogExcitation {
  bool chirp = false;
  std::function<controller::Vector6(double)> wrench;  ///< at a time from the first tick, s
};

/// What `dashpot identify` is asked for.
struct IdentifyCommand {
  std::vector<std::string> files;
  std::string channels, inputs, against, calibrate, output, plot;
  FileHints hints = {};
  std::optional<double> from, to;
  int order = 0;
  bool ambient = false;
  bool excited = false;
  bool large_motion = false;  ///< is taken for linear
  bool json = false;
  std::optional<LogExcitation> excitation = {};
  /// Told the share that is done; true ends the search with what there is.
  std::function<bool(double)> stop = {};
};

/// Throws controller::InputError.
IdentifyReport identify_files(const IdentifyCommand& command);

/// The modes that an LCM log shows of an arm that was excited, beside those that a configuration
/// predicts. Where that fails, a note in the report says why.
IdentifyReport identify_log(const std::string& log, const std::string& config,
                            const LogExcitation& excitation);

}  // namespace dashpot::apps
