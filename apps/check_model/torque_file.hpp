#pragma once
#include <dashpot/apps/records/motion_file.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/identification/check_model.hpp>

#include <string>
#include <vector>

namespace dashpot::apps {

/// A record of positions and torques, and which columns they are.
struct TorqueFile {
  identification::TorqueRecord record;
  std::vector<std::string> positions, torques;  ///< names, in the model's order
  std::vector<std::string> notes;
};

/// Reads a CSV file or an LCM log (see read_motion_file, read_driver_log) of the motion of a
/// model's joints. Units or names identify the columns; joint names or numbers assign them to
/// joints. `positions` and `torques` name the columns, "a,b,...", in the model's order; empty: the
/// columns found. `hints` are for files without a line of names or a column of time. Throws
/// InputError, with the file, the column and the value, for columns that are not found, and for
/// positions or velocities that must be in degrees.
TorqueFile read_torque_file(const std::string& path, const controller::RobotModel& model,
                            const std::string& positions, const std::string& torques,
                            const FileHints& hints = {});

}  // namespace dashpot::apps
