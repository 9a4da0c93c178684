#include <dashpot/analysis/response/damping_gradients.hpp>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;

/// Sum and product of a mode's eigenvalues may differ by this much of their size from trace and
/// determinant of its block.
constexpr double kSameBlock = 1e-8;

/// The block of two columns that holds the mode and that no mode before has taken; -1 if none.
int block_of(const Mode<>& mode, const ModalBasis<>& basis, std::vector<bool>& taken) {
  const double sum = (mode.eigenvalues[0] + mode.eigenvalues[1]).real();
  const double product = (mode.eigenvalues[0] * mode.eigenvalues[1]).real();
  const double size = modulus(mode.eigenvalues[0]) + modulus(mode.eigenvalues[1]);
  int best = -1;
  double least = kSameBlock;
  for (int k = 0; k < basis.blocks.size(); ++k) {
    const Block& block = basis.blocks[k];
    if (block.size != 2 || block.zero_mode || taken[static_cast<std::size_t>(k)]) continue;
    const Eigen::Matrix2d L = basis.Lambda.block<2, 2>(block.first, block.first);
    const double distance = std::max(std::abs(L.trace() - sum) / size,
                                     std::abs(L.determinant() - product) / (size * size));
    if (distance < least) least = distance, best = k;
  }
  if (best >= 0) taken[static_cast<std::size_t>(best)] = true;
  return best;
}

/// Gradients of l1 + l2 and of l1 l2.
struct PairGradient {
  MatrixXd sum;
  MatrixXd product;
};

PairGradient of_eigenvectors(const System<>& system, const Mode<>& mode) {
  std::array<MatrixXcd, 2> by;
  for (std::size_t k = 0; k < 2; ++k) {
    const Complex lambda = mode.eigenvalues[k];
    const Eigen::VectorXcd &x = mode.shapes[k], &y = mode.left_shapes[k];
    const Eigen::VectorXcd slope_x = 2.0 * lambda * (system.mass * x) + system.damping * x;
    const Complex slope = (y.transpose() * slope_x).value();
    by[k] = (-lambda / slope) * y * x.transpose();
  }
  return {(by[0] + by[1]).real(),
          (mode.eigenvalues[1] * by[0] + mode.eigenvalues[0] * by[1]).real()};
}

PairGradient of_block(const ModalBasis<>& basis, int block) {
  const Eigen::Index at = basis.blocks[block].first;
  const Eigen::Matrix2d L = basis.Lambda.block<2, 2>(at, at);
  const Eigen::Matrix2d adjugate = L.trace() * Eigen::Matrix2d::Identity() - L;
  const MatrixXd wY = basis.weight.block<2, 2>(at, at) * basis.Y.middleCols(at, 2).transpose();
  const MatrixXd UL = basis.U.middleCols(at, 2) * L;
  return {-(UL * wY).transpose(), -(UL * adjugate * wY).transpose()};
}

}  // namespace

std::vector<MatrixXd> damping_gradients(const System<>& system, const Spectrum<>& spectrum) {
  std::vector<bool> taken(static_cast<std::size_t>(spectrum.basis.blocks.size()), false);
  std::vector<MatrixXd> result;
  for (const Mode<>& mode : spectrum.modes) {
    const int block = block_of(mode, spectrum.basis, taken);
    PairGradient by = block < 0 ? of_eigenvectors(system, mode) : of_block(spectrum.basis, block);
    if (spectrum.symmetric) {
      by.sum = (0.5 * (by.sum + by.sum.transpose())).eval();
      by.product = (0.5 * (by.product + by.product.transpose())).eval();
    }
    const double omega = mode.natural_frequency, zeta = mode.damping_ratio;
    const MatrixXd of_frequency = by.product / (2 * omega);
    result.emplace_back(-by.sum / (2 * omega) - zeta / omega * of_frequency);
  }
  return result;
}

}  // namespace dashpot::analysis
