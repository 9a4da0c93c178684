#pragma once
#include <dashpot/apps/identify/identify.hpp>
#include <dashpot/identification/motion_record.hpp>

#include <string>
#include <vector>

namespace dashpot::apps {

inline constexpr const char* kLargeAdvice =
    "joints move so far that the arm's inertia changes: one posture, and pushes or excitation of "
    "some hundredths of a radian, tell modes; --large-motion takes it all the same";

/// A part of a file with its measurements.
struct RecordedPart {
  identification::MotionRecord record;
  Eigen::VectorXd rest;
  std::size_t report = 0;  ///< index in IdentifyReport::parts
};

/// Parts of files from which modes can be identified.
struct RecordedParts {
  std::vector<RecordedPart> list;
  bool large = false;  ///< the motion of some record is large
};

/// Whether joints move so far that their inertias change.
bool is_large(const identification::MotionRecord& record,
              const std::vector<MotionChannel>& channels);

/// Reads a file as `command` says, finds its kind of motion, and adds its parts to `parts`. The
/// report gets the channels, the kind, and the parts left out with reasons. Throws InputError.
void read_parts(const std::string& path, const IdentifyCommand& command, IdentifyReport& report,
                RecordedParts& parts);

}  // namespace dashpot::apps
