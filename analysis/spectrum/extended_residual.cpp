#include <dashpot/analysis/linalg/double_double.hpp>
#include <dashpot/analysis/spectrum/extended_residual.hpp>

#include <array>
#include <type_traits>
#include <vector>

namespace dashpot::analysis {
namespace {

/// A table of double-doubles, n x 2n, that allocates only when N is kDynamic.
template <int N>
class WideDoubleDouble {
 public:
  explicit WideDoubleDouble(Eigen::Index n) : rows_(n) {
    if constexpr (N == kDynamic) items_.resize(static_cast<std::size_t>(2 * n * n));
  }
  DoubleDouble& operator()(Eigen::Index i, Eigen::Index j) {
    return items_[static_cast<std::size_t>(j * rows_ + i)];
  }

 private:
  Eigen::Index rows_;
  std::conditional_t<
      N == kDynamic, std::vector<DoubleDouble>,
      std::array<DoubleDouble, static_cast<std::size_t>(N == kDynamic ? 1 : 2 * N * N)>>
      items_;
};

/// X Lambda in double-double arithmetic, X(i, j) giving doubles or double-doubles.
template <int N, typename Left>
WideDoubleDouble<N> times_blocks_extended(Left&& X, const ModalBasis<N>& basis) {
  const Eigen::Index n = basis.U.rows();
  WideDoubleDouble<N> out(n);
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

}  // namespace

template <int N>
void evaluate_extended(const System<N>& system, const ModalBasis<N>& basis, const Wide<N>& YG,
                       Wide<N>& R, State<N>& gram) noexcept {
  const Eigen::Index n = system.dof();
  WideDoubleDouble<N> V = times_blocks_extended<N>(basis.U, basis);
  WideDoubleDouble<N> A = times_blocks_extended<N>(V, basis);
  WideDoubleDouble<N> momentum(n), tested(n);
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

template void evaluate_extended(const System<kDynamic>&, const ModalBasis<kDynamic>&,
                                const Wide<kDynamic>&, Wide<kDynamic>&, State<kDynamic>&) noexcept;
template void evaluate_extended(const System<kMaxDof>&, const ModalBasis<kMaxDof>&,
                                const Wide<kMaxDof>&, Wide<kMaxDof>&, State<kMaxDof>&) noexcept;

}  // namespace dashpot::analysis
