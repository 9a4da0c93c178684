#pragma once
#include <dashpot/apps/check_model/check_model_report.hpp>
#include <dashpot/controller/config.hpp>

#include <string>

namespace dashpot::apps {

/// Writes the configuration in the file `from` to the file `to`, with goals for its joints that
/// determine what the records do not. They lie where the records were, or within 0.3 rad of that,
/// and within the limits of position; the motion is the slowest of six with which the calibrated
/// arm, simulated under its controller, tells all, and hardly a limit of the controller acts. Notes
/// what stays undetermined even so. Throws InputError if nothing lacks, or no motion is slow
/// enough.
void suggest_motion(const std::string& from, const std::string& to,
                    const controller::Config& config, CheckModelReport& report);

}  // namespace dashpot::apps
