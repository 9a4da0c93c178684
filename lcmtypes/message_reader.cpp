#include <dashpot/lcmtypes/message_check.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>

#include <cerrno>
#include <cstring>
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
  for (const char* channel : {kStateChannel, kModesChannel, kSampledModesChannel}) {
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

struct LogReader::File {
  explicit File(const std::string& path) : log(path, "r") {}
  lcm::LogFile log;
  const lcm::LogEvent* event = nullptr;
};

LogReader::LogReader(const std::string& path, MessageHandlers& handlers)
    : file_(std::make_unique<File>(path)), handlers_(handlers) {
  if (!file_->log.good()) {
    throw std::runtime_error(path + ": cannot read the log: " + std::strerror(errno));
  }
}

LogReader::~LogReader() = default;

bool LogReader::read() {
  file_->event = file_->log.readNextEvent();
  return file_->event != nullptr;
}

std::int64_t LogReader::utime() const {
  return file_->event != nullptr ? file_->event->timestamp : 0;
}

void LogReader::handle() {
  if (file_->event == nullptr) return;
  handlers_.take(file_->event->channel, file_->event->data,
                 static_cast<std::size_t>(file_->event->datalen));
}

}  // namespace dashpot::lcmtypes
