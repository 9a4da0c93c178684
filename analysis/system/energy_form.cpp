#include <dashpot/analysis/system/energy_form.hpp>

#include <dashpot/analysis/base/arithmetic.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

/// Undamped frequencies are equal, and rotated together, if their squares differ by no more than
/// rounding errors, and these are within limits (relative).
constexpr double kLeastEqual = 1e-13, kMostEqual = 1e-10;

/// Replaces coordinates [first, first + size) by their combinations with the columns of R.
template <int N>
void rotate(Eigen::Index first, const Square<N>& R, ZeroModes<N>& zero_modes, EnergyForm<N>& form) {
  const Eigen::Index size = R.rows();
  Square<N> columns = zero_modes.coordinates.middleCols(first, size) * R;
  zero_modes.coordinates.middleCols(first, size) = columns;
  columns = form.damping.middleCols(first, size) * R;
  form.damping.middleCols(first, size) = columns;
  columns = form.damping.middleRows(first, size).transpose() * R;
  form.damping.middleRows(first, size) = columns.transpose();
}

template <int N>
void rotate_equal_frequencies(ZeroModes<N>& zero_modes, EnergyForm<N>& form) {
  const auto& kappa = zero_modes.stiffness_values;
  const double largest = form.modes > 0 ? std::abs(kappa[0]) : 0;
  const double rounding = 8 * static_cast<double>(kappa.size()) * kEps * largest;
  for (Eigen::Index first = 0; first < form.modes;) {
    Eigen::Index end = first + 1;
    const double size = std::abs(kappa[first]);
    const double equal = std::clamp(rounding, kLeastEqual * size, kMostEqual * size);
    while (end < form.modes && std::abs(kappa[end] - kappa[end - 1]) <= equal) ++end;
    if (end - first > 1) {
      const Square<N> block = form.damping.block(first, first, end - first, end - first);
      const Eigen::SelfAdjointEigenSolver<Square<N>> eigen(block);
      rotate<N>(first, eigen.eigenvectors(), zero_modes, form);
    }
    first = end;
  }
}

/// Tells coupled from free zero modes, and rotates the latter until their damping is diagonal.
template <int N>
void separate_zero_modes(ZeroModes<N>& zero_modes, EnergyForm<N>& form) {
  const Eigen::Index n = form.damping.rows(), m = form.modes, r = n - m;
  const double size = form.damping.norm();
  const double rounding = 8 * static_cast<double>(n) * kEps * size;
  const double cross = std::max(form.damping.topRightCorner(m, r).norm(),
                                form.damping.bottomLeftCorner(r, m).norm());
  form.coupling = size > 0 ? cross / size : 0;
  form.free_zeros = static_cast<int>(r);
  if (form.symmetric && cross <= rounding) {
    const Square<N> D00 = form.damping.bottomRightCorner(r, r);
    const Eigen::SelfAdjointEigenSolver<Square<N>> eigen(D00);
    rotate<N>(m, eigen.eigenvectors(), zero_modes, form);
    form.free_rates = eigen.eigenvalues();
    for (double& rate : form.free_rates) rate = std::abs(rate) <= rounding ? 0 : rate;
    return;
  }
  if (form.symmetric) {
    const Square<N> D0 = form.damping.rightCols(r);
    const Eigen::JacobiSVD<Square<N>> svd(D0, Eigen::ComputeThinU | Eigen::ComputeThinV);
    rotate<N>(m, svd.matrixV(), zero_modes, form);
    while (form.coupled_zeros < r && svd.singularValues()[form.coupled_zeros] > rounding) {
      ++form.coupled_zeros;
    }
  } else {
    form.coupled_zeros = static_cast<int>(r);
  }
  form.free_zeros = static_cast<int>(r) - form.coupled_zeros;
  form.free_rates = Vector<N>::Zero(form.free_zeros);
}

}  // namespace

template <int N>
EnergyForm<N> to_energy_form(const System<N>& system, ZeroModes<N>& zero_modes) noexcept {
  const Eigen::Index n = system.dof();
  EnergyForm<N> form;
  form.modes = static_cast<int>(n) - zero_modes.count;
  form.symmetric = system.symmetric();
  const Square<N> CT = system.damping * zero_modes.coordinates;
  form.damping = zero_modes.coordinates.transpose() * CT;
  if (form.symmetric) {
    const Square<N> transposed = form.damping.transpose();
    form.damping = 0.5 * (form.damping + transposed);
    rotate_equal_frequencies<N>(zero_modes, form);
  }
  form.free_rates = Vector<N>(0);
  if (zero_modes.count > 0) {
    separate_zero_modes<N>(zero_modes, form);
    zero_modes.basis = zero_modes.coordinates.rightCols(zero_modes.count);
  }
  if (form.symmetric) {
    form.stiffness = zero_modes.stiffness_values.asDiagonal();
  } else {
    const Square<N> KT = system.stiffness * zero_modes.coordinates;
    form.stiffness = zero_modes.coordinates.transpose() * KT;
    form.stiffness.rightCols(zero_modes.count).setZero();
  }
  if (form.symmetric && form.coupled_zeros == 0) {
    const auto D = form.damping.topLeftCorner(form.modes, form.modes);
    double off_diagonal = 0;
    for (Eigen::Index j = 0; j < form.modes; ++j) {
      for (Eigen::Index i = 0; i < j; ++i) off_diagonal += D(i, j) * D(i, j);
    }
    form.proportional = std::sqrt(2 * off_diagonal) <= 8 * static_cast<double>(n) * kEps * D.norm();
  }
  return form;
}

template EnergyForm<kDynamic> to_energy_form(const System<kDynamic>&,
                                             ZeroModes<kDynamic>&) noexcept;
template EnergyForm<kMaxDof> to_energy_form(const System<kMaxDof>&, ZeroModes<kMaxDof>&) noexcept;

}  // namespace dashpot::analysis
