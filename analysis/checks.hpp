#pragma once
// Checks of matrices at set-up. Each throws InvalidSystem with the key and a readable reason;
// entries are counted from 1.

#include <dashpot/analysis/system.hpp>

#include <string>

namespace dashpot::analysis {

/// Entries of a matrix and its transpose may differ by this much of the largest entry.
inline constexpr double kSymmetryTolerance = 1e-10;

/// "is 3 x 2, expected 3 x 3"
void check_size(const std::string& key, const Eigen::MatrixXd& matrix, Eigen::Index rows,
                Eigen::Index cols);
/// "entry (2,3) is not a finite number"
void check_finite(const std::string& key, const Eigen::MatrixXd& matrix);
/// "is not symmetric: entry (1,2) is 3, entry (2,1) is 4", for the two that differ most
void check_symmetric(const std::string& key, const Eigen::MatrixXd& matrix);

}  // namespace dashpot::analysis
