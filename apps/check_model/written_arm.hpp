#pragma once
#include <dashpot/apps/check_model/check_model_report.hpp>
#include <dashpot/controller/config.hpp>

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

using controller::Config;
using controller::Joint;
using controller::JointVector;
using identification::Estimate;
using identification::JointCheck;
using identification::ModelCheck;

/// A key of a YAML file, from the root on, and its new value as YAML.
struct ConfigChange {
  std::vector<std::string> path;
  std::string value;
};

/// Returns "[a, b, ...]" with five digits.
std::string yaml_list(const Eigen::VectorXd& values);

/// Returns the text of a YAML mapping with some keys changed or added, and everything else,
/// including comments, as it was. If the text cannot be changed so (anchors, block sequences), it
/// is written again without comments, and `kept` is false.
std::string changed_config(const std::string& text, const std::vector<ConfigChange>& changes,
                           bool& kept);

/// A figure of each joint.
enum class ArmFigure : std::uint8_t { kReflectedInertia, kViscousFriction, kCoulombFriction };
inline constexpr std::array kArmFigures = {
    ArmFigure::kReflectedInertia, ArmFigure::kViscousFriction, ArmFigure::kCoulombFriction};

/// Returns what the records determine of it at joint j, or contradict the configuration by, not
/// below zero; nothing otherwise.
std::optional<double> found_figure(const Config& config, const ModelCheck& check, ArmFigure figure,
                                   std::size_t j);

/// Returns the figure of all joints: what was found, or else what the configuration has.
JointVector determined(const Config& config, const ModelCheck& check, ArmFigure figure);

/// Returns a sentence for each rotor of the configuration that is kept though the records show
/// none.
std::vector<std::string> kept_rotors(const Config& config, const CheckModelReport& report);

/// Returns the payload's mass and center, if the records determine them.
std::optional<controller::Payload> determined_payload(const ModelCheck& check);

/// Returns date, records and deviations, lines of a comment with "# " in front.
std::string origin(const Config& config, const CheckModelReport& report);

/// Throws InputError where the records say that something else is wrong.
void refuse_doubtful(const std::string& option, const ModelCheck& check);
void write_text(const std::string& option, const std::string& path, const std::string& text);

/// Returns the paths of a configuration in the file `from_file` as the file `to_file` needs them.
std::vector<ConfigChange> path_changes(const std::string& from_file, const std::string& to_file,
                                       const Config& config);

/// Writes the configuration in the file `from` to the file `to` with what was determined, and notes
/// what was not kept. Throws InputError if the records show that something else is wrong.
void write_config(const std::string& from, const std::string& to, const Config& config,
                  CheckModelReport& report);

/// Writes rotors and friction as a drives file (see controller::find_drives). Throws likewise.
void write_drives(const std::string& to, const Config& config, const CheckModelReport& report);

}  // namespace dashpot::apps
