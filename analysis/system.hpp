#pragma once
#include <dashpot/analysis/matrix_types.hpp>
#include <dashpot/analysis/system/checks.hpp>

namespace dashpot::analysis {

/// W (rows x n) with K = W' W; at most N + 6 rows: six task directions and the joints.
template <int N>
using StiffnessFactor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor,
                                      N == kDynamic ? kDynamic : N + 6, N>;

/// A linear second-order system  M q'' + C q' + K q = f  (paper, Eq. 1) with n coordinates q.
///
/// M is symmetric positive definite, C and K are square. SI units: for joint coordinates in rad,
/// M in kg m^2, C in N m s/rad, K in N m/rad. C and K are symmetric for an ordinary mechanical
/// system. Where they are not (`symmetric()` is false), the general problem is solved.
template <int N = kDynamic>
struct System {
  Square<N> mass;
  Square<N> damping;
  Square<N> stiffness;

  /// Optional factor W (rows x n) with stiffness = W'W. With it, the zero modes and small
  /// frequencies are found from the singular values of W L^-T (M = L L'), and no digit is lost
  /// because nothing is squared. No rows: not given.
  StiffnessFactor<N> stiffness_factor;

  /// Optional low words: the exact coefficients are damping + damping_low and
  /// stiffness + stiffness_low, and a stiffness factor is rounded. They hold the rounding errors
  /// made when the coefficients were formed from others, such as K = J' K_C J. They are read only
  /// if `has_low_words`. The proved error bounds rely on |low word| <= eps |coefficient| in every
  /// entry.
  Square<N> damping_low;
  Square<N> stiffness_low;
  bool has_low_words = false;

  /// Optional entrywise bounds of |true coefficient - given coefficient|, low words included, none
  /// negative. No rows: exact. The proved bounds of a spectrum hold for every system within them,
  /// symmetric or not. Where one is not zero, ModeTracker solves directly on each call.
  Square<N> mass_error;
  Square<N> damping_error;
  Square<N> stiffness_error;

  System() : System(0) {}
  explicit System(Eigen::Index n)
      : mass(Square<N>::Identity(n, n)),
        damping(Square<N>::Zero(n, n)),
        stiffness(Square<N>::Zero(n, n)),
        stiffness_factor(0, n) {}

  /// Returns n.
  Eigen::Index dof() const { return mass.rows(); }
  /// True if damping and stiffness equal their transposes exactly.
  bool symmetric() const {
    return damping == damping.transpose() && stiffness == stiffness.transpose();
  }
};

/// Throws InvalidSystem unless the coefficients are square, of one size and finite, and the mass is
/// symmetric positive definite. n = 0 is a valid system without modes.
void validate(const System<>& system);

}  // namespace dashpot::analysis
