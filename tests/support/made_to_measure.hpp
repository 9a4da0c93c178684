#pragma once
// Systems made from their modal basis, the other way round: any blocks one likes, exactly known.

#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/random.hpp>

#include <Eigen/LU>
#include <vector>

namespace dashpot::testing {

struct MadeToMeasure {
  analysis::System<> system;
  analysis::Spectrum<> spectrum;  ///< status and basis only
};

/// The system with mass `mass` (n x n) and basis U (n x 2n), Lambda = diag(blocks), 2n rows in all.
/// With Z = [U; U Lambda] its state matrix is Z Lambda Z^-1, whose lower half gives -M^-1 [K C];
/// they are not symmetric. The left basis follows from Z_left' B Z = I, B = [C M; M 0].
inline MadeToMeasure make_system(const Eigen::MatrixXd& mass, const Eigen::MatrixXd& U,
                                 const std::vector<Eigen::MatrixXd>& blocks) {
  using Eigen::MatrixXd;
  const Eigen::Index n = mass.rows();
  MadeToMeasure made{analysis::System<>(n), {}};
  analysis::ModalBasis<>& basis = made.spectrum.basis;
  basis.Lambda = MatrixXd::Zero(2 * n, 2 * n);
  int first = 0;
  for (const MatrixXd& block : blocks) {
    const int size = static_cast<int>(block.rows());
    basis.Lambda.block(first, first, size, size) = block;
    basis.blocks.push_back({first, size, size == 2 && block.col(0).isZero(0.0)});
    first += size;
  }
  basis.U = U;
  MatrixXd Z(2 * n, 2 * n);
  Z << U, U * basis.Lambda;
  const MatrixXd inverse = Z.fullPivLu().inverse();
  const MatrixXd KC = -mass * U * basis.Lambda * basis.Lambda * inverse;
  made.system.mass = mass;
  made.system.stiffness = KC.leftCols(n);
  made.system.damping = KC.rightCols(n);
  MatrixXd B = MatrixXd::Zero(2 * n, 2 * n);
  B << made.system.damping, mass, mass, MatrixXd::Zero(n, n);
  basis.Y = B.transpose().fullPivLu().solve(inverse.transpose()).topRows(n);
  basis.Gamma = basis.Lambda.transpose();
  basis.weight = MatrixXd::Identity(2 * n, 2 * n);
  double scale = 2;  // of the left columns, block by block, so that the weight is not an identity
  for (const analysis::Block& block : basis.blocks) {
    basis.Y.middleCols(block.first, block.size) *= scale;
    basis.weight.middleCols(block.first, block.size) /= scale;
    scale *= -1.5;
  }
  made.spectrum.zero_modes.basis = MatrixXd(n, 0);
  return made;
}

/// n = 4 with a block of every kind that a solver hands out: a real one, a lightly damped pair, one
/// that is all but critical, a zero mode; about 2 to 30 rad/s.
inline MadeToMeasure make_system_of_every_kind(Random& random) {
  using Eigen::Matrix2d;
  using Eigen::MatrixXd;
  const MatrixXd overdamped = MatrixXd::Constant(1, 1, -3.0);
  const MatrixXd faster = MatrixXd::Constant(1, 1, -30.0);
  const MatrixXd light = (Matrix2d() << -0.2, 12, -12, -0.2).finished();
  const MatrixXd critical = (Matrix2d() << -5, 4, 1e-9, -5).finished();
  const MatrixXd free = (Matrix2d() << 0, 1, 0, -2).finished();
  return make_system(random.spd(4), random.matrix(4, 8),
                     {overdamped, light, critical, free, faster});
}

/// n = 4 with two coinciding pairs that share a Jordan block, an undamped pair at 7 rad/s, and an
/// undamped zero mode.
inline MadeToMeasure make_defective_system(Random& random) {
  using Eigen::Matrix2d;
  using Eigen::MatrixXd;
  MatrixXd shared = MatrixXd::Zero(4, 4);
  shared << -1, 9, 1, 0, -9, -1, 0, 1, 0, 0, -1, 9, 0, 0, -9, -1;
  return make_system(
      random.spd(4), random.matrix(4, 8),
      {shared, (Matrix2d() << 0, 7, -7, 0).finished(), (Matrix2d() << 0, 1, 0, 0).finished()});
}

}  // namespace dashpot::testing
