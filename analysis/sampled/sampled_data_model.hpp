#pragma once
// One tick of a sampled loop as a matrix.

#include <dashpot/analysis/elastic_form.hpp>
#include <dashpot/analysis/sampled/sampled_spectrum.hpp>
#include <dashpot/analysis/spectrum/spectrum_result.hpp>

namespace dashpot::analysis {

/// The loop in coordinates y = L' q (M = L L'), or in those of an elastic form, with ticks as the
/// unit of time: mass 1, period 1. What does not wait for the delay is its inner state
///     x = (y, y', [v], [w]),   x_k+1 = A x_k + B f_k,   u_k = (uncontrolled - factor gain) x_k,
/// p rows, with the difference v of positions and the controller's own states w
/// (SampledLoop::memory). What lies between the command u and the torque f is a scalar,
///     f = h(z) u,   h(z) = z^-delay filter_gain z / (z - 1 + filter_gain),
/// so that  det(z I - A - h(z) B (uncontrolled - factor gain)) = 0  has all eigenvalues of the loop
/// but has only p rows, whatever the delay.
struct SampledDataModel {
  Eigen::Index n = 0;
  Eigen::MatrixXd C, K, D, G;    ///< n x n
  Eigen::MatrixXd zero_modes;    ///< n x r, orthonormal; none where w reads a zero mode
  Eigen::MatrixXd change;        ///< A - I, p x p
  Eigen::MatrixXd input;         ///< B, p x n
  Eigen::MatrixXd uncontrolled;  ///< n x p: the gravity that is compensated
  Eigen::MatrixXd gain;          ///< n x p: springs, dampers, and what reads w
  int delay = 0;
  double filter_gain = 1;  ///< 1: no filter
  bool difference = false;

  /// Throws std::invalid_argument as sample_loop does.
  template <int N>
  SampledDataModel(const System<N>& system, const Spectrum<N>& spectrum, const SampledLoop& loop);
  /// Leaves the zero modes out if nothing moves them. Throws likewise.
  template <int N>
  SampledDataModel(const ElasticForm<N>& form, const SampledLoop& loop);

  bool filtered() const { return filter_gain < 1; }
  /// Returns p.
  Eigen::Index inner() const { return change.rows(); }
  /// Returns the number of rows of the whole state: the inner state, the commands that wait, the
  /// filter.
  Eigen::Index rows() const { return inner() + n * (delay + (filtered() ? 1 : 0)); }
  /// Returns true for masses that nothing but the held torque moves, without states w.
  bool masses_alone() const;
  /// Returns log h at z = e^zeta, continuous for Re zeta >= 0.
  Complex log_actuation(Complex zeta) const;
  /// Returns the matrix of a tick, for the state (x, u_k-d .. u_k-1, [f]); see sample_loop.
  Eigen::MatrixXd transition(double factor = 1) const;
  /// Returns a basis of the states along the zero modes that a tick does not change or only lets
  /// drift: positions, with the compensated gravity in the memory, and velocities that nothing
  /// damps.
  Eigen::MatrixXd unit_motions() const;
  /// Returns an orthonormal basis of what unit_motions() leaves of the states; no columns if
  /// unit_motions() has none.
  Eigen::MatrixXd other_motions() const;
  /// Returns all eigenvalues of transition() except those of unit_motions(), by one dense
  /// eigenproblem of rows() rows. Throws std::runtime_error.
  Eigen::VectorXcd discrete_eigenvalues() const;
  /// Returns the loop of the motion along one direction of y (n, of unit length), as if the others
  /// stood still and without states w.
  SampledDataModel along(const Eigen::VectorXd& direction) const;
  /// Sets G, and what follows from it.
  void set_gravity(const Eigen::MatrixXd& gravity);

 private:
  SampledDataModel() = default;
  /// Checks the loop, throws std::invalid_argument, and sets what depends on it alone.
  void set_loop(const SampledLoop& loop);
  /// Sets change, input, uncontrolled and gain, where q = coordinates y.
  void assemble(const SampledLoop& loop, const Eigen::MatrixXd& coordinates);
  /// Sets them as far as they do not depend on the given number of states w.
  void assemble(Eigen::Index states);
};

/// Returns the eigenvalues of A, which is destroyed. Throws std::runtime_error.
Eigen::VectorXcd eigenvalues_of(Eigen::MatrixXd& A);

extern template SampledDataModel::SampledDataModel(const System<kDynamic>&,
                                                   const Spectrum<kDynamic>&, const SampledLoop&);
extern template SampledDataModel::SampledDataModel(const System<kMaxDof>&, const Spectrum<kMaxDof>&,
                                                   const SampledLoop&);
extern template SampledDataModel::SampledDataModel(const ElasticForm<kDynamic>&,
                                                   const SampledLoop&);
extern template SampledDataModel::SampledDataModel(const ElasticForm<kMaxDof>&, const SampledLoop&);

}  // namespace dashpot::analysis
