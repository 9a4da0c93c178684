#include <dashpot/lcmtypes/message_check.hpp>
#include <dashpot/lcmtypes/publish/encode.hpp>

#include <Eigen/Geometry>
#include <algorithm>

namespace dashpot::lcmtypes {
namespace {

using Reals = std::vector<double>;

template <class Vector>
void copy_to(const Vector& from, std::size_t size, Reals& to) {
  to.assign(size, 0.0);
  std::copy_n(from.data(), std::min(size, static_cast<std::size_t>(from.size())), to.begin());
}

template <class Vector, std::size_t Size>
void copy_to(const Vector& from, double (&to)[Size]) {
  std::copy_n(from.data(), Size, to);
}

// modes_t has the numbers of the analysis.
using analysis::ModeKind;
static_assert(static_cast<int>(ModeKind::kUnderdamped) == modes_t::UNDERDAMPED);
static_assert(static_cast<int>(ModeKind::kCritical) == modes_t::CRITICAL);
static_assert(static_cast<int>(ModeKind::kOverdamped) == modes_t::OVERDAMPED);
static_assert(static_cast<int>(ModeKind::kUndamped) == modes_t::UNDAMPED);
static_assert(static_cast<int>(ModeKind::kUnstable) == modes_t::UNSTABLE);
static_assert(static_cast<int>(ModeKind::kSoft) == modes_t::SOFT);
static_assert(static_cast<int>(ModeKind::kAlternating) == sampled_modes_t::ALTERNATING);
static_assert(static_cast<int>(CommandVerdict::kMalformed) == state_t::MALFORMED);
static_assert(static_cast<int>(CommandVerdict::kWrongSize) == state_t::WRONG_SIZE);
static_assert(static_cast<int>(CommandVerdict::kUnknown) == state_t::UNKNOWN);
static_assert(static_cast<int>(CommandVerdict::kNotFinite) == state_t::NOT_FINITE);
static_assert(static_cast<int>(CommandVerdict::kNotUnit) == state_t::NOT_UNIT);
static_assert(static_cast<int>(CommandVerdict::kOutOfLimits) == state_t::OUT_OF_LIMITS);
static_assert(static_cast<int>(CommandVerdict::kIndefinite) == state_t::INDEFINITE);
static_assert(static_cast<int>(CommandVerdict::kStale) == state_t::STALE);
static_assert(static_cast<int>(CommandVerdict::kFromFuture) == state_t::FROM_FUTURE);
static_assert(static_cast<int>(CommandVerdict::kReplayed) == state_t::REPLAYED);
static_assert(static_cast<int>(CommandVerdict::kTooMany) == state_t::TOO_MANY);
static_assert(static_cast<int>(CommandVerdict::kNoSender) == state_t::NO_SENDER);
static_assert(static_cast<int>(CommandVerdict::kOtherSender) == state_t::OTHER_SENDER);
static_assert(static_cast<int>(CommandVerdict::kUnstable) == state_t::UNSTABLE);
static_assert(static_cast<int>(CommandVerdict::kNoSuchFault) == state_t::NO_SUCH_FAULT);
static_assert(sizeof(state_t::verdicts) == kCommandVerdicts * sizeof(std::int64_t));
static_assert(static_cast<int>(controller::Mode::kJoint) == state_t::JOINT);
static_assert(static_cast<int>(controller::Mode::kCartesian) == state_t::CARTESIAN);

static_assert(static_cast<int>(analysis::SpectrumOrigin::kTracked) == modes_t::TRACKED);
static_assert(static_cast<int>(analysis::SpectrumOrigin::kReused) == modes_t::REUSED);
static_assert(static_cast<int>(analysis::SpectrumOrigin::kDirect) == modes_t::DIRECT);

/// The number of modes of n joints in a message.
std::size_t count_of(int modes, std::size_t n) {
  return static_cast<std::size_t>(
      std::clamp(modes, 0, static_cast<int>(most_modes(static_cast<std::int32_t>(n)))));
}

void resize_modes(std::size_t count, modes_t& message) {
  for (auto* list : {&message.natural_frequency, &message.damping_ratio, &message.damped_frequency,
                     &message.eigenvalue_bound, &message.natural_frequency_bound,
                     &message.damping_ratio_bound}) {
    list->resize(count);
  }
  for (auto* list : {&message.eigenvalue_real, &message.eigenvalue_imag, &message.shape_real,
                     &message.shape_imag}) {
    list->resize(count);
  }
  message.label.resize(count);
  message.kind.resize(count);
}

/// Copies a mode of a robot with n joints to place i.
void fill_mode(const controller::VibrationMode& mode, std::size_t n, std::size_t i,
               modes_t& message) {
  message.label[i] = mode.label;
  message.kind[i] = static_cast<std::int8_t>(mode.kind);
  message.natural_frequency[i] = mode.natural_frequency;
  message.damping_ratio[i] = mode.damping_ratio;
  message.damped_frequency[i] = mode.damped_frequency;
  message.eigenvalue_bound[i] = mode.error_bound;
  message.natural_frequency_bound[i] = mode.natural_frequency_bound;
  message.damping_ratio_bound[i] = mode.damping_ratio_bound;
  const auto& [first, second] = mode.eigenvalues;
  message.eigenvalue_real[i] = {first.real(), second.real()};
  message.eigenvalue_imag[i] = {first.imag(), second.imag()};
  copy_to(mode.shape.real().eval(), n, message.shape_real[i]);
  copy_to(mode.shape.imag().eval(), n, message.shape_imag[i]);
}

void fill(const CommandTally& tally, state_t& message) {
  std::copy(tally.verdicts.begin(), tally.verdicts.end(), std::begin(message.verdicts));
  message.last_refusal = static_cast<std::int8_t>(tally.last_refusal);
  message.last_refusal_utime = tally.last_refusal_utime;
  message.last_refused_sender = tally.last_refused_sender;
  message.commander = tally.commander;
  message.commands_accepted = tally.accepted();
  message.commands_rejected = tally.rejected();
}

}  // namespace

void write_quaternion(const Eigen::Matrix3d& R, double (&quaternion)[4]) {
  const Eigen::Quaterniond q(R);
  const double sign = q.w() < 0 ? -1.0 : 1.0;
  quaternion[0] = sign * q.w();
  quaternion[1] = sign * q.x();
  quaternion[2] = sign * q.y();
  quaternion[3] = sign * q.z();
}

void fill(const StateSample& sample, state_t& message) {
  const controller::Snapshot& snapshot = sample.snapshot;
  const auto n = static_cast<std::size_t>(snapshot.position.size());
  message.n = static_cast<std::int32_t>(n);
  message.utime = sample.utime;
  message.tick = static_cast<std::int64_t>(snapshot.tick);
  message.restarts = static_cast<std::int64_t>(snapshot.restarts);
  message.mode = static_cast<std::int8_t>(snapshot.mode);
  message.status = static_cast<std::int8_t>(snapshot.status);
  message.fault = static_cast<std::int8_t>(snapshot.fault);
  message.fault_tick = sample.health.fault_tick;

  copy_to(snapshot.position, n, message.joint_position);
  copy_to(snapshot.velocity, n, message.joint_velocity);
  copy_to(snapshot.torque, n, message.joint_torque);
  copy_to(snapshot.law_torque, n, message.law_torque);
  copy_to(snapshot.reference_position, n, message.reference_joint_position);
  copy_to(snapshot.tip.position, message.tip_position);
  write_quaternion(snapshot.tip.rotation, message.tip_quaternion);
  copy_to(snapshot.reference_tip.position, message.reference_tip_position);
  write_quaternion(snapshot.reference_tip.rotation, message.reference_tip_quaternion);
  copy_to(snapshot.tip_error, message.tip_error);
  copy_to(snapshot.tip_wrench, message.tip_wrench);
  message.joint_damping_ratio = snapshot.joint_damping_ratio;
  message.task_damping_ratio = snapshot.task_damping_ratio;
  message.damping_level = snapshot.damping_level;
  message.energy_store = snapshot.energy_store;
  message.spring_share = snapshot.spring_share;
  message.payload_mass = snapshot.payload.mass;
  copy_to(snapshot.payload.center, message.payload_center);
  copy_to(snapshot.tool.position, message.tool_position);
  write_quaternion(snapshot.tool.rotation, message.tool_quaternion);

  message.tick_time = sample.health.tick_time;
  message.longest_tick_time = sample.health.longest_tick_time;
  message.overruns = sample.health.overruns;
  fill(sample.health.commands, message);
}

void fill(const StateSample& sample, contact_t& message) {
  message.utime = sample.utime;
  message.tick = static_cast<std::int64_t>(sample.snapshot.tick);
  copy_to(*sample.contact_force, message.force);
}

void fill(const ModesSample& sample, modes_t& message) {
  const controller::Vibration& vibration = sample.vibration;
  const auto n = static_cast<std::size_t>(vibration.position.size());
  const auto count = count_of(vibration.count, n);
  message.n = static_cast<std::int32_t>(n);
  message.num_modes = static_cast<std::int32_t>(count);
  message.utime = sample.utime;
  message.tick = static_cast<std::int64_t>(vibration.tick);
  message.origin = static_cast<std::int8_t>(vibration.origin);
  message.status = static_cast<std::int8_t>(vibration.status);
  copy_to(vibration.position, n, message.joint_position);
  message.zero_modes = vibration.zero_modes;
  resize_modes(count, message);
  for (std::size_t i = 0; i < count; ++i) {
    fill_mode(vibration.modes[i], n, i, message);
  }
}

void fill(const SampledModesSample& sample, sampled_modes_t& message) {
  const controller::SampledVibration& vibration = sample.vibration;
  const auto n = static_cast<std::size_t>(vibration.position.size());
  const auto count = count_of(vibration.count, n);
  message.n = static_cast<std::int32_t>(n);
  message.num_modes = static_cast<std::int32_t>(count);
  message.utime = sample.utime;
  message.tick = static_cast<std::int64_t>(vibration.tick);
  message.status = static_cast<std::int8_t>(vibration.status);
  copy_to(vibration.position, n, message.joint_position);
  message.spectral_radius = vibration.spectral_radius;
  message.gain_margin = vibration.gain_margin;
  message.assumes = static_cast<std::int32_t>(vibration.assumes);
  for (auto* list :
       {&message.continuous_frequency, &message.continuous_ratio, &message.natural_frequency,
        &message.damping_ratio, &message.damped_frequency}) {
    list->resize(count);
  }
  message.kind.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const controller::SampledVibrationMode& mode = vibration.modes[i];
    message.continuous_frequency[i] = mode.continuous_frequency;
    message.continuous_ratio[i] = mode.continuous_ratio;
    message.natural_frequency[i] = mode.natural_frequency;
    message.damping_ratio[i] = mode.damping_ratio;
    message.damped_frequency[i] = mode.damped_frequency;
    message.kind[i] = static_cast<std::int8_t>(mode.kind);
  }
}

}  // namespace dashpot::lcmtypes
