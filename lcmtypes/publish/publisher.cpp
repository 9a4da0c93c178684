#include <dashpot/lcmtypes/publish/encode.hpp>
#include <dashpot/lcmtypes/publisher.hpp>

#include <cmath>
#include <stdexcept>
#include <utility>

namespace dashpot::lcmtypes {
namespace {

/// The writing thread owns the counter.
void count(std::atomic<std::int64_t>& counter) {
  counter.fetch_add(1, std::memory_order_relaxed);
}

/// Returns true if two numbers differ by more than `tolerance`, relative; NaN equals NaN.
bool differ(double a, double b, double tolerance) {
  if (std::isnan(a) || std::isnan(b)) return std::isnan(a) != std::isnan(b);
  return a != b && !(std::abs(a - b) <= tolerance * std::max(std::abs(a), std::abs(b)));
}

bool differ(const controller::VibrationMode& a, const controller::VibrationMode& b,
            double tolerance) {
  return a.label != b.label || a.kind != b.kind ||
         differ(a.natural_frequency, b.natural_frequency, tolerance) ||
         differ(a.damping_ratio, b.damping_ratio, tolerance);
}

bool differ(const controller::Vibration& a, const controller::Vibration& b, double tolerance) {
  if (a.position.size() != b.position.size() || a.count != b.count ||
      a.zero_modes != b.zero_modes || a.status != b.status) {
    return true;
  }
  for (Eigen::Index i = 0; i < a.position.size(); ++i) {
    if (!(std::abs(a.position[i] - b.position[i]) <= tolerance)) return true;
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(a.count); ++i) {
    if (differ(a.modes[i], b.modes[i], tolerance)) return true;
  }
  return false;
}

}  // namespace

Publisher::Publisher(std::vector<std::unique_ptr<Sink>> sinks, PublisherOptions options)
    : options_(options),
      sinks_(std::move(sinks)),
      states_(options.queue),
      modes_(options.modes_queue) {
  if (options.state_every < 1) throw std::invalid_argument("publisher: state_every is below 1");
  if (!(options.modes_heartbeat >= 0)) {
    throw std::invalid_argument("publisher: modes_heartbeat is not at least 0 s");
  }
  if (!(options.modes_tolerance >= 0)) {
    throw std::invalid_argument("publisher: modes_tolerance is not at least 0");
  }
  modes_message_.sequence = sampled_message_.sequence = 0;
}

void Publisher::stop() {
  if (thread_.joinable()) {
    stop_.store(true, std::memory_order_release);
    thread_.join();
  }
  publish_pending();
  for (const auto& sink : sinks_) {
    if (!sink->finish()) count(send_errors_);
  }
}

void Publisher::offer(const StateSample& sample) noexcept {
  if (ticks_until_state_ > 0) {
    --ticks_until_state_;
    return;
  }
  states_.push(sample);
  ticks_until_state_ = options_.state_every - 1;
}

void Publisher::offer(const ModesSample& sample) noexcept {
  ++offered_modes_.number;
  offered_modes_.sample = sample;
  if (!modes_.push(offered_modes_)) overflow_.write(offered_modes_);
}

void Publisher::offer(const SampledModesSample& sample) noexcept {
  sampled_.write(sample);
}

void Publisher::start() {
  thread_ = std::thread([this] { run(); });
}

void Publisher::run() {
  while (!stop_.load(std::memory_order_acquire)) {
    publish_pending();
    std::this_thread::sleep_for(options_.poll);
  }
}

void Publisher::publish_pending() {
  // No more than were waiting at the start, so that modes get their turn with slow sinks as well.
  for (std::size_t i = 0; i < options_.queue; ++i) {
    const StateSample* sample = states_.front();
    if (sample == nullptr) break;
    fill(*sample, state_message_);
    const bool contact = sample->contact_force.has_value();
    if (contact) fill(*sample, contact_message_);
    states_.pop();
    state_message_.states_dropped = states_.dropped();
    if (contact) send(kContactChannel, contact_message_);
    send(kStateChannel, state_message_);
    count(states_sent_);
  }
  for (std::size_t i = 0; i < options_.modes_queue; ++i) {
    const NumberedModes* modes = modes_.front();
    if (modes == nullptr) break;
    publish(*modes);
    modes_.pop();
  }
  if (overflow_.fetch()) publish(overflow_.value());
  if (!sampled_.fetch()) return;
  ++sampled_message_.sequence;
  fill(sampled_.value(), sampled_message_);
  send(kSampledModesChannel, sampled_message_);
  count(sampled_sent_);
}

void Publisher::publish(const NumberedModes& modes) {
  if (modes.number <= published_number_) return;
  published_number_ = modes.number;
  const ModesSample& sample = modes.sample;
  if (!is_new(sample)) return count(modes_skipped_);
  ++modes_message_.sequence;
  fill(sample, modes_message_);
  send(kModesChannel, modes_message_);
  published_modes_ = sample;
  count(modes_sent_);
}

template <class Message>
void Publisher::send(const char* channel, const Message& message) {
  encode(message, bytes_);
  for (const auto& sink : sinks_) {
    if (!sink->send(channel, bytes_, message.utime)) count(send_errors_);
  }
}

bool Publisher::is_new(const ModesSample& sample) const {
  const double silence = 1e-6 * (static_cast<double>(sample.utime) -  // whatever the times are
                                 static_cast<double>(published_modes_.utime));
  return !(silence < options_.modes_heartbeat) ||
         differ(sample.vibration, published_modes_.vibration, options_.modes_tolerance);
}

PublisherCounters Publisher::counters() const noexcept {
  return {states_sent_.load(std::memory_order_relaxed),
          modes_sent_.load(std::memory_order_relaxed),
          modes_skipped_.load(std::memory_order_relaxed),
          states_.dropped(),
          modes_.dropped(),
          sampled_sent_.load(std::memory_order_relaxed),
          send_errors_.load(std::memory_order_relaxed)};
}

}  // namespace dashpot::lcmtypes
