#pragma once
// Checks of matrices at set-up. Each throws InvalidSystem with the key and a readable reason;
// entries are counted from 1.

#include <dashpot/analysis/matrix_types.hpp>

#include <Eigen/Core>
#include <stdexcept>
#include <string>
#include <utility>

namespace dashpot::analysis {

/// Thrown at set-up for an invalid system; `key` names the part ("mass", ...).
class InvalidSystem : public std::invalid_argument {
 public:
  InvalidSystem(std::string key, const std::string& reason)
      : std::invalid_argument(key + ": " + reason), key_(std::move(key)) {}
  const std::string& key() const noexcept { return key_; }

 private:
  std::string key_;
};

/// Largest difference of a matrix from its transpose, relative to the largest entry.
inline constexpr double kSymmetryTolerance = 1e-10;

/// Throws "is 3 x 2, expected 3 x 3".
void check_size(const std::string& key, const Eigen::MatrixXd& matrix, Eigen::Index rows,
                Eigen::Index cols);
/// Throws "entry (2,3) is not a finite number".
void check_finite(const std::string& key, const Eigen::MatrixXd& matrix);
/// Throws "is not symmetric: entry (1,2) is 3, entry (2,1) is 4", for the two that differ most.
void check_symmetric(const std::string& key, const Eigen::MatrixXd& matrix);
/// Throws "entry (1,2) is more than a rounding error of the coefficient", because error bounds of
/// working precision rely on low words no larger than one rounding of the coefficient.
void check_low_word(const std::string& key, const Eigen::MatrixXd& matrix,
                    const Eigen::MatrixXd& tail);
/// Throws unless `error` has no rows, or is n x n of entries of at least zero: "entry
/// (1,2) is negative or not a number". An infinite entry says that nothing is known.
void check_error(const std::string& key, const Eigen::MatrixXd& error, Eigen::Index n);

/// Replaces a matrix that is symmetric within the tolerance by its symmetric part, and adds the
/// change to `error` (no rows: zero), entrywise, because either of two entries that differ may be
/// the true one.
void make_symmetric(Eigen::MatrixXd& matrix, Eigen::MatrixXd& error);

}  // namespace dashpot::analysis
