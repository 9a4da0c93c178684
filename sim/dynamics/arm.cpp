#include <dashpot/sim/arm.hpp>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace dashpot::sim {
namespace {

void require_not_negative(double value, const std::string& key, const char* unit) {
  if (std::isfinite(value) && value >= 0) return;
  throw InvalidScene(
      key, "is " + std::to_string(value) + " " + unit + ", must be finite and not negative");
}

void validate(const ArmOptions& options) {
  if (!(options.friction_velocity > 0))
    throw InvalidScene("friction_velocity", "must be positive, rad/s");
  if (options.stops) {
    require_not_negative(options.stops->stiffness, "stops: stiffness", "N m/rad");
    require_not_negative(options.stops->damping, "stops: damping", "N m s/rad");
  }
  if (options.wall) {
    require_not_negative(options.wall->contact.stiffness, "wall: stiffness", "N/m");
    require_not_negative(options.wall->contact.damping, "wall: damping", "N s/m");
    if (!options.wall->point.allFinite()) throw InvalidScene("wall: point", "is not finite");
    const double norm = options.wall->normal.norm();
    if (!std::isfinite(norm) || norm == 0)
      throw InvalidScene("wall: normal", "is zero or not finite");
  }
  for (const Piece<Vector6>& piece : options.wrenches) {
    if (!piece.value.allFinite()) throw InvalidScene("wrenches", "a piece is not finite");
    if (!(piece.begin < piece.end))
      throw InvalidScene("wrenches", "a piece does not begin before it ends");
  }
  for (const Piece<Inertia>& piece : options.loads) {
    const Inertia& load = piece.value;
    require_not_negative(load.mass, "loads: mass", "kg");
    if (!load.center.allFinite() || !load.about_center.allFinite()) {
      throw InvalidScene("loads", "a body is not finite");
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(load.about_center,
                                                                Eigen::EigenvaluesOnly);
    if (load.about_center != load.about_center.transpose() || solver.eigenvalues()[0] < 0) {
      throw InvalidScene("loads", "an inertia is not symmetric positive semidefinite");
    }
    if (!(piece.begin < piece.end))
      throw InvalidScene("loads", "a piece does not begin before it ends");
  }
}

/// How far a joint is beyond the nearer one of its limits, and which way the stop pushes.
struct Stop {
  double depth;
  double direction;
};

Stop nearer_stop(const Joint& joint, double q) noexcept {
  const double below = joint.lower - q, above = q - joint.upper;
  return below > above ? Stop{below, 1} : Stop{above, -1};
}

}  // namespace

Arm::Arm(const Robot& robot, const ArmOptions& options)
    : System(robot.dof()),
      robot_(robot),
      options_(options),
      bodies_(robot_),
      wrenches_(options.wrenches, Vector6::Zero()),
      loads_(options.loads, Inertia()) {
  validate(options);
  const auto any = [&](double Joint::*member) {
    return std::any_of(robot_.joints().begin(), robot_.joints().end(),
                       [&](const Joint& joint) { return joint.*member != 0; });
  };
  if (options.viscous_friction && any(&Joint::viscous_friction))
    forces_.push_back(&add_viscous_friction);
  if (options.coulomb_friction && any(&Joint::coulomb_friction))
    forces_.push_back(&add_coulomb_friction);
  if (options.stops) forces_.push_back(&add_stops);
  if (options.wall) {
    options_.wall->normal.normalize();
    forces_.push_back(&add_wall);
  }
  if (!wrenches_.empty()) forces_.push_back(&add_wrench);
}

double Arm::begin_segment(double t) noexcept {
  double next = std::numeric_limits<double>::infinity();
  if (!wrenches_.empty()) {
    wrench_ = wrenches_.at(t);
    next = wrenches_.next_edge(t);
  }
  if (!loads_.empty()) next = std::min(next, loads_.next_edge(t));
  return next;
}

double Arm::take_loads(double t, const StateVector& y) noexcept {
  if (loads_.empty() || load_ == &loads_.at(t)) return 0;
  const double before = stored_energy(y).sum();
  load_ = &loads_.at(t);
  robot_.carry(*load_);
  return stored_energy(y).sum() - before;
}

void Arm::rates(const StateVector& y, StateVector& y_dot) noexcept {
  const Eigen::Index n = dof();
  const double* const q = y.data();
  const double* const qd = q + n;
  double* const work = y_dot.data() + 2 * n;
  std::array<double, kMaxJoints> tau;
  double power = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    tau[static_cast<std::size_t>(i)] = torque()[i];
    power += torque()[i] * qd[i];
    y_dot[i] = qd[i];
  }
  std::fill_n(work, int{kWorkChannels}, 0.0);
  work[kByActuators] = power;

  bodies_.move_to(q, qd);
  for (const Force add : forces_) add(*this, {q, qd, tau.data(), work});
  bodies_.accelerations(tau.data(), y_dot.data() + n);
}

