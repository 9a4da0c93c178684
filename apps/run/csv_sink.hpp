#pragma once
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/lcmtypes/sink.hpp>

#include <memory>
#include <string>

namespace dashpot::apps {

/// Writes a row for each state message: time since the first one (s), then joint positions,
/// velocities and torques, tip position (m), tip error, the status of the tick, and the force of a
/// contact if contact messages come. The first line names the columns with their units; `model`
/// gives the units of the joints. Throws InputError that names the file and the reason.
std::unique_ptr<lcmtypes::Sink> make_csv_sink(const std::string& path,
                                              const controller::RobotModel& model);

}  // namespace dashpot::apps
