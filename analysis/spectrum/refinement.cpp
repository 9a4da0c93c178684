#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/double_double.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/spectrum/refinement.hpp>

#include <limits>

namespace dashpot::analysis {
namespace {

/// Distance of the Gram matrix from its diagonal blocks up to which these serve for all of it, and
/// up to which it is looked at as a perturbation of them.
constexpr double kOrthogonal = 1e-8;
constexpr double kNearlyOrthogonal = 0.1;
/// Units of Work, times n^3: of the products of a basis, with either precision; of the inverse of
/// its Gram matrix; and of all that is done once.
constexpr std::int64_t kProductsWork = 80, kExtendedWork = 1600, kInverseWork = 110,
                       kDefectWork = 90;

/// X Lambda for a block-diagonal Lambda.
template <int N, typename Left, typename Out>
void times_blocks(const Left& X, const State<N>& Lambda, const BlockList<N>& blocks, Out& out) {
  out.resize(X.rows(), X.cols());
  const Eigen::Index n = X.rows();
  for (const Block& b : blocks) {
    const double* const x = X.data() + b.first * n;
    double* const y = out.data() + b.first * n;
    if (b.size == 1) {
      const double factor = Lambda(b.first, b.first);
      for (Eigen::Index i = 0; i < n; ++i) y[i] = factor * x[i];
    } else if (b.size == 2) {
      const Eigen::Index k = b.first;
      const double l00 = Lambda(k, k), l10 = Lambda(k + 1, k), l01 = Lambda(k, k + 1),
                   l11 = Lambda(k + 1, k + 1);
      for (Eigen::Index i = 0; i < n; ++i) {
        y[i] = x[i] * l00 + x[i + n] * l10;
        y[i + n] = x[i] * l01 + x[i + n] * l11;
      }
    } else {
      out.middleCols(b.first, b.size) =
          X.middleCols(b.first, b.size).lazyProduct(Lambda.block(b.first, b.first, b.size, b.size));
    }
  }
}

/// weight X for a block-diagonal weight.
template <int N>
void weigh(const State<N>& weight, const BlockList<N>& blocks, State<N>& X) {
  const Eigen::Index states = X.rows();
  for (const Block& b : blocks) {
    const Eigen::Index k = b.first;
    double* x = X.data() + k;
    if (b.size == 1) {
      const double factor = weight(k, k);
      for (Eigen::Index j = 0; j < states; ++j, x += states) x[0] *= factor;
    } else if (b.size == 2) {
      const double w00 = weight(k, k), w10 = weight(k + 1, k), w01 = weight(k, k + 1),
                   w11 = weight(k + 1, k + 1);
      for (Eigen::Index j = 0; j < states; ++j, x += states) {
        const double x0 = x[0], x1 = x[1];
        x[0] = w00 * x0 + w01 * x1;
        x[1] = w10 * x0 + w11 * x1;
      }
    } else {
      const State<N> rows = weight.block(k, k, b.size, b.size) * X.middleRows(k, b.size);
      X.middleRows(k, b.size) = rows;
    }
  }
}

/// Left basis dual to the right one: the inverse of [C U + M U Lambda; M U].
template <int N>
void dual_basis(const BasisResidual<N>& residual, ModalBasis<N>& basis) {
  const Eigen::Index n = basis.U.rows();
  State<N> B(2 * n, 2 * n), inverse = State<N>::Identity(2 * n, 2 * n);
  B.topRows(n) = residual.CU + residual.MV;
  B.bottomRows(n) = residual.MU;
  solve_in_place(B, inverse, std::numeric_limits<double>::min());
  basis.Y = inverse.leftCols(n).transpose();
  basis.Gamma = basis.Lambda.transpose();
}

/// Makes the left basis of a symmetric system whose blocks are not orthogonal to each other,
/// because some have eigenvalues in common: Y = U G^-1 with the Gram matrix G, scaled before it is
/// inverted.
template <int N>
void orthogonalize_left(const State<N>& gram, ModalBasis<N>& basis) {
  StateVector<N> scale(gram.rows());
  for (const Block& b : basis.blocks) {
    const auto own = gram.block(b.first, b.first, b.size, b.size);
    scale.segment(b.first, b.size).setConstant(1 / std::sqrt(own.norm()));
  }
  State<N> factor = scale.asDiagonal() * gram * scale.asDiagonal();
  State<N> inverse = State<N>::Identity(gram.rows(), gram.rows());
  solve_in_place(factor, inverse, std::numeric_limits<double>::min());
  inverse = (scale.asDiagonal() * inverse * scale.asDiagonal()).eval();
  basis.Y.noalias() = basis.U * inverse.transpose();
  basis.Gamma = basis.Lambda.transpose();
}

/// Inverses of the diagonal blocks of the Gram matrix.
template <int N>
void invert_blocks(const State<N>& gram, ModalBasis<N>& basis) {
  basis.weight.setZero(gram.rows(), gram.cols());
  for (const Block& b : basis.blocks) {
    const Eigen::Index k = b.first;
    if (b.size == 1) {
      basis.weight(k, k) = 1 / gram(k, k);
      continue;
    }
    if (b.size == 2) {
      const double inverse =
          1 / (gram(k, k) * gram(k + 1, k + 1) - gram(k, k + 1) * gram(k + 1, k));
      basis.weight(k, k) = gram(k + 1, k + 1) * inverse;
      basis.weight(k + 1, k + 1) = gram(k, k) * inverse;
      basis.weight(k, k + 1) = -gram(k, k + 1) * inverse;
      basis.weight(k + 1, k) = -gram(k + 1, k) * inverse;
      continue;
    }
    State<N> factor = gram.block(b.first, b.first, b.size, b.size);
    State<N> inverse = State<N>::Identity(b.size, b.size);
    solve_in_place(factor, inverse, std::numeric_limits<double>::min());
    basis.weight.block(b.first, b.first, b.size, b.size) = inverse;
  }
}

/// Largest |A_ij| / (s_i s_j); zero if A has no rows.
template <int N>
double relative_size(const Square<N>& A, const Vector<N>& s) {
  double largest = 0;
  for (Eigen::Index j = 0; j < A.cols(); ++j) {
    for (Eigen::Index i = 0; i < A.rows(); ++i) {
      largest = std::max(largest, std::abs(A(i, j)) / (s[i] * s[j]));
    }
  }
  return largest;
}

/// Entrywise bound on |weight G* - I|, where G* is the exact Gram matrix and `gram` the computed
/// one. Uses |M_kl| <= s_k s_l with s_k = sqrt(M_kk), so that graded masses stay graded.
template <int N>
void gram_defect(const System<N>& system, bool extended, const ModalBasis<N>& basis,
                 BasisResidual<N>& residual) {
  const Eigen::Index n = system.dof(), states = 2 * n;
  const Vector<N> s = system.mass.diagonal().cwiseSqrt();
  const double c = relative_size<N>(system.damping, s);
  StateVector<N> u(states), v(states), y(states), yg(states);
  for (Eigen::Index j = 0; j < states; ++j) {
    u[j] = s.cwiseProduct(basis.U.col(j)).norm();
    v[j] = s.cwiseProduct(residual.V.col(j)).norm();
    y[j] = s.cwiseProduct(basis.Y.col(j)).norm();
    yg[j] = s.cwiseProduct(residual.YG.col(j)).norm();
  }
  int widest = 1;
  for (const Block& b : basis.blocks) widest = std::max(widest, b.size);
  const auto dn = static_cast<double>(n);
  const double terms = (2 * dn + 16) * dn * kUnit;
  const double gamma = extended ? 8 * terms * kUnit : terms;
  // Sums over n entries are no longer than sqrt(n) times their norms, twice.
  const double M_error = dn * relative_size<N>(system.mass_error, s);
  const double C_error = dn * relative_size<N>(system.damping_error, s);
  State<N>& E = residual.E;
  State<N>& error = residual.F_error;  // used as workspace here
  E = residual.gram;
  error.resize(states, states);
  for (Eigen::Index j = 0; j < states; ++j) {
    for (Eigen::Index i = 0; i < states; ++i) {
      error(i, j) = gamma * (y[i] * (c * u[j] + v[j]) + yg[i] * u[j]) +
                    y[i] * (C_error * u[j] + M_error * v[j]) + yg[i] * M_error * u[j] +
                    (8 + 2 * widest) * kUnit * std::abs(E(i, j));
    }
  }
  const State<N> size = basis.weight.cwiseAbs();
  weigh<N>(size, basis.blocks, error);
  weigh<N>(basis.weight, basis.blocks, E);
  E.diagonal().array() -= 1;
  E = E.cwiseAbs() + error;
}

/// n x 2n
template <int N>
using WideDoubleDouble =
    Eigen::Matrix<DoubleDouble, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, N, kTwice<N>>;

/// X Lambda in double-double arithmetic, X(i, j) giving doubles or double-doubles.
template <int N, typename Left>
WideDoubleDouble<N> times_blocks_extended(const Left& X, const ModalBasis<N>& basis) {
  const Eigen::Index n = basis.U.rows();
  WideDoubleDouble<N> out(n, 2 * n);
  for (const Block& b : basis.blocks) {
    for (Eigen::Index j = b.first; j < b.first + b.size; ++j) {
      for (Eigen::Index i = 0; i < n; ++i) {
        DotAccumulator sum;
        for (Eigen::Index k = b.first; k < b.first + b.size; ++k)
          sum.add(X(i, k), basis.Lambda(k, j));
        out(i, j) = sum.value();
      }
    }
  }
  return out;
}

/// Sets R = K U + C U Lambda + M U Lambda^2 (n x 2n) and the Gram matrix
/// Y' (C U + M U Lambda) + (Y Gamma)' M U (2n x 2n) of a basis, in double-double arithmetic,
/// rounded once at the end. `YG` is Y Gamma. R and gram have their sizes already.
template <int N>
void evaluate_extended(const System<N>& system, const ModalBasis<N>& basis, const Wide<N>& YG,
                       Wide<N>& R, State<N>& gram) {
  const Eigen::Index n = system.dof();
  const WideDoubleDouble<N> V = times_blocks_extended<N>(basis.U, basis);
  const WideDoubleDouble<N> A = times_blocks_extended<N>(V, basis);
  WideDoubleDouble<N> momentum(n, 2 * n), tested(n, 2 * n);
  for (Eigen::Index j = 0; j < 2 * n; ++j) {
    for (Eigen::Index i = 0; i < n; ++i) {
      DotAccumulator row, p, t;
      for (Eigen::Index k = 0; k < n; ++k) {
        const double u = basis.U(k, j);
        row.add(u, system.stiffness(i, k));
        row.add(V(k, j), system.damping(i, k));
        row.add(A(k, j), system.mass(i, k));
        p.add(u, system.mass(i, k));
        t.add(u, system.damping(i, k));
        t.add(V(k, j), system.mass(i, k));
        if (system.has_low_words) {
          row.add(u, system.stiffness_low(i, k));
          row.add(V(k, j), system.damping_low(i, k));
          t.add(u, system.damping_low(i, k));
        }
      }
      R(i, j) = row.value().high;
      momentum(i, j) = p.value();
      tested(i, j) = t.value();
    }
  }
  for (Eigen::Index j = 0; j < 2 * n; ++j) {
    for (Eigen::Index i = 0; i < 2 * n; ++i) {
      DotAccumulator sum;
      for (Eigen::Index k = 0; k < n; ++k) {
        sum.add(tested(k, j), basis.Y(k, i));
        sum.add(momentum(k, j), YG(k, i));
      }
      gram(i, j) = sum.value().high;
    }
  }
}

/// Gram matrix and residual for the left basis (Y, Gamma), the blocks' weights, and the bound E.
/// Returns the largest column sum of E.
template <int N>
double evaluate_products(const System<N>& system, bool extended, ModalBasis<N>& basis,
                         BasisResidual<N>& residual) {
  times_blocks<N>(basis.Y, basis.Gamma, basis.blocks, residual.YG);
  residual.YT = basis.Y.transpose();
  residual.R.resize(basis.U.rows(), basis.U.cols());
  residual.gram.resize(basis.U.cols(), basis.U.cols());
  if (extended) {
    evaluate_extended<N>(system, basis, residual.YG, residual.R, residual.gram);
  } else {
    const Wide<N> tested = residual.CU + residual.MV;
    multiply(residual.YT, tested, residual.gram);
    const State<N> YGT = residual.YG.transpose();
    multiply(YGT, residual.MU, residual.E);
    residual.gram += residual.E;
    times_blocks<N>(tested, basis.Lambda, basis.blocks, residual.R);
    residual.R += residual.KU;
  }
  invert_blocks<N>(residual.gram, basis);
  gram_defect<N>(system, extended, basis, residual);
  return residual.E.colwise().sum().maxCoeff();
}

/// Entrywise bound on the error of the computed residual R.
template <int N>
void bound_residual(const System<N>& system, bool extended, const ModalBasis<N>& basis,
                    BasisResidual<N>& residual) {
  int widest = 1;
  for (const Block& b : basis.blocks) widest = std::max(widest, b.size);
  const State<N> Lambda_size = basis.Lambda.cwiseAbs();
  const Wide<N> size_U = basis.U.cwiseAbs();
  Wide<N> size_V, size_A;
  times_blocks<N>(size_U, Lambda_size, basis.blocks, size_V);
  times_blocks<N>(size_V, Lambda_size, basis.blocks, size_A);
  Wide<N> part;
  Square<N> size = system.stiffness.cwiseAbs();
  multiply(size, size_U, residual.R_size);
  size = system.damping.cwiseAbs();
  multiply(size, size_V, part);
  residual.R_size += part;
  size = system.mass.cwiseAbs();
  multiply(size, size_A, part);
  residual.R_size += part;
  const auto dn = static_cast<double>(system.dof());
  const double terms = 3 * dn + 2 * widest + (system.has_low_words ? 6 : 4);
  const double gamma = extended ? 8 * terms * kUnit * kUnit : terms * kUnit;
  // The second term is the rounding of R itself, and of the product Y' R.
  residual.R_size = gamma * residual.R_size + (dn + 2 * widest + 4) * kUnit * residual.R.cwiseAbs();
  const auto add = [&](const Square<N>& error, const Wide<N>& factor) {
    if (error.rows() == 0) return;
    multiply(error, factor, part);
    residual.R_size += part;
  };
  add(system.stiffness_error, size_U);
  add(system.damping_error, size_V);
  add(system.mass_error, size_A);
}

/// Whether no product that matters can underflow or overflow, extended ones included: the bounds
/// count rounding errors only. Widths in powers of ten are far beyond any mechanism.
template <int N>
bool in_range(const System<N>& system, const ModalBasis<N>& basis) {
  const auto inside = [](double x, double width) { return 1 / width < x && x < width; };
  for (Eigen::Index i = 0; i < system.dof(); ++i) {
    if (!inside(system.mass(i, i), 1e120)) return false;
  }
  for (const Block& b : basis.blocks) {
    if (b.zero_mode) continue;
    const double rate = basis.Lambda.block(b.first, b.first, b.size, b.size).cwiseAbs().maxCoeff();
    if (rate != 0 && !inside(rate, 1e60)) return false;
  }
  return true;
}

}  // namespace

template <int N>
void evaluate_residual(const System<N>& system, bool symmetric, bool extended, ModalBasis<N>& basis,
                       BasisResidual<N>& residual, Work& work) noexcept {
  const std::int64_t products_work = cubed(system.dof(), extended ? kExtendedWork : kProductsWork);
  const std::int64_t inverse_work = cubed(system.dof(), kInverseWork);
  if (!work.take(cubed(system.dof(), kDefectWork) + products_work +
                 (symmetric ? 0 : inverse_work))) {
    return;
  }
  if (system.dof() == 0) {
    residual = BasisResidual<N>{};
    basis.Y = basis.U;
    basis.Gamma = basis.weight = basis.Lambda;
    return;
  }
  times_blocks<N>(basis.U, basis.Lambda, basis.blocks, residual.V);
  multiply(system.mass, basis.U, residual.MU);
  multiply(system.damping, basis.U, residual.CU);
  multiply(system.stiffness, basis.U, residual.KU);
  times_blocks<N>(residual.MU, basis.Lambda, basis.blocks, residual.MV);
  if (symmetric) {
    basis.Y = basis.U;
    basis.Gamma = basis.Lambda;
  } else {
    dual_basis<N>(residual, basis);
  }
  double contraction = evaluate_products<N>(system, extended, basis, residual);
  if (symmetric && !(contraction < kOrthogonal)) {
    if (!work.take(inverse_work + 2 * products_work)) return;
    orthogonalize_left<N>(residual.gram, basis);
    const double dual_contraction = evaluate_products<N>(system, extended, basis, residual);
    if (dual_contraction < contraction) {
      contraction = dual_contraction;
    } else {
      basis.Y = basis.U;
      basis.Gamma = basis.Lambda;
      contraction = evaluate_products<N>(system, extended, basis, residual);
    }
  }
  multiply(residual.YT, residual.R, residual.W);
  residual.F = -residual.W;
  if (!(contraction < kNearlyOrthogonal) || !in_range(system, basis)) {
    // Far from orthogonal, the basis needs all of the Gram matrix, and proves nothing. Nor do
    // numbers whose products leave the range of doubles.
    State<N> gram = residual.gram;
    solve_in_place(gram, residual.F, std::numeric_limits<double>::min());
    residual.F_error.setConstant(std::numeric_limits<double>::infinity());
    return;
  }
  // |F* - F| <= |weight| |error of Y'R|, then the Gram matrix's distance from block form.
  weigh<N>(basis.weight, basis.blocks, residual.F);
  bound_residual<N>(system, extended, basis, residual);
  residual.YT = residual.YT.cwiseAbs();
  multiply(residual.YT, residual.R_size, residual.F_error);
  const State<N> weight_size = basis.weight.cwiseAbs();
  weigh<N>(weight_size, basis.blocks, residual.F_error);
  const StateVector<N> E_rows = residual.E.rowwise().maxCoeff();
  for (Eigen::Index j = 0; j < residual.F.cols(); ++j) {
    const double column =
        (residual.F.col(j).cwiseAbs() + residual.F_error.col(j)).sum() / (1 - contraction);
    residual.F_error.col(j) = (1 + 1e-10) * (residual.F_error.col(j) + E_rows * column);
  }
}

template void evaluate_residual(const System<kDynamic>&, bool, bool, ModalBasis<kDynamic>&,
                                BasisResidual<kDynamic>&, Work&) noexcept;
template void evaluate_residual(const System<kMaxDof>&, bool, bool, ModalBasis<kMaxDof>&,
                                BasisResidual<kMaxDof>&, Work&) noexcept;

}  // namespace dashpot::analysis
