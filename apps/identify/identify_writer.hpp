#pragma once
#include <dashpot/apps/records/motion_file.hpp>
#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/motion_verdict.hpp>

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// A mode that a configuration predicts for the loop as it runs: sampled, delayed and filtered.
struct PredictedMode {
  double natural_frequency = 0;  ///< rad/s
  double damping_ratio = 0;
  Eigen::VectorXcd shape;  ///< joints
  /// Index of the measured mode in Identification::modes; -1: none.
  int measured = -1;
  double likeness = 0;  ///< of the shapes, modal assurance criterion, 0 to 1
};

/// A free decay, or a stretch of ambient motion, in one of the files.
struct PartReport {
  std::string file;
  double from = 0, to = 0;  ///< s, of the file's time
  int posture = -1;         ///< number of PostureReport; -1: unused
  std::string reason;       ///< why it is unused
};

/// The results of the parts at one posture.
struct PostureReport {
  Eigen::VectorXd rest;  ///< means of the channels where decays end, or of all ambient motion
  int parts = 0;
  identification::Identification found;
  std::vector<PredictedMode> predicted;
};

/// The differences between an arm and its model.
struct ModelCorrection {
  double payload = 0;                                 ///< mass added to the payload, kg
  Eigen::Vector3d center = Eigen::Vector3d::Zero();   ///< by which its centre moves, m
  Eigen::Vector3d inertia = Eigen::Vector3d::Zero();  ///< added about its centre, diagonal, kg m^2
  Eigen::VectorXd reflected_inertia;                  ///< added, n, kg m^2; empty: none
  Eigen::VectorXd friction;                           ///< viscous, added, n, N m s/rad; empty: none
  Eigen::VectorXd gear_stiffness;                     ///< added, n, N m/rad; empty: none
  double delay = 0;                                   ///< added, ticks
};

/// A parameter that was calibrated.
struct CalibratedParameter {
  std::string name, unit;
  double before = 0, value = 0, std = 0;
  bool determined = false;  ///< by the records
};

struct Calibration {
  std::vector<CalibratedParameter> parameters;
  ModelCorrection correction;
  double misfit_before = 0, misfit = 0;  ///< root mean square of the differences, in deviations
  int numbers = 0;                       ///< frequencies and ratios that were explained
  bool consistent = false;               ///< the misfit is one that the deviations explain
  std::vector<std::string> warnings;     ///< parameters that the records cannot separate
};

struct IdentifyReport {
  std::vector<MotionChannel> channels;  ///< channels used
  /// Kind of motion of the records; records of another kind are left out.
  identification::MotionKind kind = identification::MotionKind::kNothing;
  std::string advice;  ///< if no modes can be identified: why, and what would help
  std::vector<PartReport> parts;
  std::vector<PostureReport> postures;  ///< by falling number of parts
  std::vector<std::string> notes;
  bool against = false;
  std::optional<Calibration> calibration;
};

std::string identify_table(const IdentifyReport& report);
nlohmann::ordered_json identify_json(const IdentifyReport& report);

}  // namespace dashpot::apps
