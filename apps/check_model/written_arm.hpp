#pragma once
#include <dashpot/apps/check_model/check_model_report.hpp>
#include <dashpot/controller/config.hpp>

#include <optional>
#include <string>

namespace dashpot::apps {

/// A figure of each joint.
enum class ArmFigure : std::uint8_t { kReflectedInertia, kViscousFriction, kCoulombFriction };

/// Returns the determined figures, and the configuration's for other joints; nothing below zero.
controller::JointVector determined(const controller::Config& config,
                                   const identification::ModelCheck& check, ArmFigure figure);

/// Returns the payload's mass and center, if the records determine them.
std::optional<controller::Payload> determined_payload(const identification::ModelCheck& check);

/// Writes the configuration in the file `from` to the file `to` with what was determined, and notes
/// what was not kept. Throws InputError if the records show that something else is wrong.
void write_config(const std::string& from, const std::string& to, const controller::Config& config,
                  CheckModelReport& report);

/// Writes rotors and friction as a drives file (see controller::find_drives). Throws likewise.
void write_drives(const std::string& to, const controller::Config& config,
                  const CheckModelReport& report);

}  // namespace dashpot::apps
