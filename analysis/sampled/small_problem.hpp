#pragma once
// The nonlinear eigenproblem of a sampled loop that is as small without its delay as with it.

#include <dashpot/analysis/sampled/sampled_data_model.hpp>

namespace dashpot::analysis {

/// det P(z) = 0  with  P(z) = z I - A - h(z) B (uncontrolled - factor gain), p x p; see
/// SampledDataModel, which has to outlive this object.
class SmallProblem {
 public:
  explicit SmallProblem(const SampledDataModel& model);

  /// Returns the number of directions that the controller acts in.
  Eigen::Index rank() const { return gain_.rows(); }
  bool has_gravity() const { return !model_.uncontrolled.isZero(0); }

  /// Returns the eigenvalues of gain P(z)^-1 B at factor 0, those that are not zero for every z.
  Eigen::VectorXcd values(Complex zeta) const;
  /// Returns the eigenvalues of -(z I - A_0)^-1 (A - A_0 + h B uncontrolled), where A_0 is A
  /// without gravity; no entries if all are below 1.
  Eigen::VectorXcd gravity_values(Complex zeta) const;
  /// Returns d/dz of log det P(z) at factor 1, or infinity where P(z) is singular.
  Complex log_slope(Complex z) const;

 private:
  Eigen::MatrixXcd open_loop(Complex zeta) const;

  const SampledDataModel& model_;
  bool masses_alone_;
  Eigen::MatrixXd gain_;                 ///< Q' gain, r x p, Q orthonormal
  Eigen::MatrixXd input_;                ///< B Q, p x r
  Eigen::MatrixXd stiffness_, damping_;  ///< r x r, of masses alone
  Eigen::MatrixXd without_gravity_;      ///< A_0 - I
};

/// Returns all eigenvalues of the model's transition() but those of its unit_motions(): one dense
/// eigenproblem of 2 + delay rows or so for each joint gives those of the motions one by one, from
/// which Aberth's method moves all of them together to the zeros of det P(z). Throws
/// std::runtime_error where it does not converge.
Eigen::VectorXcd roots_of_small_problem(const SampledDataModel& model);

}  // namespace dashpot::analysis
