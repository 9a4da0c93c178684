#pragma once
#include <Eigen/Core>
#include <vector>

namespace dashpot::apps {

/// Pairs rows with columns of `distances` so that the sum of squares is least, where one that stays
/// alone costs as much as a pair that is `farthest` apart. Returns each row's column; -1 where it
/// stays alone, as all do whose distances are no numbers.
std::vector<int> nearest_pairs(const Eigen::MatrixXd& distances, double farthest);

}  // namespace dashpot::apps
