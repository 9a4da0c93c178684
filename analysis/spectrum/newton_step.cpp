// Newton's step of refinement.hpp, and the Sylvester equations that it solves.
#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/block_sylvester.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/spectrum/refinement.hpp>

#include <limits>

namespace dashpot::analysis {
namespace {

template <typename Matrix>
Block2<double> block2(const Matrix& A) {
  return {A(0, 0), A(0, 1), A(1, 0), A(1, 1)};
}

/// Lower bound of sep(A, B) for B of 2 x 2 and A of 1 x 1 or 2 x 2.
template <typename Left, typename Right>
double small_separation(const Left& A, const Right& B) noexcept {
  const MeasuredBlock<double> two(block2(B));
  const double least =
      A.rows() == 1 ? separation(A(0, 0), two) : separation(MeasuredBlock<double>(block2(A)), two);
  return least > 0 ? least : 0;  // 0 if not a number
}

}  // namespace

template <int N>
double solve_sylvester(const Eigen::Ref<const State<N>>& A, const Eigen::Ref<const State<N>>& B,
                       const State<N>& C, State<N>& X) noexcept {
  const Eigen::Index k = A.rows(), l = B.rows();
  if (k <= 2 && l == 2) {
    X.setZero(k, l);
    const double separation = small_separation(A, B);
    if (!(separation > 0)) return 0;
    if (k == 1) {  // X (x - B) = C
      const double x = A(0, 0);
      const double p = (x - B(0, 0)) * (x - B(1, 1)) - B(0, 1) * B(1, 0);
      X << (C(0, 0) * (x - B(1, 1)) + C(0, 1) * B(1, 0)) / p,
          (C(0, 1) * (x - B(0, 0)) + C(0, 0) * B(0, 1)) / p;
    } else {
      const Block2<double> x = analysis::solve_sylvester(block2(A), block2(B), block2(C));
      X << x.a, x.b, x.c, x.d;
    }
    return separation;
  }
  if (k == 1 && l == 1) {
    const double gap = A(0, 0) - B(0, 0);
    X.setZero(1, 1);
    if (gap != 0) X(0, 0) = C(0, 0) / gap;
    return std::abs(gap);
  }
  // Others are rare: the Kronecker matrix of the map, where it fits the capacity.
  X.setZero(k, l);
  if (N != kDynamic && k * l > kTwice<N>) return 0;
  State<N> map = State<N>::Zero(k * l, k * l), inverse = State<N>::Identity(k * l, k * l);
  for (Eigen::Index j = 0; j < l; ++j) {
    map.block(j * k, j * k, k, k) = A;
    for (Eigen::Index i = 0; i < l; ++i) {
      map.block(j * k, i * k, k, k).diagonal().array() -= B(i, j);
    }
  }
  const double map_norm = map.norm();
  solve_in_place(map, inverse, std::numeric_limits<double>::min());
  const double rounding = static_cast<double>(k * l * k * l) * kUnit * map_norm;
  const double separation = 1 / inverse.norm() - rounding;
  if (!(separation > 0)) return 0;
  const StateVector<N> c = Eigen::Map<const StateVector<N>>(C.data(), k * l);
  const StateVector<N> x = inverse * c;
  X = Eigen::Map<const State<N>>(x.data(), k, l);
  return separation;
}

template <int N>
std::int64_t sylvester_work(const BlockList<N>& blocks) noexcept {
  std::int64_t units = 0;
  for (const Block& a : blocks) {
    for (const Block& b : blocks) {
      if (a.first >= b.first) continue;
      const std::int64_t unknowns = std::int64_t{a.size} * b.size;
      if (a.size <= 2 && b.size <= 2) {
        units += 250;
      } else if (a.size == 1 || b.size == 1) {
        units += cubed(unknowns, 4) + squared(unknowns, 40) + 500;
      } else if (N == kDynamic || unknowns <= kTwice<N>) {
        units += cubed(unknowns, 4) + squared(unknowns, 60);
      }
    }
  }
  return units;
}

template <int N>
double block_separation(const State<N>& Lambda, const Block& a, const Block& b) noexcept {
  if (a.size > 2 || b.size > 2) {
    State<N> unused;
    const State<N> zero = State<N>::Zero(a.size, b.size);
    return solve_sylvester<N>(Lambda.block(a.first, a.first, a.size, a.size),
                              Lambda.block(b.first, b.first, b.size, b.size), zero, unused);
  }
  if (a.size == 1 && b.size == 1)
    return std::abs(Lambda(a.first, a.first) - Lambda(b.first, b.first));
  // sep(A, B) = sep(B', A'): let B be 2 x 2.
  const Block& two = b.size == 2 ? b : a;
  const Block& other = b.size == 2 ? a : b;
  return small_separation(Lambda.block(other.first, other.first, other.size, other.size),
                          Lambda.block(two.first, two.first, 2, 2));
}

template <int N>
void newton_step(const BasisResidual<N>& residual, ModalBasis<N>& basis) noexcept {
  const Eigen::Index states = basis.U.cols();
  State<N> X = State<N>::Zero(states, states), right, x;
  // F from the whole Gram matrix: then U F = 0 holds to rounding, which keeps U (I + X) and its
  // velocities consistent even where blocks are nearly parallel.
  State<N> F = -residual.W, gram = residual.gram;
  solve_in_place(gram, F, std::numeric_limits<double>::min());
  for (const Block& bi : basis.blocks) {
    const auto A = basis.Lambda.block(bi.first, bi.first, bi.size, bi.size);
    for (const Block& bj : basis.blocks) {
      if (bi.first == bj.first) continue;
      const auto B = basis.Lambda.block(bj.first, bj.first, bj.size, bj.size);
      right = -F.block(bi.first, bj.first, bi.size, bj.size);
      const double separation = solve_sylvester<N>(A, B, right, x);
      // Common eigenvalues, as far as F can tell: no direction to part them by.
      if (separation > 0 && right.norm() < 0.3 * separation) {
        X.block(bi.first, bj.first, bi.size, bj.size) = x;
      }
    }
  }
  basis.U += (basis.U * X).eval();
  for (const Block& b : basis.blocks) {
    if (b.zero_mode && b.size == 2 && basis.Lambda(b.first + 1, b.first + 1) != 0) {
      basis.Lambda(b.first + 1, b.first + 1) += residual.F(b.first + 1, b.first + 1);
    }
  }
}

template double block_separation<kDynamic>(const State<kDynamic>&, const Block&,
                                           const Block&) noexcept;
template double block_separation<kMaxDof>(const State<kMaxDof>&, const Block&,
                                          const Block&) noexcept;
template std::int64_t sylvester_work<kDynamic>(const BlockList<kDynamic>&) noexcept;
template std::int64_t sylvester_work<kMaxDof>(const BlockList<kMaxDof>&) noexcept;
template void newton_step(const BasisResidual<kDynamic>&, ModalBasis<kDynamic>&) noexcept;
template void newton_step(const BasisResidual<kMaxDof>&, ModalBasis<kMaxDof>&) noexcept;
template double solve_sylvester<kDynamic>(const Eigen::Ref<const State<kDynamic>>&,
                                          const Eigen::Ref<const State<kDynamic>>&,
                                          const State<kDynamic>&, State<kDynamic>&) noexcept;
template double solve_sylvester<kMaxDof>(const Eigen::Ref<const State<kMaxDof>>&,
                                         const Eigen::Ref<const State<kMaxDof>>&,
                                         const State<kMaxDof>&, State<kMaxDof>&) noexcept;

}  // namespace dashpot::analysis
