#pragma once
#include <dashpot/controller/audit.hpp>
#include <dashpot/controller/contact_audit.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/robot_description.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/text/yaml_document.hpp>

#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

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

/// A design on an arm, at any posture.
class TunedLoop {
 public:
  /// Throws InputError or std::invalid_argument for impossible gains.
  TunedLoop(const TunedArm& arm, const TunedDesign& design);

  /// Returns all that the page shows of the loop at a posture; `place` is "tip/I" or "joint/I", see
  /// docs/tuning-page.md. Throws std::runtime_error if there is no spectrum.
  nlohmann::ordered_json at(const controller::JointVector& q, const std::string& place) const;

  /// Returns the effect of touching a spring of this stiffness (N/m), in the direction with the
  /// least limit: {"stiffness", "direction", "damping_ratio", "natural_frequency", "limit"}; 1e9:
  /// no limit. Null without a period, and if the tip cannot move. Sets `least` where it is empty.
  nlohmann::ordered_json contact(const controller::JointVector& q, double stiffness,
                                 std::optional<controller::ContactAt>& least) const;

  /// Returns the numbers of postures of the sequence `seed`, computed by one thread for each
  /// processor, and the postures at which either number is the worst:
  /// {"count", "smallest_ratio", "gain_margin", "worst": {either: {"value", "q"}}}. After kLongest
  /// no posture is begun, so there may be fewer than asked for.
  nlohmann::ordered_json workspace(std::uint64_t seed, std::int64_t first,
                                   std::int64_t count) const;

  static constexpr std::chrono::seconds kLongest{1};

 private:
  /// The loop at a posture, in the coordinates of analysis::Gears, and its parts.
  struct There {
    analysis::TaskImpedance parts;  ///< for rigid gears
    analysis::System<> system;
    analysis::Spectrum<> spectrum;
    analysis::SampledLoop sampled;
    std::optional<analysis::DampingLevel> level;  ///< of a ratio
  };
  There there(const controller::JointVector& q) const;
  controller::PostureNumbers numbers(const controller::JointVector& q,
                                     controller::PostureLoop* loop) const;
  controller::PostureNumbers numbers(const There& loop) const;
  controller::LoopAt designed(const controller::JointVector& q,
                              controller::PostureLoop& loop) const {
    return loop.at(q, design_.settings.initial.gains, design_.stated.mode);
  }

  const TunedArm& arm_;
  const TunedDesign& design_;
  controller::Audit audit_;
  analysis::Gears gears_;
};

/// Returns the warnings of `dashpot audit` about the arm and the gains: a list of {"key",
/// "reason"}.
nlohmann::ordered_json warnings(const TunedArm& arm, const TunedDesign& design);

/// Returns the controller's refusals of a design at a posture, and faults of the posture under the
/// key "q": a list of {"key", "reason"}.
nlohmann::ordered_json refusals(const TunedArm& arm, const TunedDesign& design,
                                const controller::JointVector& q);

}  // namespace dashpot::apps
