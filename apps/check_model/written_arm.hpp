#pragma once
#include <dashpot/apps/check_model/check_model_report.hpp>
#include <dashpot/apps/check_model/config_change.hpp>
#include <dashpot/controller/config.hpp>

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// A figure of each joint.
enum class ArmFigure : std::uint8_t { kReflectedInertia, kViscousFriction, kCoulombFriction };
inline constexpr std::array kArmFigures = {
    ArmFigure::kReflectedInertia, ArmFigure::kViscousFriction, ArmFigure::kCoulombFriction};

/// Returns what the records determine of it at joint j, or contradict the configuration by, not
/// below zero; nothing otherwise.
std::optional<double> found_figure(const controller::Config& config,
                                   const identification::ModelCheck& check, ArmFigure figure,
                                   std::size_t j);

/// Returns the figure of all joints: what was found, or else what the configuration has.
controller::JointVector determined(const controller::Config& config,
                                   const identification::ModelCheck& check, ArmFigure figure);

/// Returns a sentence for each rotor of the configuration that is kept though the records show
/// none.
std::vector<std::string> kept_rotors(const controller::Config& config,
                                     const CheckModelReport& report);

/// Returns the payload's mass and center, if the records determine them.
std::optional<controller::Payload> determined_payload(const identification::ModelCheck& check);

/// Returns date, records and deviations, lines of a comment with "# " in front.
std::string origin(const controller::Config& config, const CheckModelReport& report);

/// Throws InputError where the records say that something else is wrong.
void refuse_doubtful(const std::string& option, const identification::ModelCheck& check);
void write_text(const std::string& option, const std::string& path, const std::string& text);

/// Returns the paths of a configuration in the file `from_file` as the file `to_file` needs them.
std::vector<ConfigChange> path_changes(const std::string& from_file, const std::string& to_file,
                                       const controller::Config& config);

/// Writes the configuration in the file `from` to the file `to` with what was determined, and notes
/// what was not kept. Throws InputError if the records show that something else is wrong.
void write_config(const std::string& from, const std::string& to, const controller::Config& config,
                  CheckModelReport& report);

/// Writes rotors and friction as a drives file (see controller::find_drives). Throws likewise.
void write_drives(const std::string& to, const controller::Config& config,
                  const CheckModelReport& report);

}  // namespace dashpot::apps
