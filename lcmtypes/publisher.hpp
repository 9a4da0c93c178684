#pragma once
#include <dashpot/controller/latest.hpp>
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
  std::size_t queue = 1024;       ///< states that may wait
  std::size_t modes_queue = 64;   ///< modes that may wait
  std::chrono::microseconds poll{1000};  ///< how often the thread looks for new samples
};

/// How many messages went out since the start, each counted once however many sinks it went to.
struct PublisherCounters {
  std::int64_t states = 0;
  std::int64_t modes = 0;
  std::int64_t modes_skipped = 0;   ///< not new
  std::int64_t states_dropped = 0;  ///< no room in the queue
  std::int64_t modes_dropped = 0;   ///< likewise; the latest of them goes out all the same
  std::int64_t sampled_modes = 0;
  std::int64_t send_errors = 0;  ///< of any sink
};

/// Publishes what the real-time thread offers: every `state_every`-th state, and modes when the
/// configuration, their number, kind, label, frequency or ratio has changed. Those of the sampled
/// loop come seldom: the latest is published. `offer` is for one
/// thread and never waits, allocates or calls the system. The rest happens in a thread of its own
/// after `start()`; a simulation that is faster than real time calls `publish_pending()` instead.
class Publisher {
 public:
  /// Each message is encoded once and goes to every sink. Throws std::invalid_argument for options
  /// out of range.
  explicit Publisher(std::vector<std::unique_ptr<Sink>> sinks, PublisherOptions options = {});
  ~Publisher() { stop(); }
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;

  void offer(const StateSample& sample) noexcept;
  void offer(const ModesSample& sample) noexcept;
  void offer(const SampledModesSample& sample) noexcept;

  /// Starts the thread; to be called once.
  void start();
  /// Ends the thread, if there is one, and publishes what is still waiting.
  void stop();
  /// Publishes what is waiting, on the caller's thread. Not between `start()` and `stop()`.
  void publish_pending();

  PublisherCounters counters() const noexcept;

 private:
  struct NumberedModes {
    std::uint64_t number = 0;  ///< of those offered, from 1
    ModesSample sample;
  };
  void run();
  /// Unless later ones went out already.
  void publish(const NumberedModes& modes);
  template <class Message>
  void send(const char* channel, const Message& message);
  bool is_new(const ModesSample& sample) const;

  PublisherOptions options_;
  std::vector<std::unique_ptr<Sink>> sinks_;

  // Between the two threads
  SampleQueue<StateSample> states_;
  SampleQueue<NumberedModes> modes_;
  controller::Latest<NumberedModes> overflow_;  ///< the latest that found no room
  controller::Latest<SampledModesSample> sampled_;
  std::atomic<bool> stop_{false};
  std::atomic<std::int64_t> states_sent_{0};
  std::atomic<std::int64_t> modes_sent_{0};
  std::atomic<std::int64_t> modes_skipped_{0};
  std::atomic<std::int64_t> sampled_sent_{0};
  std::atomic<std::int64_t> send_errors_{0};

  // The real-time thread's
  int ticks_until_state_ = 0;
  NumberedModes offered_modes_;  ///< the last

  // The publishing thread's
  ModesSample published_modes_;  ///< without joints before the first
  std::uint64_t published_number_ = 0;
  state_t state_message_;
  modes_t modes_message_;
  sampled_modes_t sampled_message_;
  std::vector<std::uint8_t> bytes_;
  std::thread thread_;
};

}  // namespace dashpot::lcmtypes
