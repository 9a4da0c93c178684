#pragma once
#include <dashpot/sim/hardware/noise.hpp>
#include <dashpot/sim/integrator.hpp>
#include <dashpot/sim/simulated_system.hpp>
#include <dashpot/sim/step_status.hpp>

#include <cstdint>
#include <limits>
#include <vector>

namespace dashpot::sim {

/// A fault of the feedback from `begin` until just before `end`, s. Members that are zero, empty or
/// false have no effect.
struct SensorFault {
  double begin = 0;
  double end = std::numeric_limits<double>::infinity();
  JointVector position_offset;    ///< n, rad; added to the positions, before they are differenced
  JointVector velocity_factor;    ///< n; the velocities are multiplied by it
  bool frozen = false;            ///< positions and velocities stay as shown before `begin`
  bool not_a_number = false;      ///< all positions are NaN
  std::int64_t clock_offset = 0;  ///< ns, added to the time stamp
};

/// The parts between controller and mechanism. A part that is off (zero or empty) costs nothing.
struct PlantOptions {
  double period = 0.001;  ///< of the control loop, s
  IntegratorOptions integrator;

  // From command to torque, in this order. Vectors have n entries, or no entries for off.
  JointVector torque_limit;  ///< N m; infinity for a joint without one
  int delay = 0;             ///< ticks from a command to its effect, beyond the hold
  /// Cutoff frequency of a first-order low-pass, Hz: torque += (1 - exp(-2 pi f T)) (command -
  /// torque) once a tick of T s, which is the exact filter of a held input at the tick's end.
  double torque_cutoff = 0;
  JointVector initial_torque;  ///< n, N m; in the delay and the filter at the start; empty: zero

  // From motion to measurement, in this order:
  JointVector position_noise;        ///< standard deviation, rad
  JointVector velocity_noise;        ///< standard deviation, rad/s; not if differenced
  JointVector position_resolution;   ///< rad per count; measured positions are multiples of it
  bool difference_velocity = false;  ///< (position - last position) / period, as measured
  std::uint64_t seed = 1;            ///< of the noise
  std::vector<SensorFault> faults;
};

/// The sensor readings of a tick.
struct Measurement {
  std::int64_t time = 0;  ///< since the start, ns
  JointVector position;   ///< rad or m
  JointVector velocity;   ///< rad/s or m/s
  JointVector torque;     ///< that the drives exerted in the period before, N m
};

/// The energy balance since the start, in J.
struct EnergyAudit {
  StoredEnergy initial;
  StoredEnergy stored;       ///< now
  double by_actuators = 0;   ///< in
  double by_world = 0;       ///< in, external wrenches or forces
  double viscous_heat = 0;   ///< out
  double friction_heat = 0;  ///< out, Coulomb
  double contact_heat = 0;   ///< out, dampers of stops and wall
  double gear_heat = 0;      ///< out, dampers of elastic gears

  double work_in() const noexcept { return by_actuators + by_world; }
  double dissipated() const noexcept {
    return viscous_heat + friction_heat + contact_heat + gear_heat;
  }
  /// Returns the error of the energy balance, which is of the integrator's order.
  double imbalance() const noexcept {
    return stored.sum() - initial.sum() - work_in() + dissipated();
  }
};

/// A mechanism with its drives and sensors, moved one control period at a time:
///     Plant plant(arm, options, q, qd);
///     while (...) plant.step(torque_for(plant.measured()));
/// Equal calls give equal bits. step() allocates nothing. The system must outlive the plant,
/// and no two plants may share a system.
class Plant {
 public:
  /// Starts where the sensors show q and qd, with elastic gears at rest under the weight, or at the
  /// coordinates q with the velocities qd, if they have an entry for each of the system's
  /// coordinates. Starts at rest if qd is empty. Throws InvalidScene.
  Plant(System& system, const PlantOptions& options, const JointVector& q,
        const JointVector& qd = {});
  Plant(const Plant&) = delete;
  Plant& operator=(const Plant&) = delete;

  /// Moves through one period with the torque commanded now, N m. Unless the status is kOk, nothing
  /// has changed.
  Status step(const JointVector& command) noexcept;
  /// Moves through one period in which a hand or a brake, and not the torque, brings the robot to
  /// where the sensors show q and qd, n entries each. The energy counts as the world's work.
  void carry(const JointVector& q, const JointVector& qd) noexcept;

  const Measurement& measured() const noexcept { return measured_; }

  // The true state, which a controller does not see:
  JointVector position() const { return y_.head(system_->dof()); }
  JointVector velocity() const { return y_.segment(system_->coordinates(), system_->dof()); }
  const StateVector& state() const noexcept { return y_; }
  /// Returns the torque that the drives held in the last period, N m.
  const JointVector& torque() const noexcept { return torque_; }
  std::int64_t ticks() const noexcept { return ticks_; }
  /// Returns the time since the start, s.
  double time() const noexcept { return static_cast<double>(ticks_) * options_.period; }
  EnergyAudit audit() const noexcept;

 private:
  /// A stage on the way from command to torque or from motion to measurement.
  using Stage = void (*)(Plant& plant) noexcept;
  static void limit(Plant& plant) noexcept;
  static void delay(Plant& plant) noexcept;
  static void filter(Plant& plant) noexcept;
  static void add_position_noise(Plant& plant) noexcept;
  static void add_velocity_noise(Plant& plant) noexcept;
  static void quantise(Plant& plant) noexcept;
  static void shift_positions(Plant& plant) noexcept;
  static void difference(Plant& plant) noexcept;
  static void spoil(Plant& plant) noexcept;
  bool acts(const SensorFault& fault) const noexcept;

  Status move(StateVector& y) noexcept;
  void measure() noexcept;

  System* system_;
  PlantOptions options_;
  Integrator integrator_;
  std::vector<Stage> actuation_;  // stages of these options
  std::vector<Stage> sensing_;
  std::int64_t ticks_ = 0;
  StateVector y_;
  StoredEnergy initial_;
  Measurement measured_;

  // States of the stages:
  JointVector torque_;  // on its way from the command, then as exerted
  JointVector filtered_;
  double filter_gain_ = 0;
  std::vector<JointVector> delayed_;  // ring
  std::size_t oldest_ = 0;
  JointVector last_position_;  // as measured
  Measurement shown_;          // at the tick before
  Noise noise_;
};

}  // namespace dashpot::sim
