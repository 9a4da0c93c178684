#include <dashpot/sim/arm.hpp>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
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

template <class Value>
void require_pieces(const std::string& key, const std::vector<Piece<Value>>& pieces) {
  for (const Piece<Value>& piece : pieces) {
    if (!(piece.begin < piece.end))
      throw InvalidScene(key, "a piece does not begin before it ends");
  }
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
  }
  if (!options.tables.empty() && !options.wall) throw InvalidScene("tables", "need a wall");
  for (const Piece<Contact>& piece : options.tables) {
    require_not_negative(piece.value.stiffness, "tables: stiffness", "N/m");
    require_not_negative(piece.value.damping, "tables: damping", "N s/m");
  }
  require_pieces("wrenches", options.wrenches);
  require_pieces("tables", options.tables);
  require_pieces("loads", options.loads);
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
  }
}

/// Distance of a joint beyond its nearer limit, and the direction in which the stop pushes.
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
    : System(robot.dof(), robot.coordinates()),
      robot_(robot),
      options_(options),
      bodies_(robot_),
      wrenches_(options.wrenches, Vector6::Zero()),
      loads_(options.loads, Inertia()),
      tables_(options.tables, Contact()) {
  validate(options);
  for (int i = 0; i < robot.dof(); ++i) {
    const Joint& joint = robot.joints()[static_cast<std::size_t>(i)];
    if (!joint.elastic()) continue;
    gears_.push_back({i, joint.gear_stiffness, joint.gear_damping, joint.reflected_inertia});
  }
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
    touched_ = options.wall->contact;
    forces_.push_back(&add_wall);
  }
  if (!wrenches_.empty()) forces_.push_back(&add_wrench);
}

double Arm::fastest_gear(const JointVector& q) {
  const auto count = static_cast<Eigen::Index>(gears_.size());
  if (count == 0) return 0;
  const JointVector rest = JointVector::Zero(dof());
  const auto accelerations_of = [&](const JointVector& tau) {
    JointVector qdd(dof());
    bodies_.move_to(q.data(), rest.data());
    bodies_.accelerations(tau.data(), qdd.data());
    return qdd;
  };
  const JointVector fall = accelerations_of(rest);
  JointMatrix A(count, count);  // K^1/2 (B^-1 + M^-1) K^1/2 of the elastic joints
  for (Eigen::Index j = 0; j < count; ++j) {
    const Gear& pushed = gears_[static_cast<std::size_t>(j)];
    const JointVector answer = accelerations_of(JointVector::Unit(dof(), pushed.joint)) - fall;
    for (Eigen::Index i = 0; i < count; ++i) {
      const Gear& gear = gears_[static_cast<std::size_t>(i)];
      const double drive = i == j ? 1 / gear.inertia : 0;
      A(i, j) = std::sqrt(gear.stiffness * pushed.stiffness) * (answer[gear.joint] + drive);
    }
  }
  return std::sqrt(Eigen::SelfAdjointEigenSolver<JointMatrix>(A, Eigen::EigenvaluesOnly)
                       .eigenvalues()[count - 1]);
}

void Arm::place(const JointVector& q, const JointVector& qd, StateVector& y) noexcept {
  constexpr int kMostSteps = 100;
  constexpr double kFound = 1e-15;  // rad
  const Eigen::Index n = dof(), N = coordinates();
  y.head(n) = q;
  y.segment(N, n) = qd;
  y.segment(n, N - n).setZero();
  y.segment(N + n, N - n).setZero();
  if (gears_.empty()) return;
  // Deflections change the posture, and with it the weight, by a small part of themselves.
  std::array<double, kMaxJoints> weight;
  double change = 1;
  for (int step = 0; step < kMostSteps && change > kFound; ++step) {
    bodies_.move_to(y.data(), y.data() + N);
    bodies_.weight(weight.data());
    change = 0;
    for (std::size_t k = 0; k < gears_.size(); ++k) {
      double& deflection = y[n + static_cast<Eigen::Index>(k)];
      const auto joint = static_cast<std::size_t>(gears_[k].joint);
      change = std::max(change, std::abs(weight[joint] / gears_[k].stiffness - deflection));
      deflection = weight[joint] / gears_[k].stiffness;
      if (options_.position_sensor == PositionSensor::kLink) continue;
      y[gears_[k].joint] = q[gears_[k].joint] - deflection;
    }
  }
}

