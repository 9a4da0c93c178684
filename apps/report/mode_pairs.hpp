#pragma once
#include <Eigen/Core>
#include <vector>

namespace dashpot::apps {

/// Pairs rows with columns of `distances` so that the sum of squares is least; an unpaired row
/// costs as much as a pair with the distance `farthest`. Returns each row's column; -1 if it is
/// unpaired, such as a row of NaN.
std::vector<int> nearest_pairs(const Eigen::MatrixXd& distances, double farthest);

}  // namespace dashpot::apps
