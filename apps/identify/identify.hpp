#pragma once
#include <dashpot/apps/identify/identify_writer.hpp>

#include <string>

namespace dashpot::apps {

/// The modes of the free decays in an LCM log, beside those that a configuration predicts. Where
/// that fails, a note in the report says why.
IdentifyReport identify_log(const std::string& log, const std::string& config);

}  // namespace dashpot::apps
