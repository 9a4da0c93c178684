#pragma once
// The part of a configuration file under the key `gains`.

#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/yaml/setting_reader.hpp>

namespace dashpot::controller {

/// Whether stiffness and damping may be given one without the other.
enum class GainPairs { kTogether, kEither };

/// Sets those of `gains` that stand under the key `gains` of `parent`. Whether the matrices are
/// possible is not checked. Throws InputError.
void read_gains(const YamlMapping& parent, const RobotModel& model, GainPairs pairs, Gains& gains);

/// Returns the gains under the key `gains` of `parent`, one without the other. What is missing is
/// zero. Throws InputError.
Gains read_gains(const YamlMapping& parent, const RobotModel& model);

}  // namespace dashpot::controller
