#include <dashpot/sim/plant.hpp>

#include <dashpot/sim/invalid_scene.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

namespace dashpot::sim {
namespace {

void require_size(const JointVector& values, int n, const char* key) {
  if (values.size() == n) return;
  throw InvalidScene(
      key, "has " + std::to_string(values.size()) + " entries, must have " + std::to_string(n));
}

void require_finite(const JointVector& values, int n, const char* key) {
  require_size(values, n, key);
  if (!values.allFinite()) throw InvalidScene(key, "is not finite");
}

/// Returns true if the option is on, after a check of its values.
bool is_on(const JointVector& values, int n, const char* key, const char* unit) {
  if (values.size() == 0) return false;
  require_size(values, n, key);
  if (!(values.array() >= 0).all())
    throw InvalidScene(key, std::string("must not be negative, ") + unit);
  return (values.array() > 0).any();
}

void check(const SensorFault& fault, int n) {
  if (!(fault.begin < fault.end)) throw InvalidScene("faults", "one does not begin before it ends");
  if (fault.position_offset.size() != 0) {
    require_finite(fault.position_offset, n, "faults: position_offset");
  }
  if (fault.velocity_factor.size() != 0) {
    require_finite(fault.velocity_factor, n, "faults: velocity_factor");
  }
}

}  // namespace

Plant::Plant(System& system, const PlantOptions& options, const JointVector& q,
             const JointVector& qd)
    : system_(&system), options_(options), integrator_(options.integrator), noise_(options.seed) {
  const int n = system.dof();
  if (!std::isfinite(options.period) || options.period <= 0)
    throw InvalidScene("period", "must be positive, s");
  const int coordinates = system.coordinates();
  const int given = q.size() == coordinates ? coordinates : n;
  require_finite(q, given, "initial position");
  if (qd.size() != 0) require_finite(qd, given, "initial velocity");
  const JointVector velocity = qd.size() == 0 ? JointVector(JointVector::Zero(given)) : qd;
  y_ = StateVector::Zero(2 * coordinates + kWorkChannels);
  if (given > n) {
    y_.head(given) = q;
    y_.segment(given, given) = velocity;
  } else {
    system.place(q, velocity, y_);
  }
  initial_ = system.stored_energy(y_);

  torque_ = JointVector::Zero(n);
  if (options.initial_torque.size() != 0) {
    require_finite(options.initial_torque, n, "initial_torque");
    torque_ = options.initial_torque;
  }
  if (options.torque_limit.size() != 0) {
    is_on(options.torque_limit, n, "torque_limit", "N m");
    actuation_.push_back(&limit);
  }
  if (options.delay < 0) throw InvalidScene("delay", "must not be negative, ticks");
  if (options.delay > 0) {
    delayed_.assign(static_cast<std::size_t>(options.delay), torque_);
    actuation_.push_back(&delay);
  }
  if (!std::isfinite(options.torque_cutoff) || options.torque_cutoff < 0) {
    throw InvalidScene("torque_cutoff", "must be finite and not negative, Hz");
  }
  if (options.torque_cutoff > 0) {
    filter_gain_ = -std::expm1(-2 * std::numbers::pi * options.torque_cutoff * options.period);
    filtered_ = torque_;
    actuation_.push_back(&filter);
  }

  if (is_on(options.position_noise, n, "position_noise", "rad")) {
    sensing_.push_back(&add_position_noise);
  }
  if (is_on(options.velocity_noise, n, "velocity_noise", "rad/s") && !options.difference_velocity) {
    sensing_.push_back(&add_velocity_noise);
  }
  if (is_on(options.position_resolution, n, "position_resolution", "rad")) {
    sensing_.push_back(&quantise);
  }
  for (const SensorFault& fault : options.faults) check(fault, n);
  if (!options.faults.empty()) sensing_.push_back(&shift_positions);
  measure();
  last_position_ = measured_.position;
  if (options.difference_velocity) sensing_.push_back(&difference);
  if (options.faults.empty()) return;
  shown_ = measured_;
  spoil(*this);
  sensing_.push_back(&spoil);
}

Status Plant::step(const JointVector& command) noexcept {
  if (command.size() != system_->dof()) return Status::kCommandWrongSize;
  if (!command.allFinite()) return Status::kCommandNotFinite;
  // Kept for the way back.
  const JointVector old_torque = torque_, old_filtered = filtered_;
  const JointVector old_delayed = delayed_.empty() ? JointVector() : delayed_[oldest_];
  const std::size_t old_oldest = oldest_;

  torque_ = command;
  for (const Stage act : actuation_) act(*this);
  system_->set_torque(torque_);
  StateVector y = y_;
  const Status status = move(y);
  if (status != Status::kOk) {
    torque_ = old_torque;
    filtered_ = old_filtered;
    oldest_ = old_oldest;
    if (!delayed_.empty()) delayed_[oldest_] = old_delayed;
    return status;
  }
  y_ = y;
  ++ticks_;
  measure();
  return Status::kOk;
}

void Plant::carry(const JointVector& q, const JointVector& qd) noexcept {
  const double before = system_->stored_energy(y_).sum();
  system_->place(q, qd, y_);
  y_[2 * system_->coordinates() + kByWorld] += system_->stored_energy(y_).sum() - before;
  ++ticks_;
  measure();
}

/// Moves through one period, divided where external forces jump.
Status Plant::move(StateVector& y) noexcept {
  const double end = static_cast<double>(ticks_ + 1) * options_.period;
  for (double t = time(); t < end;) {
    y[2 * system_->coordinates() + kByWorld] += system_->take_loads(t, y);
    const double next = std::min(end, system_->begin_segment(t));
    const Status status = integrator_.advance(*system_, next - t, y);
    if (status != Status::kOk) return status;
    t = next;
  }
  return Status::kOk;
}

void Plant::measure() noexcept {
  measured_.time = std::llround(time() * 1e9);
  system_->read_sensors(y_, measured_.position, measured_.velocity);
  measured_.torque = torque_;
  for (const Stage sense : sensing_) sense(*this);
}

EnergyAudit Plant::audit() const noexcept {
  const auto work = y_.tail<kWorkChannels>();
  return {initial_,           system_->stored_energy(y_), work[kByActuators], work[kByWorld],
          work[kViscousHeat], work[kFrictionHeat],        work[kContactHeat], work[kGearHeat]};
}

void Plant::limit(Plant& plant) noexcept {
  const JointVector& most = plant.options_.torque_limit;
  plant.torque_ = plant.torque_.cwiseMin(most).cwiseMax(-most);
}

void Plant::delay(Plant& plant) noexcept {
  std::swap(plant.torque_, plant.delayed_[plant.oldest_]);
  plant.oldest_ = (plant.oldest_ + 1) % plant.delayed_.size();
}

void Plant::filter(Plant& plant) noexcept {
  plant.filtered_ += plant.filter_gain_ * (plant.torque_ - plant.filtered_);
  plant.torque_ = plant.filtered_;
}

void Plant::add_position_noise(Plant& plant) noexcept {
  for (Eigen::Index i = 0; i < plant.measured_.position.size(); ++i) {
    plant.measured_.position[i] += plant.options_.position_noise[i] * plant.noise_.normal();
  }
}

void Plant::add_velocity_noise(Plant& plant) noexcept {
  for (Eigen::Index i = 0; i < plant.measured_.velocity.size(); ++i) {
    plant.measured_.velocity[i] += plant.options_.velocity_noise[i] * plant.noise_.normal();
  }
}

void Plant::quantise(Plant& plant) noexcept {
  for (Eigen::Index i = 0; i < plant.measured_.position.size(); ++i) {
    const double count = plant.options_.position_resolution[i];
    if (count == 0) continue;
    double& position = plant.measured_.position[i];
    position = count * std::nearbyint(position / count);
  }
}

bool Plant::acts(const SensorFault& fault) const noexcept {
  // By whole ticks: a sum of periods may be a rounding error before the intended time.
  const double now = time() + 1e-6 * options_.period;
  return fault.begin <= now && now < fault.end;
}

void Plant::shift_positions(Plant& plant) noexcept {
  for (const SensorFault& fault : plant.options_.faults) {
    if (fault.position_offset.size() == 0 || !plant.acts(fault)) continue;
    plant.measured_.position += fault.position_offset;
  }
}

void Plant::spoil(Plant& plant) noexcept {
  Measurement& shown = plant.measured_;
  for (const SensorFault& fault : plant.options_.faults) {
    if (!plant.acts(fault)) continue;
    if (fault.velocity_factor.size() != 0) {
      shown.velocity = shown.velocity.cwiseProduct(fault.velocity_factor);
    }
    if (fault.frozen) {
      shown.position = plant.shown_.position;
      shown.velocity = plant.shown_.velocity;
    }
    if (fault.not_a_number) shown.position.setConstant(std::nan(""));
    shown.time += fault.clock_offset;
  }
  plant.shown_ = shown;
}

void Plant::difference(Plant& plant) noexcept {
  plant.measured_.velocity =
      (plant.measured_.position - plant.last_position_) / plant.options_.period;
  plant.last_position_ = plant.measured_.position;
}

}  // namespace dashpot::sim
