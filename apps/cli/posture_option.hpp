#pragma once
#include <dashpot/controller/robot_model.hpp>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// The options of a posture.
struct PostureOption {
  std::string q;                ///< empty: the default
  bool outside_limits = false;  ///< accept a posture outside the position limits, with a warning
  double refused = 1e-3;        ///< rad or m outside the limits from which on it is refused
  bool has_to_hold = false;     ///< refuse a posture that the arm cannot hold, or warn

  /// Adds --q and --outside-limits.
  void add(CLI::App& command);
  /// Returns --q; `usual`, or without entries controller::default_posture, where it is missing.
  /// Throws InputError.
  controller::JointVector read(const controller::RobotModel& model,
                               const controller::JointVector& usual = {}) const;
  /// Refuses a posture outside the position limits, or warns of it; `option` names it. Throws
  /// InputError.
  void check(const std::string& option, const controller::RobotModel& model,
             const controller::JointVector& posture) const;
};

/// The options of many postures: one of three ways, or none.
struct PosturesOption {
  std::string file;        ///< of --postures
  std::string log;         ///< an LCM log
  double log_step = 0.01;  ///< rad or m, between two postures of the log
  std::int64_t samples = 0;
  std::uint64_t seed = 1;
  std::optional<double> spread;  ///< rad or m, of the samples from --q

  /// Adds --postures, --log, --log-step, --samples, --seed and --spread.
  void add(CLI::App& command);
  bool any() const { return !file.empty() || !log.empty() || samples > 0; }
  /// Throws InputError for options that do not go together.
  void check() const;
  /// Returns the postures of the file or of the log; none for samples. Throws InputError.
  std::vector<controller::JointVector> listed(const PostureOption& one,
                                              const controller::RobotModel& model) const;
  /// The range of the samples around q: position limits, within the spread. Throws InputError.
  void range(const controller::RobotModel& model, const controller::JointVector& q,
             controller::JointVector& lower, controller::JointVector& upper) const;
};

}  // namespace dashpot::apps
