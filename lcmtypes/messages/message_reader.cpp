#include <dashpot/lcmtypes/message_check.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>

#include <lcm/lcm-cpp.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

namespace dashpot::lcmtypes {
namespace {

template <class Message>
bool hand_on(const void* data, std::size_t size,
             const std::function<void(const Message&)>& handler) {
  Message message;
  if (!decode(data, size, message)) return false;
  if (handler) handler(message);
  return true;
}

}  // namespace

void MessageHandlers::take(std::string_view channel, const void* data, std::size_t size) {
  bool good = true;
  if (channel == kStateChannel) good = hand_on(data, size, on_state);
  if (channel == kModesChannel) good = hand_on(data, size, on_modes);
  if (channel == kSampledModesChannel) good = hand_on(data, size, on_sampled_modes);
  if (channel == kContactChannel) good = hand_on(data, size, on_contact);
  if (!good) ++malformed;
}

struct BusReader::Subscriptions {
  MessageHandlers* handlers = nullptr;
  std::vector<lcm::Subscription*> all;

  void take(const lcm::ReceiveBuffer* buffer, const std::string& channel) {
    handlers->take(channel, buffer->data, buffer->data_size);
  }
};

BusReader::BusReader(std::shared_ptr<lcm::LCM> bus, MessageHandlers& handlers)
    : bus_(std::move(bus)), subscriptions_(std::make_unique<Subscriptions>()) {
  subscriptions_->handlers = &handlers;
  for (const char* channel :
       {kStateChannel, kModesChannel, kSampledModesChannel, kContactChannel}) {
    lcm::Subscription* subscription =
        bus_->subscribe(channel, &Subscriptions::take, subscriptions_.get());
    if (subscription == nullptr) throw std::runtime_error("cannot subscribe to the LCM bus");
    subscriptions_->all.push_back(subscription);
  }
}

BusReader::~BusReader() {
  for (lcm::Subscription* subscription : subscriptions_->all) bus_->unsubscribe(subscription);
}

bool BusReader::wait(int milliseconds) {
  return bus_->handleTimeout(milliseconds) >= 0;
}

void LogReader::handle() {
  const LogFile::Event& event = file_.event();
  constexpr std::size_t kNamed = 8;
  if (event.channel.starts_with("DASHPOT_"))
    ours_ = true;
  else if (others_.size() < kNamed)
    others_.insert(event.channel);
  handlers_.take(event.channel, event.data.data(), event.size);
}

std::string LogReader::foreign() const {
  if (ours_ || others_.empty()) return "";
  std::string names;
  for (const std::string& name : others_) names += (names.empty() ? "" : ", ") + name;
  return "has no messages of Dashpot; its channels are " + names;
}

}  // namespace dashpot::lcmtypes
