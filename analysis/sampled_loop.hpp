#pragma once
#include <dashpot/analysis/spectrum.hpp>

#include <vector>

namespace dashpot::analysis {

/// What lies between the springs and dampers of a controller and the joints.
struct SampledLoop {
  double period = 0.001;             ///< T, of the control loop, s
  int delay = 0;                     ///< d, ticks from a command to its effect, beyond the hold
  double torque_cutoff = 0;          ///< f_c, of the torque's first-order low-pass, Hz; 0: none
  bool difference_velocity = false;  ///< the controller takes (q_k - q_k-1) / T for q'
  /// D, n x n, N m s/rad: the part of the damping that the joints supply. Empty: none.
  Eigen::MatrixXd friction = {};
  /// G = dg/dq, n x n, N m/rad: of the gravity that the controller compensates. Empty: none.
  Eigen::MatrixXd gravity_gradient = {};
};

/// A mode as it is with the loop closed once a tick.
struct SampledMode {
  std::array<Complex, 2> multipliers{};  ///< z: a complex pair or two real ones
  std::array<Complex, 2> eigenvalues{};  ///< log(z) / T, 1/s: a complex pair or two real ones
  double natural_frequency = 0;          ///< rad/s; NaN if the eigenvalues' product is negative
  double damping_ratio = 0;
  double damped_frequency = 0;  ///< rad/s
  ModeKind kind = ModeKind::kUnderdamped;
};

struct SampledSpectrum {
  std::vector<SampledMode> modes;   ///< in the places of the continuous modes they come from
  std::vector<Complex> zero_modes;  ///< z of the velocities along the zero modes that are damped
  std::vector<Complex> others;      ///< z of the loop's own memory: delay, filter, last position
  /// Largest |z| of all but the zero modes' z = 1: of their positions, and of the velocities along
  /// them that nothing damps. Below 1 the loop is stable.
  double spectral_radius = 0;

  bool stable() const noexcept { return spectral_radius < 1; }
};

/// The modes of  M q'' + C q' + K q = 0  where C and K act through a computer. The robot
///     M q'' + D q' + G q = f
/// moves under a torque f that is held from tick k to tick k + 1, and the controller commands
///     u_k = (G - K) q_k - (C - D) v_k,   v_k = q'_k, or (q_k - q_k-1) / T if differenced,
///     f_k = f_k-1 + (1 - exp(-2 pi f_c T)) (u_k-d - f_k-1),   or u_k-d without a filter.
/// The state x = (q, q', [v], u_k-d .. u_k-1, [f]) goes from tick to tick as x_k+1 = A x_k,
/// exactly: the robot's part of A is a matrix exponential. Its eigenvalues z are given as lambda =
/// log(z) / T, which compare with the continuous ones. To first order in omega T the hold acts like
/// a delay of T/2: natural_frequency grows by the factor 1 + zeta omega t and the damping ratio
/// falls by (1 - 2 zeta^2) omega t / 2, with t = (d + 1/2) T and the lag of the filter.
///
/// Every mode of `spectrum`, which has to be that of `system`, gets the z nearest to its
/// eigenvalues, moved by the loop's delays to first order, nearest pairs first; that is meaningful
/// while omega T stays well below 1. A z that is real and negative counts as one with an imaginary
/// part of pi / T.
///
/// For a lower rate than the tick's: allocates, and solves one dense eigenproblem of up to
/// (4 + d) n rows. Throws std::invalid_argument for matrices of other sizes or entries that are not
/// finite, a period that is not positive, a negative delay or cutoff, and a spectrum without modes
/// because of its status; std::runtime_error if the eigenvalue iteration does not converge.
template <int N>
SampledSpectrum sample_loop(const System<N>& system, const Spectrum<N>& spectrum,
                            const SampledLoop& loop);

/// The factor by which K and the controller's damping C - D may grow together before the loop
/// becomes unstable, to six digits: the first boundary above 1, searched in steps of a quarter;
/// infinite if there is none up to `most`. Where the loop is unstable as it is: the first boundary
/// below 1, zero if there is none down to 1e-3. Motions with |log z| / T below `slowest`, rad/s, do
/// not count: a self-motion that the held gravity compensation feeds is no vibration. Some tens of
/// eigenproblems. Throws like sample_loop.
template <int N>
double gain_margin(const System<N>& system, const Spectrum<N>& spectrum, const SampledLoop& loop,
                   double most = 1e6, double slowest = 0);

}  // namespace dashpot::analysis
