#pragma once
#include <dashpot/analysis/damping_target.hpp>
#include <dashpot/analysis/task_space.hpp>

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

namespace dashpot::analysis {

/// The ratios that a mode may have: at least `level` times its target and at most `ceiling`;
/// without a ceiling exactly `level` times its target. Soft modes may have any ratio.
struct RatioGoal {
  DampingTarget target;
  double level = 1;
  std::optional<double> ceiling;
};

/// Result of a search.
struct FitResult {
  Eigen::MatrixXd damping;  ///< X, positive semidefinite by construction, in the structure
  double violation = 0;     ///< largest distance of a ratio from what the goal allows
};

/// Searches damping matrices of a structure by the exact derivatives of the ratios, over one
/// system or many at a time.
///
/// X = S R R' S, with S the diagonal of the start's square-rooted entries and R lower triangular
/// (block by block), so that every iterate is positive semidefinite. The squared violations are
/// minimised over R by Levenberg and Marquardt's method.
///
/// Where a solution exists, the steps are the least-norm steps of Newton's method along
/// d ratio / dR, and the search ends at a solution near its start, with errors of rounding.
/// Otherwise it ends where the sum of squares is stationary, because it is a local search. The
/// result does not depend on the number of threads.
class DampingFit {
 public:
  /// Keeps references: the samples have to outlive this object. `threads` 0: one for each
  /// processor. Throws std::invalid_argument for a search that `fits` says no to.
  DampingFit(const std::vector<DampingSample>& samples, DampingStructure structure,
             int threads = 1);

  /// Returns true if a search over so many systems of `dof` coordinates and `directions` takes at
  /// most about 1 GB: for the gradients of all ratios and for the Hessian.
  static bool fits(std::size_t samples, Eigen::Index dof, Eigen::Index directions,
                   DampingStructure structure);

  /// Searches from `start`, which is positive semidefinite, k x k; its entries outside the
  /// structure are dropped. Throws std::runtime_error if a spectrum cannot be computed.
  FitResult search(const Eigen::MatrixXd& start, const RatioGoal& goal) const;

  /// Returns X with zeros outside the structure, which is still positive semidefinite.
  Eigen::MatrixXd within_structure(const Eigen::MatrixXd& X) const;

 private:
  struct Residual {
    double value = 0;
    Eigen::MatrixXd gradient;  ///< by X
  };
  using Entries = std::vector<std::pair<Eigen::Index, Eigen::Index>>;

  std::vector<Residual> of_sample(const DampingSample& sample, const Eigen::MatrixXd& X,
                                  const RatioGoal& goal) const;
  std::vector<std::vector<Residual>> of_all(const Eigen::MatrixXd& X, const RatioGoal& goal) const;

  const std::vector<DampingSample>& samples_;
  Entries entries_;  // of R
  int threads_;
};

/// Calls act(i) for i = 0 .. count-1 on this many threads (0: one for each processor), and returns
/// when all calls are done. The first exception by i is thrown again.
void for_each_in_parallel(std::size_t count, int threads,
                          const std::function<void(std::size_t)>& act);

}  // namespace dashpot::analysis
