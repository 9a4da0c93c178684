#pragma once
#include <dashpot/controller/robot_types.hpp>

#include <cstdint>

namespace dashpot::controller {

/// Postures spread evenly between the limits of all joints at once, at most half a turn each way,
/// by the sequence of Roberts (2018): joint i advances by phi^-(i + 1) of its range, with
/// phi^(n + 1) = phi + 1. One step for all joints would keep the postures on a curve.
class PostureSequence {
 public:
  /// `lower` and `upper` have n entries, rad; they may be infinite. Another seed moves all postures
  /// by one offset, around the ends of the range; seed 0 does not move them.
  PostureSequence(const JointVector& lower, const JointVector& upper, std::uint64_t seed = 0);

  /// Returns posture `index`, from 0; n, rad.
  JointVector at(std::int64_t index) const;

 private:
  JointVector lower_, upper_, step_;
  JointVector offset_;  ///< in [0, 1)
};

}  // namespace dashpot::controller
