#pragma once
#include <dashpot/apps/identify/identify.hpp>
#include <dashpot/identification/motion_record.hpp>

#include <string>
#include <vector>

namespace dashpot::apps {

inline constexpr const char* kLargeAdvice =
    "joints move so far that the arm's inertia changes: one posture, and pushes or excitation of "
    "some hundredths of a radian, tell modes; --large-motion takes it all the same";

/// A part of a file with what was measured in it.
struct RecordedPart {
  identification::MotionRecord record;
  Eigen::VectorXd rest;
  std::size_t report = 0;  ///< its place in IdentifyReport::parts
};

/// Parts of files from which modes can be told.
struct RecordedParts {
  std::vector<RecordedPart> list;
  bool large = false;  ///< some record's motion is
};

/// Whether joints move so far that their inertias change.
bool is_large(const identification::MotionRecord& record,
              const std::vector<MotionChannel>& channels);

/// Reads a file as `command` says, tells what kind of motion it shows, and adds its parts to those
/// before. The report gets the channels, the kind, what is left out and why. Throws InputError.
void read_parts(const std::string& path, const IdentifyCommand& command, IdentifyReport& report,
                RecordedParts& parts);

}  // namespace dashpot::apps
