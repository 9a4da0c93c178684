#pragma once
// One tick of a sampled loop as a matrix.

#include <dashpot/analysis/sampled/sampled_spectrum.hpp>
#include <dashpot/analysis/spectrum/spectrum_result.hpp>

namespace dashpot::analysis {

/// The loop in coordinates y = L' q (M = L L'), with ticks as the unit of time: mass 1, period 1.
struct SampledDataModel {
  Eigen::Index n = 0;
  Eigen::MatrixXd C, K, D, G;  ///< n x n
  Eigen::MatrixXd zero_modes;  ///< n x r, orthonormal
  int delay = 0;
  double filter_gain = 1;  ///< 1: no filter
  bool difference = false;

  /// Throws std::invalid_argument as sample_loop does.
  template <int N>
  SampledDataModel(const System<N>& system, const Spectrum<N>& spectrum, const SampledLoop& loop);

  bool filtered() const { return filter_gain < 1; }
  /// Returns the number of rows of the state in addition to y and y'.
  Eigen::Index memory() const { return n * (delay + (filtered() ? 1 : 0) + (difference ? 1 : 0)); }
  /// Returns A, for the state (y, y', [v], u_k-d .. u_k-1, [f]); see sample_loop.
  Eigen::MatrixXd transition() const;
  /// Returns a basis of the states along the zero modes that A does not change or only lets drift:
  /// positions, with the compensated gravity in the memory, and velocities that nothing damps.
  Eigen::MatrixXd unit_motions() const;
  /// Returns all eigenvalues of A except those of unit_motions(). Throws std::runtime_error.
  Eigen::VectorXcd discrete_eigenvalues() const;
};

extern template SampledDataModel::SampledDataModel(const System<kDynamic>&,
                                                   const Spectrum<kDynamic>&, const SampledLoop&);
extern template SampledDataModel::SampledDataModel(const System<kMaxDof>&, const Spectrum<kMaxDof>&,
                                                   const SampledLoop&);

}  // namespace dashpot::analysis
