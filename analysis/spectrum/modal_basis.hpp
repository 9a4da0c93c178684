#pragma once
#include <dashpot/analysis/matrix_types.hpp>

namespace dashpot::analysis {

/// One invariant subspace of the system: columns [first, first + size) of the basis.
struct Block {
  int first = 0;
  int size = 0;
  /// True for a zero-mode block. It has two columns and Lambda = [0 1; 0 -a], the position and
  /// velocity of a zero mode whose velocity decays with rate a. Or it has one column and
  /// Lambda = 0, a position only, if the velocity belongs to another block. Other blocks have
  /// nonzero eigenvalues: 1 column for a real one, 2 for a complex pair or for a pair of real ones
  /// that (nearly) coincide. They have more columns where eigenvalues of different modes coincide
  /// so closely that no well-conditioned basis separates them.
  bool zero_mode = false;
};

template <int N>
using BlockList = BoundedList<Block, kTwice<N>>;

/// A real basis of the 2n-dimensional state space (q, q') in which the system is block diagonal
/// with small blocks. With U (n x 2n) and the block-diagonal Lambda (2n x 2n),
///
///     M U Lambda^2 + C U Lambda + K U = 0,
///
/// so that q(t) = U exp(Lambda t) xi and q'(t) = U Lambda exp(Lambda t) xi solve the free system
/// for every xi (2n). The basis stays well conditioned where eigenvectors do not exist (critical
/// damping).
///
/// The left basis (Y, Gamma) does the same for the transposed system. With Z = [U; U Lambda],
/// Z_left = [Y; Y Gamma] and B = [C M; M 0], Z_left' B Z is block diagonal with inverse `weight`.
/// The coordinates of the state (q, v), and the drive of a generalized force f, are
///
///     xi = weight (Y' (C q + M v) + Gamma' Y' M q),      xi' = Lambda xi + weight Y' f.
///
/// For a symmetric system Y = U and Gamma = Lambda.
template <int N = kDynamic>
struct ModalBasis {
  Wide<N> U;        ///< n x 2n, right (position) part; the velocity part is U Lambda
  State<N> Lambda;  ///< 2n x 2n, block diagonal, 1/s
  Wide<N> Y;        ///< n x 2n, left part
  State<N> Gamma;   ///< 2n x 2n, block diagonal, 1/s
  State<N> weight;  ///< 2n x 2n, block diagonal
  BlockList<N> blocks;
};

/// Returns the coordinates xi (2n) of the state (position, velocity), refined once so that
/// U xi = position and U Lambda xi = velocity to rounding.
template <int N>
StateVector<N> coordinates(const ModalBasis<N>& basis, const Square<N>& mass,
                           const Square<N>& damping, const Vector<N>& position,
                           const Vector<N>& velocity);

/// Returns weight Y' f, which a generalized force f (N m) adds to xi'. It is also the jump of xi
/// that a generalized impulse f (N m s) gives.
template <int N>
StateVector<N> drive(const ModalBasis<N>& basis, const Vector<N>& f);

}  // namespace dashpot::analysis
