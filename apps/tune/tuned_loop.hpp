#pragma once
#include <dashpot/apps/tune/tuned_design.hpp>
#include <dashpot/controller/posture_loop.hpp>

#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// A design in force on an arm, at any posture.
class TunedLoop {
 public:
  /// Throws InputError or std::invalid_argument for gains that make no loop.
  TunedLoop(const TunedArm& arm, const TunedDesign& design);

  /// Returns all that the page shows of the loop at a posture; `place` is "tip/I" or "joint/I", see
  /// docs/tuning-page.md. Throws std::runtime_error if there is no spectrum.
  nlohmann::ordered_json at(const controller::JointVector& q, const std::string& place) const;

  /// Returns the numbers of postures of the sequence `seed`, by as many threads as there are
  /// processors, and those postures of which either number is the worst:
  /// {"count", "smallest_ratio", "gain_margin", "worst": {either: {"value", "q"}}}. After kLongest
  /// no posture is begun, so that there may be fewer than asked for.
  nlohmann::ordered_json workspace(std::uint64_t seed, std::int64_t first,
                                   std::int64_t count) const;

  static constexpr std::chrono::seconds kLongest{1};

 private:
  /// The loop at a posture, in the coordinates of analysis::Gears, and what it is made of.
  struct There {
    analysis::TaskImpedance parts;  ///< as if no gear gave way
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

/// Returns what `dashpot audit` would warn of, in the arm and in the gains: a list of {"key",
/// "reason"}.
nlohmann::ordered_json warnings(const TunedArm& arm, const TunedDesign& design);

/// Returns what the controller would refuse of a design at a posture, and under the key "q" what is
/// wrong with the posture: a list of {"key", "reason"}.
nlohmann::ordered_json refusals(const TunedArm& arm, const TunedDesign& design,
                                const controller::JointVector& q);

}  // namespace dashpot::apps
