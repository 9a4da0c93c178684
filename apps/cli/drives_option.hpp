#pragma once
#include <dashpot/controller/robot_model.hpp>

#include <string>

namespace dashpot::apps {

inline constexpr const char* kDrivesHelp =
    "Public figures of it, with source and doubt in dashpot inspect: panda, fr3, iiwa14, ur5e, ...";

/// Has the model take the published drives of this name, unless it is empty. Throws InputError with
/// the option --drives.
void take_drives(const std::string& name, controller::ModelOptions& model);

}  // namespace dashpot::apps