void Arm::read_sensors(const StateVector& y, JointVector& q, JointVector& qd) const noexcept {
  System::read_sensors(y, q, qd);
  if (options_.position_sensor == PositionSensor::kLink) return;
  for (std::size_t k = 0; k < gears_.size(); ++k) {
    const Eigen::Index at = dof() + static_cast<Eigen::Index>(k);
    q[gears_[k].joint] += y[at];
    qd[gears_[k].joint] += y[coordinates() + at];
  }
}

double Arm::begin_segment(double t) noexcept {
  double next = std::numeric_limits<double>::infinity();
  if (!wrenches_.empty()) {
    wrench_ = wrenches_.at(t);
    next = wrenches_.next_edge(t);
  }
  if (!loads_.empty()) next = std::min(next, loads_.next_edge(t));
  if (!tables_.empty()) next = std::min(next, tables_.next_edge(t));
  return next;
}

double Arm::take_loads(double t, const StateVector& y) noexcept {
  const Inertia* const load = loads_.empty() ? load_ : &loads_.at(t);
  Contact table = tables_.empty() ? touched_ : tables_.at(t);
  if (!tables_.empty() && table.stiffness == 0) table = options_.wall->contact;
  if (load == load_ && table == touched_) return 0;
  const double before = stored_energy(y).sum();
  touched_ = table;
  if (load != load_) robot_.carry(*load);
  load_ = load;
  return stored_energy(y).sum() - before;
}

void Arm::rates(const StateVector& y, StateVector& y_dot) noexcept {
  const Eigen::Index n = dof(), N = coordinates();
  const double* const q = y.data();
  const double* const qd = q + N;
  double* const work = y_dot.data() + 2 * N;
  std::array<double, kMaxJoints> tau, drive_rate, drive_tau;
  Sums sums{q, qd, tau.data(), work, qd, tau.data()};
  if (!gears_.empty()) {
    std::copy_n(qd, n, drive_rate.data());
    for (std::size_t k = 0; k < gears_.size(); ++k) {
      drive_rate[static_cast<std::size_t>(gears_[k].joint)] += qd[static_cast<std::size_t>(n) + k];
    }
    std::fill_n(tau.data(), n, 0.0);
    sums.drive_rate = drive_rate.data();
    sums.drive_tau = drive_tau.data();
  }
  double power = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    sums.drive_tau[i] = torque()[i];
    power += torque()[i] * sums.drive_rate[i];
  }
  y_dot.head(N) = y.segment(N, N);
  std::fill_n(work, int{kWorkChannels}, 0.0);
  work[kByActuators] = power;

  bodies_.move_to(q, qd);
  for (const Force add : forces_) add(*this, sums);
  if (!gears_.empty()) add_gears(sums);
  double* const accelerations = y_dot.data() + N;
  bodies_.accelerations(tau.data(), accelerations);
  for (std::size_t k = 0; k < gears_.size(); ++k) {
    const Gear& gear = gears_[k];
    accelerations[static_cast<std::size_t>(n) + k] =
        sums.drive_tau[gear.joint] / gear.inertia - accelerations[gear.joint];
  }
}

