#pragma once
#include <dashpot/controller/audit.hpp>
#include <dashpot/controller/robot_description.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/text/yaml_document.hpp>

#include <nlohmann/json.hpp>
#include <string>

namespace dashpot::apps {

/// The arm of `dashpot tune`, with the changes that the page may make.
class TunedArm {
 public:
  /// The settings of a configuration, or null: default settings. Throws controller::InvalidModel.
  TunedArm(controller::RobotDescription robot, const controller::Settings* settings);

  const controller::RobotDescription& robot() const { return robot_; }
  /// Returns the model and the settings as given.
  const controller::RobotModel& model() const { return model_; }
  const controller::Settings& settings() const { return settings_; }
  /// Whether the torque limits are unknown: the settings have 100 N m, to calculate with.
  bool torque_guessed() const { return torque_guessed_; }

  /// Makes another arm of {"payload": {"mass", "center", "inertia"}, "reflected_inertia",
  /// "viscous_friction", "gear_stiffness", "gear_damping": n each, "position_sensor"}; a key that
  /// is missing or null keeps what the model has, and in gear_stiffness null is rigid. Throws
  /// InputError, and InvalidModel.
  TunedArm with(const nlohmann::ordered_json& parts) const;

 private:
  controller::RobotDescription robot_;
  controller::RobotModel model_;
  controller::Settings settings_;
  bool own_settings_, torque_guessed_;
};

/// Gains on an arm in a loop, in the form of the page.
struct TunedDesign {
  controller::AuditOptions stated;  ///< except damping by a ratio, which is in `stated.gains`
  controller::Settings settings;    ///< as the controller would have them

  /// Whether a damping is designed at each posture, by the controller's own design.
  bool designed() const;
};

/// Reads a design with the keys of docs/tuning-page.md; a missing key has its default. Throws
/// InputError for other keys, and for gains of a wrong size or type.
TunedDesign read_design(const TunedArm& arm, const nlohmann::ordered_json& design);

/// Returns the gains of settings in the form of the page, the inverse of read_design.
nlohmann::ordered_json design_json(const TunedArm& arm);

/// Returns the description of the arm without URDF, base and tip, with the keys of `robot` in a
/// configuration; a key that has its default is missing.
nlohmann::ordered_json robot_keys(const controller::RobotDescription& robot);

/// Returns JSON as YAML. Null, which differs, stands for a missing key, or in a list for none.
text::YamlNode yaml_of(const nlohmann::ordered_json& json);

}  // namespace dashpot::apps
