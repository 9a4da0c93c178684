#pragma once
#include <dashpot/identification/identification.hpp>

#include <vector>

namespace dashpot::identification {

/// Throws std::invalid_argument for a largest order that is too large, or negative.
void check_order(const IdentifyOptions& options);

/// Records without the channels and inputs that are constant in all of them.
struct MovingChannels {
  /// Throws std::invalid_argument if no channel moves.
  explicit MovingChannels(const std::vector<MotionRecord>& all);

  /// Gives the shapes and the noise of all channels their places; zero for constant ones.
  Identification of_all(Identification found) const;

  std::vector<MotionRecord> records;
  std::vector<Eigen::Index> channels;  ///< which of all

 private:
  Eigen::Index count_;
};

}  // namespace dashpot::identification