/// Rigid gears pass on the torque of the drive, elastic ones their own.
void Arm::add_gears(const Sums& sums) noexcept {
  const double* const deflection = sums.q + dof();
  const double* const rate = sums.qd + dof();
  double loss = 0;
  std::size_t k = 0;
  for (int i = 0; i < dof(); ++i) {
    if (k == gears_.size() || gears_[k].joint != i) {
      sums.tau[i] += sums.drive_tau[i];
      continue;
    }
    const Gear& gear = gears_[k];
    const double torque = gear.stiffness * deflection[k] + gear.damping * rate[k];
    sums.tau[i] += torque;
    sums.drive_tau[i] -= torque;
    loss += gear.damping * rate[k] * rate[k];
    ++k;
  }
  sums.work[kGearHeat] = loss;
}

void Arm::add_viscous_friction(Arm& arm, const Sums& sums) noexcept {
  double loss = 0;
  for (int i = 0; i < arm.dof(); ++i) {
    const double friction =
        arm.robot_.joints()[static_cast<std::size_t>(i)].viscous_friction * sums.drive_rate[i];
    sums.drive_tau[i] -= friction;
    loss += friction * sums.drive_rate[i];
  }
  sums.work[kViscousHeat] = loss;
}

void Arm::add_coulomb_friction(Arm& arm, const Sums& sums) noexcept {
  const double scale = 1 / arm.options_.friction_velocity;
  double loss = 0;
  for (int i = 0; i < arm.dof(); ++i) {
    const double coulomb = arm.robot_.joints()[static_cast<std::size_t>(i)].coulomb_friction;
    const double friction = coulomb * std::tanh(scale * sums.drive_rate[i]);
    sums.drive_tau[i] -= friction;
    loss += friction * sums.drive_rate[i];
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
  const ContactMode mode = arm.mode_of(kMaxJoints, arm.touched_, depth, rate);
  if (mode == ContactMode::kFree) return;
  const ContactForce push = contact_force(arm.touched_, mode, depth, rate);
  arm.bodies_.push_tip(Eigen::Vector3d(push.force * wall.normal));
  sums.work[kContactHeat] += push.loss;
}

Eigen::Vector3d Arm::wall_force(const StateVector& y) noexcept {
  if (!options_.wall) return Eigen::Vector3d::Zero();
  bodies_.move_to(y.data(), y.data() + coordinates());
  const double depth = wall_depth(), rate = wall_rate();
  const ContactMode mode = contact_mode(touched_, depth, rate);
  if (mode == ContactMode::kFree) return Eigen::Vector3d::Zero();
  return contact_force(touched_, mode, depth, rate).force * options_.wall->normal;
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
      const double rate = -stop.direction * y[coordinates() + i];
      modes |= static_cast<ContactModes>(contact_mode(*options_.stops, stop.depth, rate))
               << (2 * i);
    }
  }
  if (options_.wall) {
    bodies_.move_to(y.data(), y.data() + coordinates());
    const ContactMode mode = contact_mode(touched_, wall_depth(), wall_rate());
    modes |= static_cast<ContactModes>(mode) << (2 * kMaxJoints);
  }
  return modes;
}

StoredEnergy Arm::stored_energy(const StateVector& y) noexcept {
  const int n = dof();
  bodies_.move_to(y.data(), y.data() + coordinates());
  double springs = 0, kinetic = bodies_.kinetic_energy();
  for (std::size_t k = 0; k < gears_.size(); ++k) {
    const Gear& gear = gears_[k];
    const Eigen::Index at = n + static_cast<Eigen::Index>(k);
    const double rate = y[coordinates() + gear.joint] + y[coordinates() + at];
    springs += 0.5 * gear.stiffness * y[at] * y[at];
    kinetic += 0.5 * gear.inertia * rate * rate;
  }
  if (options_.stops) {
    for (int i = 0; i < n; ++i) {
      const Stop stop = nearer_stop(robot_.joints()[static_cast<std::size_t>(i)], y[i]);
      springs += contact_energy(*options_.stops, stop.depth);
    }
  }
  if (options_.wall) springs += contact_energy(touched_, wall_depth());
  return {kinetic, bodies_.gravity_energy(), springs};
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
