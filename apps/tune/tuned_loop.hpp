#pragma once
#include <dashpot/apps/tune/tuned_design.hpp>
#include <dashpot/controller/contact_audit.hpp>
#include <dashpot/controller/posture_loop.hpp>

#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

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