void Arm::add_viscous_friction(Arm& arm, const Sums& sums) noexcept {
  double loss = 0;
  for (int i = 0; i < arm.dof(); ++i) {
    const double friction =
        arm.robot_.joints()[static_cast<std::size_t>(i)].viscous_friction * sums.qd[i];
    sums.tau[i] -= friction;
    loss += friction * sums.qd[i];
  }
  sums.work[kViscousHeat] = loss;
}

void Arm::add_coulomb_friction(Arm& arm, const Sums& sums) noexcept {
  const double scale = 1 / arm.options_.friction_velocity;
  double loss = 0;
  for (int i = 0; i < arm.dof(); ++i) {
    const double coulomb = arm.robot_.joints()[static_cast<std::size_t>(i)].coulomb_friction;
    const double friction = coulomb * std::tanh(scale * sums.qd[i]);
    sums.tau[i] -= friction;
    loss += friction * sums.qd[i];
  }
  sums.work[kFrictionHeat] = loss;
}

void Arm::add_stops(Arm& arm, const Sums& sums) noexcept {
  const Contact& contact = *arm.options_.stops;
  for (int i = 0; i < arm.dof(); ++i) {
    const Stop stop = nearer_stop(arm.robot_.joints()[static_cast<std::size_t>(i)], sums.q[i]);
    const double rate = -stop.direction * sums.qd[i];
    const ContactForce push =
        contact_force(contact, arm.mode_of(i, contact, stop.depth, rate), stop.depth, rate);
    sums.tau[i] += stop.direction * push.force;
    sums.work[kContactHeat] += push.loss;
  }
}

void Arm::add_wall(Arm& arm, const Sums& sums) noexcept {
  const Wall& wall = *arm.options_.wall;
  const double depth = arm.wall_depth(), rate = arm.wall_rate();
  const ContactMode mode = arm.mode_of(kMaxJoints, wall.contact, depth, rate);
  if (mode == ContactMode::kFree) return;
  const ContactForce push = contact_force(wall.contact, mode, depth, rate);
  arm.bodies_.push_tip(Eigen::Vector3d(push.force * wall.normal));
  sums.work[kContactHeat] += push.loss;
}

void Arm::add_wrench(Arm& arm, const Sums& sums) noexcept {
  arm.bodies_.push_tip(arm.wrench_);
  sums.work[kByWorld] = arm.wrench_.dot(arm.bodies_.tip_twist());
}

double Arm::wall_depth() const noexcept {
  return options_.wall->normal.dot(options_.wall->point - bodies_.tip_position());
}

double Arm::wall_rate() const noexcept {
  return -options_.wall->normal.dot(bodies_.tip_twist().head<3>());
}

ContactMode Arm::mode_of(int contact_index, const Contact& contact, double depth,
                         double rate) const noexcept {
  if (frozen_) return static_cast<ContactMode>(frozen_modes_ >> (2 * contact_index) & 3);
  return contact_mode(contact, depth, rate);
}

ContactModes Arm::contact_modes(const StateVector& y) noexcept {
  const int n = dof();
  ContactModes modes = 0;
  if (options_.stops) {
    for (int i = 0; i < n; ++i) {
      const Stop stop = nearer_stop(robot_.joints()[static_cast<std::size_t>(i)], y[i]);
      const double rate = -stop.direction * y[n + i];
      modes |= static_cast<ContactModes>(contact_mode(*options_.stops, stop.depth, rate))
               << (2 * i);
    }
  }
  if (options_.wall) {
    bodies_.move_to(y.data(), y.data() + n);
    const ContactMode mode = contact_mode(options_.wall->contact, wall_depth(), wall_rate());
    modes |= static_cast<ContactModes>(mode) << (2 * kMaxJoints);
  }
  return modes;
}

StoredEnergy Arm::stored_energy(const StateVector& y) noexcept {
  const int n = dof();
  bodies_.move_to(y.data(), y.data() + n);
  double springs = 0;
  if (options_.stops) {
    for (int i = 0; i < n; ++i) {
      const Stop stop = nearer_stop(robot_.joints()[static_cast<std::size_t>(i)], y[i]);
      springs += contact_energy(*options_.stops, stop.depth);
    }
  }
  if (options_.wall) springs += contact_energy(options_.wall->contact, wall_depth());
  return {bodies_.kinetic_energy(), bodies_.gravity_energy(), springs};
}

Pose Arm::tip_pose(const JointVector& q) noexcept {
  const JointVector rest = JointVector::Zero(dof());
  bodies_.move_to(q.data(), rest.data());
  return bodies_.tip_pose();
}

Vector6 Arm::tip_twist(const JointVector& q, const JointVector& qd) noexcept {
  bodies_.move_to(q.data(), qd.data());
  return bodies_.tip_twist();
}

}  // namespace dashpot::sim
