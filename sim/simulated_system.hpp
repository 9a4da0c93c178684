#pragma once
#include <dashpot/sim/joint_types.hpp>

#include <cstdint>

namespace dashpot::sim {

/// Inputs and outputs of energy, in J since the start; integrated with the motion.
enum WorkChannel : int {
  kByActuators,   ///< in
  kByWorld,       ///< in, by external wrenches or forces
  kViscousHeat,   ///< out
  kFrictionHeat,  ///< out, Coulomb
  kContactHeat,   ///< out, dampers of joint stops and of the wall
  kGearHeat,      ///< out, dampers of elastic gears
  kWorkChannels
};

/// The state that an integrator moves: N coordinates, their N velocities, and the work channels.
/// The first n coordinates are the positions of the joints.
using StateVector =
    Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 2 * kMaxJoints + kWorkChannels, 1>;

/// Returns N of a state.
inline Eigen::Index coordinates_of(const StateVector& y) noexcept {
  return (y.size() - kWorkChannels) / 2;
}

/// Stored energies, J.
struct StoredEnergy {
  double kinetic = 0;
  double gravity = 0;
  double springs = 0;  ///< of gears, stops and wall, or of the system's own springs
  double sum() const noexcept { return kinetic + gravity + springs; }
};

/// The modes of all contacts, two bits each.
using ContactModes = std::uint64_t;

/// A moving mechanism: y' = f(y) with y = (q, qd, work), where nothing but y changes within a
/// segment of time. Segments end where the torque or an external force jumps.
class System {
 public:
  System(const System&) = delete;
  System& operator=(const System&) = delete;
  virtual ~System() = default;

  /// Returns n.
  int dof() const noexcept { return static_cast<int>(torque_.size()); }
  /// Returns N, n and the coordinates that no torque acts on by itself.
  int coordinates() const noexcept { return coordinates_; }
  /// Sets the torque, which is held until the next call; n, N m.
  void set_torque(const JointVector& torque) noexcept { torque_ = torque; }

  /// Sets the coordinates and velocities of y such that the sensors show q and qd, n entries each,
  /// where the other coordinates are at rest under the weight.
  virtual void place(const JointVector& q, const JointVector& qd, StateVector& y) noexcept {
    y.head(q.size()) = q;
    y.segment(coordinates_, q.size()) = qd;
  }
  /// Returns what the sensors show at y: n positions and n velocities.
  virtual void read_sensors(const StateVector& y, JointVector& q, JointVector& qd) const noexcept {
    q = y.head(dof());
    qd = y.segment(coordinates_, dof());
  }

  /// Begins a segment at t (s), with the external forces of this time. Returns the time at which
  /// the next of them jumps, or infinity if none does.
  virtual double begin_segment(double t) noexcept = 0;
  /// Takes up the bodies that are carried, and the table that is touched, from t (s) on, before
  /// begin_segment. Returns their energy at y, J.
  virtual double take_loads(double /*t*/, const StateVector& /*y*/) noexcept { return 0; }
  /// Computes y' at y; both have 2N + kWorkChannels entries.
  virtual void rates(const StateVector& y, StateVector& y_dot) noexcept = 0;
  virtual StoredEnergy stored_energy(const StateVector& y) noexcept = 0;

  /// True if rates() is only piecewise smooth, with pieces that contact_modes() tells apart.
  virtual bool has_contacts() const noexcept { return false; }
  virtual ContactModes contact_modes(const StateVector&) noexcept { return 0; }
  /// Makes contacts keep these modes, whatever y is, until thaw(), so that rates() is smooth.
  virtual void freeze(ContactModes) noexcept {}
  virtual void thaw() noexcept {}

 protected:
  explicit System(int n) : System(n, n) {}
  System(int n, int coordinates) : torque_(JointVector::Zero(n)), coordinates_(coordinates) {}
  const JointVector& torque() const noexcept { return torque_; }

 private:
  JointVector torque_;
  int coordinates_;
};

}  // namespace dashpot::sim
