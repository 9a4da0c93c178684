#include <dashpot/lcmtypes/command_receiver.hpp>

#include <chrono>
#include <lcm/lcm-cpp.hpp>
#include <stdexcept>
#include <utility>

namespace dashpot::lcmtypes {
namespace {

constexpr int kLongestWait = 20;  // ms, between two looks at stop_
constexpr int kQueue = 256;       // messages that may wait while gains are judged

template <class Clock>
std::int64_t now() {
  const auto time = Clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::microseconds>(time).count();
}

}  // namespace

struct CommandReceiver::Subscription {
  CommandReceiver& receiver;
  lcm::Subscription* handle = nullptr;

  void take(const lcm::ReceiveBuffer* buffer, const std::string& /*channel*/) {
    CommandFilter& filter = receiver.filter_;
    filter.set_fault_tick(receiver.fault_tick_.load(std::memory_order_relaxed));
    const CommandVerdict verdict =
        filter.judge(buffer->data, buffer->data_size, now<std::chrono::system_clock>(),
                     now<std::chrono::steady_clock>());
    receiver.show_tally();
    if (verdict == CommandVerdict::kAccepted) receiver.newest_.write(filter.command());
  }
};

CommandReceiver::CommandReceiver(std::shared_ptr<lcm::LCM> bus, const CommandLimits& limits,
                                 CommandTaker take)
    : bus_(std::move(bus)),
      filter_(limits, std::move(take)),
      subscription_(new Subscription{*this}) {
  subscription_->handle =
      bus_->subscribe(kCommandChannel, &Subscription::take, subscription_.get());
  if (subscription_->handle == nullptr) {
    throw std::runtime_error("cannot subscribe to the LCM bus");
  }
  subscription_->handle->setQueueCapacity(kQueue);
  thread_ = std::thread([this] { run(); });
}

CommandReceiver::~CommandReceiver() {
  stop_.store(true, std::memory_order_release);
  thread_.join();
  bus_->unsubscribe(subscription_->handle);
}

void CommandReceiver::run() {
  while (!stop_.load(std::memory_order_acquire)) {
    const int handled = bus_->handleTimeout(kLongestWait);
    if (handled < 0) {  // a broken bus: wait, so that the loop does not spin
      std::this_thread::sleep_for(std::chrono::milliseconds(kLongestWait));
    }
    if (handled > 0 || filter_.tally().commander == 0) continue;
    filter_.notice_silence(now<std::chrono::steady_clock>());
    if (filter_.tally().commander == 0) show_tally();
  }
}

void CommandReceiver::show_tally() {
  tallies_.write(filter_.tally());
  const std::lock_guard lock(mutex_);
  tally_ = filter_.tally();
  last_reason_ = filter_.last_reason();
}

CommandTally CommandReceiver::tally() const {
  const std::lock_guard lock(mutex_);
  return tally_;
}

std::string CommandReceiver::last_reason() const {
  const std::lock_guard lock(mutex_);
  return last_reason_;
}

}  // namespace dashpot::lcmtypes
