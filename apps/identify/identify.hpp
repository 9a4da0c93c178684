#pragma once
#include <dashpot/apps/records/motion_file.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/robot_types.hpp>
#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/motion_record.hpp>
#include <dashpot/identification/motion_verdict.hpp>

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

using controller::InputError;
using controller::JointVector;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using identification::MeasuredMode;
using identification::MotionKind;
using identification::MotionRecord;

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
  VectorXd rest;  ///< means of the channels where decays end, or of all ambient motion
  int parts = 0;
  identification::Identification found;
  std::vector<PredictedMode> predicted;
};

/// The differences between an arm and its model.
struct ModelCorrection {
  double payload = 0;                                 ///< mass added to the payload, kg
  Eigen::Vector3d center = Eigen::Vector3d::Zero();   ///< by which its centre moves, m
  Eigen::Vector3d inertia = Eigen::Vector3d::Zero();  ///< added about its centre, diagonal, kg m^2
  VectorXd reflected_inertia;                         ///< added, n, kg m^2; empty: none
  VectorXd friction;                                  ///< viscous, added, n, N m s/rad; empty: none
  VectorXd gear_stiffness;                            ///< added, n, N m/rad; empty: none
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
  MotionKind kind = MotionKind::kNothing;
  std::string advice;  ///< if no modes can be identified: why, and what would help
  std::vector<PartReport> parts;
  std::vector<PostureReport> postures;  ///< by falling number of parts
  std::vector<std::string> notes;
  bool against = false;
  std::optional<Calibration> calibration;
};

std::string identify_table(const IdentifyReport& report);
nlohmann::ordered_json identify_json(const IdentifyReport& report);

/// The excitation that a loop added to the tip's wrench while it made a log.
struct LogExcitation {
  bool chirp = false;
  std::function<controller::Vector6(double)> wrench;  ///< at a time from the first tick, s
};

/// The options of `dashpot identify`.
struct IdentifyCommand {
  std::vector<std::string> files;
  std::string channels, inputs, against, calibrate, output, plot;
  FileHints hints = {};
  std::optional<double> from, to;
  int order = 0;
  bool ambient = false;
  bool excited = false;
  bool large_motion = false;  ///< large motion is treated as linear
  bool json = false;
  std::optional<LogExcitation> excitation = {};
  /// Called with the share that is done; true ends the search with the results so far.
  std::function<bool(double)> stop = {};
};

/// Throws InputError.
IdentifyReport identify_files(const IdentifyCommand& command);

/// The modes in an LCM log of an excited arm, beside the modes that a configuration predicts. If it
/// fails, a note in the report says why.
IdentifyReport identify_log(const std::string& log, const std::string& config,
                            const LogExcitation& excitation);

inline constexpr const char* kLargeAdvice =
    "joints move so far that the arm's inertia changes: one posture, and pushes or excitation of "
    "some hundredths of a radian, tell modes; --large-motion takes it all the same";

/// A part of a file with its measurements.
struct RecordedPart {
  MotionRecord record;
  VectorXd rest;
  std::size_t report = 0;  ///< index in IdentifyReport::parts
};

/// Parts of files from which modes can be identified.
struct RecordedParts {
  std::vector<RecordedPart> list;
  bool large = false;  ///< the motion of some record is large
};

/// Whether joints move so far that their inertias change.
bool is_large(const MotionRecord& record, const std::vector<MotionChannel>& channels);

/// Reads a file as `command` says, finds its kind of motion, and adds its parts to `parts`. The
/// report gets the channels, the kind, and the parts left out with reasons. Throws InputError.
void read_parts(const std::string& path, const IdentifyCommand& command, IdentifyReport& report,
                RecordedParts& parts);

}  // namespace dashpot::apps
