#pragma once
#include <dashpot/lcmtypes/sink.hpp>

#include <memory>
#include <string>

namespace dashpot::apps {

/// Writes a row for each state message: time since the first one (s), then joint positions,
/// velocities and torques, tip position (m), tip error, and the status of the tick. The first line
/// names the columns. Throws std::runtime_error that names the file and the reason.
std::unique_ptr<lcmtypes::Sink> make_csv_sink(const std::string& path);

}  // namespace dashpot::apps
