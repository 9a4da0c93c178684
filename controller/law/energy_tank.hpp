#pragma once
#include <dashpot/controller/law/impedance_law.hpp>

#include <array>

namespace dashpot::controller {

/// Bounds the energy that the controller gives to arm and surroundings, see Energy.
///
/// A torque is constant between two ticks, so that its work tau' (q_k+1 - q_k) is exact whatever
/// the arm did in between. Of what Energy::store allows, the tank holds
///     S = store - sum of (tau' dq - dU - friction dissipated),
/// where dU = 1/2 (g_k + g_k+1)' dq is the change of the potential energy whose torque the
/// controller compensates. E is the energy of the springs as they are stretched now,
///     E = 1/2 (e_q' K_q e_q + e' K_C e + e_0' K_0 e_0).
/// A torque acts for a tick and the delay, is smoothed by the drives' low-pass and fades no faster
/// than its rate allows. With M = L L', it changes |L' qd| by at most the integral P of |L^-1 tau|
/// until it is gone, so that it spends at most |L' qd| P + P^2 / 2, whatever contacts that have no
/// energy do to the velocity.
/// - The torques under way and the new one spend at most S - reserve.
/// - Springs act with a share s of at most (S - reserve) / E of their torque: they cannot release
///   more than there is. Gains that grow and references that move away so wait for energy.
/// - Feed-forward, and what dampers add because references move, spend what springs leave.
/// - What dampers would do if no reference moved acts in full, and what they dissipate returns to
///   S, which is at most store + s E.
/// - The weight is extrapolated to the time at which the torque acts, by a low-pass of that delay.
/// While no springs act, the brake has its torque, and what it dissipates fills the tank likewise.
/// In a window of T = 50 ms, viscous friction of the model counts with b dq^2 / T, which it
/// dissipates at least, and Coulomb friction with c (|dq| - 0.0028 rad/s T), less than
/// c tanh(v / 0.01 rad/s) dissipates.
class EnergyTank {
 public:
  EnergyTank(const RobotModel& model, const Settings& settings);

  bool on() const noexcept { return store_ > 0; }
  /// Fills the tank, and forgets the torques.
  void reset() noexcept;
  /// Fills the tank; the torques under way still count.
  void fill() noexcept;
  /// Counts the work since the last tick. `weight`: the gravity torque that is compensated, n; of
  /// the `same_body` at the tip as in the last tick.
  void count_work(const JointVector& q, const JointMatrix& M, const JointVector& weight, double dt,
                  bool same_body) noexcept;
  /// Scales a torque of the law, in place. True if that changed it.
  bool limit(const ImpedanceLaw::Input& law, const JointVector& weight, LawTorque& asked) noexcept;
  /// No springs act.
  void no_springs() noexcept { committed_ = 0, share_ = 1; }
  /// Remembers a torque that was put out.
  void apply(const JointVector& torque) noexcept;

  /// Returns S, J.
  double level() const noexcept { return level_; }
  /// Returns the share s of the springs.
  double share() const noexcept { return share_; }
  /// Returns the springs and dampers that act, of those that are given.
  const Impedance& active(const Impedance& given) const noexcept {
    return share_ < 1 ? weakened_ : given;
  }

 private:
  static constexpr std::size_t kMostDelay = Analysis::Sampled::kMostDelay;

  /// Returns |L^-1 torque|.
  double size(JointVector torque) const noexcept;
  /// Returns the integral of |L^-1 tau| of the torques that were put out and still act.
  double under_way() const noexcept;

  double store_;                  ///< J; 0: there is no tank
  double period_, lag_, passed_;  ///< s; of the drives' low-pass: s, share that passes in a tick
  double late_;                   ///< s, the middle of a tick's torque
  double level_ = 0, committed_ = 0, share_ = 1;
  Impedance weakened_;
  std::size_t delay_, applied_ = 0;  ///< ticks; torques that were put out
  bool known_ = false;               ///< q_ and weight_
  JointVector per_rate_;             ///< s/(N m)
  JointVector viscous_, coulomb_;
  JointVector q_, weight_, acting_, smoothed_weight_;
  double window_ = 0;  ///< s
  JointVector window_q_;
  SmallCholesky mass_;
  std::array<JointVector, kMostDelay + 1> torques_;
  std::array<double, kMostDelay + 1> sizes_{};  ///< |L^-1 tau| of them beyond the weight
};

}  // namespace dashpot::controller
