#include <dashpot/lcmtypes/command_receiver.hpp>

#include <chrono>
#include <lcm/lcm-cpp.hpp>
#include <stdexcept>
#include <utility>

namespace dashpot::lcmtypes {
namespace {

constexpr int kLongestWait = 20;  // ms, between two looks at stop_

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
    const CommandVerdict verdict =
        receiver.filter_.judge(buffer->data, buffer->data_size, now<std::chrono::system_clock>(),
                               now<std::chrono::steady_clock>());
    if (verdict == CommandVerdict::kAccepted) receiver.newest_.write(receiver.filter_.command());
    receiver.counts_[static_cast<std::size_t>(verdict)].fetch_add(1, std::memory_order_relaxed);
  }
};

CommandReceiver::CommandReceiver(std::shared_ptr<lcm::LCM> bus, const CommandLimits& limits)
    : bus_(std::move(bus)), filter_(limits), subscription_(new Subscription{*this}) {
  subscription_->handle =
      bus_->subscribe(kCommandChannel, &Subscription::take, subscription_.get());
  if (subscription_->handle == nullptr) {
    throw std::runtime_error("cannot subscribe to the LCM bus");
  }
  thread_ = std::thread([this] { run(); });
}

CommandReceiver::~CommandReceiver() {
  stop_.store(true, std::memory_order_release);
  thread_.join();
  bus_->unsubscribe(subscription_->handle);
}

void CommandReceiver::run() {
  while (!stop_.load(std::memory_order_acquire)) {
    if (bus_->handleTimeout(kLongestWait) < 0) {  // a broken bus: nothing to do but not to spin
      std::this_thread::sleep_for(std::chrono::milliseconds(kLongestWait));
    }
  }
}

std::int64_t CommandReceiver::count(CommandVerdict verdict) const noexcept {
  return counts_[static_cast<std::size_t>(verdict)].load(std::memory_order_relaxed);
}

std::int64_t CommandReceiver::rejected() const noexcept {
  std::int64_t sum = 0;
  for (std::size_t i = 1; i < counts_.size(); ++i)
    sum += counts_[i].load(std::memory_order_relaxed);
  return sum;
}

}  // namespace dashpot::lcmtypes
