#pragma once
#include <dashpot/controller/latest.hpp>
#include <dashpot/lcmtypes/contact_t.hpp>
#include <dashpot/lcmtypes/modes_t.hpp>
#include <dashpot/lcmtypes/publish/sample_queue.hpp>
#include <dashpot/lcmtypes/sampled_modes_t.hpp>
#include <dashpot/lcmtypes/samples.hpp>
#include <dashpot/lcmtypes/sink.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

namespace dashpot::lcmtypes {

struct PublisherOptions {
  int state_every = 1;            ///< ticks between two state messages, at least 1
  double modes_heartbeat = 1;     ///< unchanged modes are repeated this often, s
  double modes_tolerance = 1e-6;  ///< changes up to this do not count: of a joint, rad (m); of a
                                  ///< frequency or ratio, relative
  std::size_t queue = 1024;       ///< number of states that may wait
  std::size_t modes_queue = 64;   ///< number of modes that may wait
  std::chrono::microseconds poll{1000};  ///< how often the thread looks for new samples
};

/// Numbers of messages since the start. A message counts once, however many sinks it goes to.
struct PublisherCounters {
  std::int64_t states = 0;
  std::int64_t modes = 0;
  std::int64_t modes_skipped = 0;   ///< not new
  std::int64_t states_dropped = 0;  ///< no room in the queue
  std::int64_t modes_dropped = 0;   ///< no room in the queue; the latest goes out all the same
  std::int64_t sampled_modes = 0;
  std::int64_t send_errors = 0;  ///< of all sinks
};

/// Publishes what the real-time thread offers: every `state_every`-th state, and modes if the
/// configuration or the modes' number, kind, label, frequency or ratio has changed. Of the modes of
/// the sampled loop, which come seldom, the latest are published. One thread calls `offer`, which
/// never waits, allocates or calls the system. After `start()` a thread of its own publishes; a
/// simulation that is faster than real time calls `publish_pending()` instead.
class Publisher {
 public:
  /// Sends each message, which is encoded once, to every sink. Throws std::invalid_argument for
  /// options out of range.
  explicit Publisher(std::vector<std::unique_ptr<Sink>> sinks, PublisherOptions options = {});
  ~Publisher() { stop(); }
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;

  void offer(const StateSample& sample) noexcept;
  void offer(const ModesSample& sample) noexcept;
  void offer(const SampledModesSample& sample) noexcept;

  /// Starts the thread. May be called once.
  void start();
  /// Ends the thread, if there is one, and publishes all samples that wait.
  void stop();
  /// Publishes all samples that wait, on the caller's thread. Must not be called between `start()`
  /// and `stop()`.
  void publish_pending();

  PublisherCounters counters() const noexcept;

 private:
  struct NumberedModes {
    std::uint64_t number = 0;  ///< of the modes offered, counted from 1
    ModesSample sample;
  };
  void run();
  /// Publishes modes unless later ones were published already.
  void publish(const NumberedModes& modes);
  template <class Message>
  void send(const char* channel, const Message& message);
  bool is_new(const ModesSample& sample) const;

  PublisherOptions options_;
  std::vector<std::unique_ptr<Sink>> sinks_;

  // Between the two threads
  SampleQueue<StateSample> states_;
  SampleQueue<NumberedModes> modes_;
  controller::Latest<NumberedModes> overflow_;  ///< the latest modes that found no room
  controller::Latest<SampledModesSample> sampled_;
  std::atomic<bool> stop_{false};
  std::atomic<std::int64_t> states_sent_{0};
  std::atomic<std::int64_t> modes_sent_{0};
  std::atomic<std::int64_t> modes_skipped_{0};
  std::atomic<std::int64_t> sampled_sent_{0};
  std::atomic<std::int64_t> send_errors_{0};

  // The real-time thread's
  int ticks_until_state_ = 0;
  NumberedModes offered_modes_;  ///< offered last

  // The publishing thread's
  ModesSample published_modes_;  ///< published last; without joints before the first
  std::uint64_t published_number_ = 0;
  state_t state_message_;
  contact_t contact_message_;
  modes_t modes_message_;
  sampled_modes_t sampled_message_;
  std::vector<std::uint8_t> bytes_;
  std::thread thread_;
};

}  // namespace dashpot::lcmtypes
