#pragma once
#include <dashpot/analysis/gears.hpp>
#include <dashpot/analysis/mode.hpp>

#include <Eigen/Core>
#include <array>
#include <vector>

namespace dashpot::analysis {

/// Linear states w (m) of a controller beside its springs and dampers, such as integrals of an
/// error, which step once a tick:
///     w_k+1 = state w_k + position q_k,   and  -output w_k  is added to the command.
struct ControllerMemory {
  Eigen::MatrixXd state;     ///< m x m
  Eigen::MatrixXd position;  ///< m x n
  Eigen::MatrixXd output;    ///< n x m
};

/// The parts between the springs and dampers of a controller and the joints.
struct SampledLoop {
  double period = 0.001;             ///< T, of the control loop, s
  int delay = 0;                     ///< d, ticks from a command to its effect, beyond the hold
  double torque_cutoff = 0;          ///< f_c, of the torque's first-order low-pass, Hz; 0: none
  bool difference_velocity = false;  ///< the controller uses (q_k - q_k-1) / T as q'
  /// D, n x n, N m s/rad: the part of the damping that the joints supply. Empty: none.
  Eigen::MatrixXd friction = {};
  /// G, n x n, N m/rad: the stiffness of the robot that the controller compensates, such as dg/dq,
  /// the gradient of gravity. Empty: none.
  Eigen::MatrixXd gravity_gradient = {};
  /// H, n x n, N m/rad: what the controller commands against gravity, H q_k. Empty: G, at the
  /// positions where gravity acts. Differs from G if gravity does not act on the measured
  /// positions.
  Eigen::MatrixXd compensation = {};
  /// P, n x n, N m/rad: the part of the stiffness K that the world supplies, such as the springs of
  /// a contact. Empty: none.
  Eigen::MatrixXd passive_stiffness = {};
  ControllerMemory memory = {};  ///< m = 0: none
  /// Motions slower than this, rad/s, do not count in a gain margin. A self-motion that the
  /// compensation of gravity feeds through the hold and the delay grows that slowly.
  double slowest = 0;
  /// Elastic joints. The system and all of the above are then in joint coordinates, friction
  /// belongs to the gears and acts on the motors' side, and the modes belong to the system of
  /// Gears::extend. An elastic form with gears has to have been extended already, see with_gears.
  Gears gears = {};
};

/// Returns the loop in the coordinates of its gears, without gears: with their springs and dampers
/// among the passive ones, and gravity, which acts on the links, compensated where it is measured.
/// Returns the loop as it is if it has none.
SampledLoop with_gears(const SampledLoop& loop);

/// A mode of the loop that is closed once a tick. A mode with a real and negative z alternates: its
/// frequency and ratio follow from the larger such z alone, with an imaginary part of pi / T.
struct SampledMode {
  std::array<Complex, 2> discrete_eigenvalues{};  ///< z: a complex pair or two real ones
  std::array<Complex, 2> eigenvalues{};  ///< log(z) / T, 1/s: a complex pair, or of two real z
  double natural_frequency = 0;          ///< rad/s; NaN if the eigenvalues' product is negative
  double damping_ratio = 0;
  double damped_frequency = 0;  ///< rad/s
  ModeKind kind = ModeKind::kUnderdamped;
};

struct SampledSpectrum {
  std::vector<SampledMode> modes;   ///< with the indices of the continuous modes they come from
  std::vector<Complex> zero_modes;  ///< z of the velocities along the zero modes that are damped
  std::vector<Complex> memory;      ///< z of the m states of SampledLoop::memory, nearest to the
                                    ///< eigenvalues of state - position K^-1 output, the motion at
                                    ///< rest; one more if a pair would be torn
  std::vector<Complex> others;      ///< z of the loop's own memory: delay, filter, last position
  /// Largest |z| except for z = 1 of the zero modes: of their positions, and of their undamped
  /// velocities. The loop is stable if it is below 1.
  double spectral_radius = 0;

  bool stable() const noexcept { return spectral_radius < 1; }
};

}  // namespace dashpot::analysis
