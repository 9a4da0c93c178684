#pragma once
#include <dashpot/apps/check_model/check_model_report.hpp>
#include <dashpot/controller/config.hpp>

#include <string>

namespace dashpot::apps {

/// True if the name is one of a URDF or MJCF file: ends with .urdf or .xml.
bool is_model_file(const std::string& name);

/// Writes a robot description with the rotors and friction of joints that were found, and a comment
/// with date, records and deviations; all else stays as it was. To a .urdf goes the URDF of the
/// configuration, with the attributes damping, friction and reflected_inertia of dynamics; to a
/// .xml the MuJoCo model `mjcf`, with armature, damping and frictionloss of joints of the same
/// names, or of names that are the end of the other. Throws InputError.
void write_model(const std::string& to, const std::string& mjcf, const controller::Config& config,
                 const CheckModelReport& report);

}  // namespace dashpot::apps
