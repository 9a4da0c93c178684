#pragma once
#include <dashpot/sim/dynamics/articulated_body.hpp>
#include <dashpot/sim/dynamics/contact.hpp>
#include <dashpot/sim/invalid_scene.hpp>
#include <dashpot/sim/robot.hpp>
#include <dashpot/sim/schedule.hpp>
#include <dashpot/sim/simulated_system.hpp>

#include <cstdint>
#include <optional>
#include <vector>

namespace dashpot::sim {

/// A frictionless, compliant half space that the tip's origin may press into.
struct Wall {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();    ///< on the surface, m, in the base
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< out of the wall; any length but zero
  Contact contact{1e4, 50};                           ///< N/m, N s/m
};

/// The side of an elastic gear on which positions and velocities are measured.
enum class PositionSensor : std::uint8_t { kMotor, kLink };

/// Forces on the arm in addition to gravity and torque. A force that is off or zero costs nothing.
struct ArmOptions {
  bool viscous_friction = true;  ///< with the coefficients of the robot
  bool coulomb_friction = true;  ///< likewise: -coulomb tanh(qd / friction_velocity)
  /// v_s, where Coulomb friction has three quarters of its value, rad/s or m/s. At rest it acts as
  /// a damper of coulomb / v_s: joints creep slowly instead of sticking. With inertia m, RK4 then
  /// needs steps below 2.7 m v_s / coulomb, semi-implicit Euler below 2 m v_s / coulomb.
  double friction_velocity = 0.01;
  PositionSensor position_sensor = PositionSensor::kMotor;  ///< of joints with elastic gears
  std::optional<Contact> stops;  ///< at the position limits; N m/rad and N m s/rad (N/m, N s/m)
  std::optional<Wall> wall;
  /// Stiffness and damping of the wall for some time; energy of a wall that is pressed in as they
  /// change counts as the world's work.
  std::vector<Piece<Contact>> tables;
  std::vector<Piece<Vector6>> wrenches;  ///< of the world on the tip, at its origin, in base axes
  /// Bodies rigid at the tip, in its axes, beside the robot's payload: picked up at `begin`, put
  /// down at `end`. They come and go with the velocity of the tip, and their energy counts as the
  /// world's work.
  std::vector<Piece<Inertia>> loads;
};

/// A robot arm: M(q) qdd + C(q, qd) qd + g(q) = tau - friction + stops + J' (wall + wrenches).
///
/// Where a gear is elastic, tau - friction moves the drive, and the gear's torque tau_J the link:
///     B theta'' = tau - friction(theta') - tau_J,  tau_J = K_J (theta - q) + D_J (theta' - q'),
/// with B the joint's reflected_inertia; M is then without B. Such joints have a second coordinate
/// each, the deflection theta - q, which keeps its digits however stiff the gear is: the state is
/// (q, deflections; their rates).
class Arm : public System {
 public:
  /// Throws InvalidScene.
  explicit Arm(const Robot& robot, const ArmOptions& options = {});

  const Robot& robot() const noexcept { return robot_; }
  Pose tip_pose(const JointVector& q) noexcept;
  /// Returns the linear and angular velocity of the tip, m/s and rad/s, in the base's axes.
  Vector6 tip_twist(const JointVector& q, const JointVector& qd) noexcept;

  /// Returns the force of the wall on the tip in a state, N, in the base's axes; zero without a
  /// wall.
  Eigen::Vector3d wall_force(const StateVector& y) noexcept;

  /// Returns the highest natural frequency of the elastic gears at q with all drives free, rad/s;
  /// zero if all are rigid.
  double fastest_gear(const JointVector& q);

  void place(const JointVector& q, const JointVector& qd, StateVector& y) noexcept override;
  void read_sensors(const StateVector& y, JointVector& q, JointVector& qd) const noexcept override;
  double begin_segment(double t) noexcept override;
  double take_loads(double t, const StateVector& y) noexcept override;
  void rates(const StateVector& y, StateVector& y_dot) noexcept override;
  StoredEnergy stored_energy(const StateVector& y) noexcept override;
  bool has_contacts() const noexcept override { return options_.stops || options_.wall; }
  ContactModes contact_modes(const StateVector& y) noexcept override;
  void freeze(ContactModes modes) noexcept override {
    frozen_ = true;
    frozen_modes_ = modes;
  }
  void thaw() noexcept override { frozen_ = false; }

 private:
  /// Adds one kind of force to the sums, and its power to the work channels.
  struct Sums {
    const double* q;
    const double* qd;
    double* tau;
    double* work;
    const double* drive_rate;  ///< qd of rigid gears
    double* drive_tau;         ///< likewise tau
  };
  /// An elastic gear with its drive.
  struct Gear {
    int joint;
    double stiffness, damping, inertia;
  };
  using Force = void (*)(Arm& arm, const Sums& sums) noexcept;
  static void add_viscous_friction(Arm& arm, const Sums& sums) noexcept;
  static void add_coulomb_friction(Arm& arm, const Sums& sums) noexcept;
  static void add_stops(Arm& arm, const Sums& sums) noexcept;
  static void add_wall(Arm& arm, const Sums& sums) noexcept;
  static void add_wrench(Arm& arm, const Sums& sums) noexcept;
  void add_gears(const Sums& sums) noexcept;

  double wall_depth() const noexcept;
  double wall_rate() const noexcept;
  ContactMode mode_of(int contact_index, const Contact& contact, double depth,
                      double rate) const noexcept;

  Robot robot_;
  ArmOptions options_;
  ArticulatedBody bodies_;
  std::vector<Gear> gears_;    // the elastic ones, in the order of their coordinates
  std::vector<Force> forces_;  // forces of this scene
  Schedule<Vector6> wrenches_;
  Vector6 wrench_ = Vector6::Zero();
  Schedule<Inertia> loads_;
  const Inertia* load_ = nullptr;  // carried, of loads_
  Schedule<Contact> tables_;
  Contact touched_;  // of the wall
  bool frozen_ = false;
  ContactModes frozen_modes_ = 0;
};

}  // namespace dashpot::sim
