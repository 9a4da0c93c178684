#pragma once
#include <dashpot/analysis/spectrum/spectrum_result.hpp>

#include <optional>

namespace dashpot::analysis {

/// Position and velocity at one time, split into the motion along the zero modes (q_zero = U0 U0' M
/// q) and the rest (paper, Eqs. 6 and 37): q = q_zero + q_nonzero.
struct Motion {
  Eigen::VectorXd position;            ///< n
  Eigen::VectorXd velocity;            ///< n
  Eigen::VectorXd zero_mode_position;  ///< n
  Eigen::VectorXd zero_mode_velocity;  ///< n
};

/// Causes of a motion, n entries each; a cause that is not given is zero.
struct Cause {
  std::optional<Eigen::VectorXd> position;  ///< q(0)
  std::optional<Eigen::VectorXd> velocity;  ///< q'(0)
  std::optional<Eigen::VectorXd> impulse;   ///< generalized, at t = 0, N s or N m s
  std::optional<Eigen::VectorXd> force;     ///< generalized, constant from t = 0 on, N or N m
};

/// Computes closed-form responses of a linear system from its modal basis. Any time costs the same
/// and is equally accurate, because there is no time stepping. Responses superpose: add what you
/// need.
///
/// Each block of the basis moves as exp(Lambda t): decaying cosines and sines for a complex pair, a
/// smooth divided-difference form at critical damping, b0 + (1 - exp(-a t)) b1 / a for a zero mode
/// (paper, Eq. 24) and b0 + b1 t if undamped (Eq. 26).
///
/// Times are in s and finite; times of forced responses are not negative. Positions, velocities and
/// forces have n entries. Anything else throws std::invalid_argument.
class Response {
 public:
  /// Copies what it needs of both arguments. The spectrum has to belong to the system and have
  /// modes (its status is kOk or kUncertified); throws std::invalid_argument otherwise.
  Response(const System<>& system, const Spectrum<>& spectrum);

  /// Returns the free response to q(0), q'(0) (paper, Eqs. 24, 26, 32); at t = 0 these themselves.
  Motion free(const Eigen::VectorXd& position, const Eigen::VectorXd& velocity, double time) const;
  /// Returns the response from rest to a generalized impulse at t = 0 (N s or N m s), for t >= 0
  /// (paper, Eq. 49).
  Motion impulse(const Eigen::VectorXd& impulse, double time) const;
  /// Returns the response from rest to a generalized force that is constant from t = 0 on.
  Motion step(const Eigen::VectorXd& force, double time) const;
  /// Returns the sum of the responses to all that the cause names.
  Motion caused(const Cause& cause, double time) const;

  /// Returns the receptance  H(omega) = (K + i omega C - omega^2 M)^-1, n x n, by modal
  /// superposition. If i omega is an eigenvalue exactly, the entries that this mode reaches are
  /// infinite.
  Eigen::MatrixXcd receptance(double omega) const;

 private:
  Eigen::VectorXd drive_of(const Eigen::VectorXd& force, const char* name) const;
  Eigen::MatrixXd phi_of_basis(int k, double time) const;
  Motion motion(const Eigen::VectorXd& xi) const;
  Motion motion(const Eigen::VectorXd& position, const Eigen::VectorXd& velocity) const;

  Eigen::MatrixXd mass_;
  Eigen::MatrixXd damping_;
  ModalBasis<> basis_;
  Eigen::MatrixXd velocity_basis_;  // U Lambda
  Eigen::MatrixXd zero_projector_;  // U0 U0' M
};

/// How a motion is made up of the m modes of a spectrum, in their order.
///
/// The motion is the sum of q_i(t) = U_i exp(Lambda_i t) xi_i, mode i's own free motion, and of the
/// drift along the zero modes. After a step it is the motion about the new rest. With
///     E_i = (q_i' K q_i + v_i' M v_i) / 2 at t = 0,    v_i the velocity of q_i,
/// the share of mode i is E_i / (sum of all E). Shares add up to one. They do not contain the cross
/// terms q_i' K q_k + v_i' M v_k, which vanish where the undamped modes decouple the damping.
struct ModeShares {
  Eigen::VectorXd energy;  ///< m; NaN if nothing moves. Within [0, 1] unless K is indefinite
  double zero_modes = 0;   ///< share of the drift along zero modes, without the drift of a step
  /// (energy of the whole motion - sum of all E) / (sum of all E)
  double cross = 0;
  /// Largest |p_k| of each point's coordinate k and mode in t >= 0, in the motion p = J q_i(t) of
  /// that mode alone; rows of J x m. Infinite for an unstable mode that moves it.
  Eigen::MatrixXd amplitude;
};

/// Returns how the motion that a cause sets off is made up. `points` is J (p x n), the Jacobian of
/// the coordinates of which the amplitude is wanted; the identity for q itself. Modes that no
/// well-conditioned basis separates share their motion evenly. Throws std::invalid_argument as
/// Response does, and if J has not n columns.
ModeShares mode_shares(const System<>& system, const Spectrum<>& spectrum, const Cause& cause,
                       const Eigen::MatrixXd& points);

}  // namespace dashpot::analysis
