#pragma once
#include <dashpot/analysis/linalg/invariant_subspaces.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/spectrum/modal_basis.hpp>
#include <dashpot/analysis/system/energy_form.hpp>
#include <dashpot/analysis/work.hpp>

#include <type_traits>

namespace dashpot::analysis {

/// Inverse iteration u <- Q^-1 u, normalised, from a vector of n ones. `form` sets Q, which is
/// singular to rounding, so that a good step grows u by about 1 / (eps |Q|). It ends with a step
/// that grows u by more than `good`, after three steps, or where `work` does.
template <typename Matrix, typename Form>
auto inverse_iteration(Matrix& Q, Eigen::Index n, double least_pivot, double good, Work& work,
                       const Form& form) {
  using Scalar = typename Matrix::Scalar;
  constexpr int kFactor = std::is_same_v<Scalar, Complex> ? 2 : 1;
  Eigen::Matrix<Scalar, Eigen::Dynamic, 1, Eigen::ColMajor, Matrix::MaxRowsAtCompileTime, 1> u(n);
  u.setOnes();
  for (int k = 0; k < 3; ++k) {
    if (!work.take(kFactor * (cubed(n, 2) + squared(n, 24) + 60 * n) + 2500)) break;
    form();
    solve_in_place(Q, u, least_pivot);
    const double growth = u.norm();
    u /= growth;
    if (growth > good) break;
  }
  return u;
}

/// An eigenvalue of the core; a complex pair is represented by its upper half.
struct CoreEigenvalue {
  Complex value;
  int cluster = 0;         ///< shared by eigenvalues that are close together
  bool zero_rate = false;  ///< the velocity of a coupled zero mode
};

/// Eigenvalues of the core of an energy form: the nonzero modes, and the zero modes that the
/// damping couples to them.
template <int N>
class CoreEigenvalues {
 public:
  /// Forms A = [0 G; -G' -D], the time derivative of [elastic coordinates; velocities]. Reads
  /// `form` until it is destroyed.
  CoreEigenvalues(const EnergyForm<N>& form, const ZeroModes<N>& zero_modes) noexcept;

  /// Finds the eigenvalues by QR iteration, and their clusters: those within the relative distance
  /// `cluster` of each other, directly or by way of others. With `rates_apart` rates of zero modes
  /// that nothing couples to others are in clusters only with what hardly differs from them.
  /// Returns false if the iteration fails or `work` does not grant it.
  bool find(double cluster, bool rates_apart, Work& work) noexcept;

  const BoundedList<CoreEigenvalue, kTwice<N>>& items() const { return items_; }

  const State<N>& matrix() const { return A_; }
  /// Rounding errors of eigenvalues (1/s): rates of zero modes within this distance of each other
  /// or of zero are equal.
  double rounding() const { return 64 * kEps * A_norm_; }

  /// Returns the eigenvector of A to a real eigenvalue, of unit length.
  StateVector<N> vector(double value, Work& work) const noexcept;

 private:
  bool find_items(Work& work) noexcept;
  bool replace_slow(ComplexStateVector<N>& values, Work& work) noexcept;
  void find_clusters(double cluster, bool rates_apart) noexcept;
  Square<N> unsprung() const noexcept;
  bool mark_zero_rates(Work& work) noexcept;

  const EnergyForm<N>& form_;
  int coupled_zeros_;
  Eigen::Index m_, c_;
  State<N> A_;
  double A_norm_ = 0;
  BoundedList<CoreEigenvalue, kTwice<N>> items_;
};

/// Columns that make a small matrix block diagonal. Unlike the blocks of a ModalBasis none is a
/// zero mode.
template <int N>
struct SplitCluster : Separation<N> {
  BlockList<N> blocks;
};

/// Splits the matrix of a cluster, with the eigenvalues `values` (of complex pairs the upper half)
/// about `mean`, as far as that is well conditioned: into any orthonormal directions where all
/// eigenvalues coincide to rounding without being defective; else into eigenvectors and planes of
/// conjugate eigenvalues, if they are well apart; else into planes of two eigenvalues, which near
/// critical damping are the modes, also where several coincide; else not at all. With `coinciding`
/// the latter come first.
template <int N>
SplitCluster<N> split_cluster(const State<N>& small, const ComplexStateVector<N>& values,
                              Complex mean, bool coinciding) noexcept;

}  // namespace dashpot::analysis
