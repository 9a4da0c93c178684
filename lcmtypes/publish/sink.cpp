#include <dashpot/lcmtypes/sink.hpp>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <lcm/lcm-cpp.hpp>
#include <stdexcept>
#include <utility>

namespace dashpot::lcmtypes {
namespace {

constexpr std::int64_t kFlushPeriod = 1'000'000;  // us

class BusSink : public Sink {
 public:
  explicit BusSink(std::shared_ptr<lcm::LCM> bus) : bus_(std::move(bus)) {}

  bool send(const std::string& channel, const std::vector<std::uint8_t>& bytes,
            std::int64_t /*utime*/) override {
    return bus_->publish(channel, bytes.data(), static_cast<unsigned>(bytes.size())) == 0;
  }

 private:
  std::shared_ptr<lcm::LCM> bus_;
};

class LogSink : public Sink {
 public:
  explicit LogSink(const std::string& path) : file_(path, "w") {
    if (!file_.good()) {
      throw std::runtime_error(path + ": cannot write the log: " + std::strerror(errno));
    }
  }

  bool send(const std::string& channel, const std::vector<std::uint8_t>& bytes,
            std::int64_t utime) override {
    lcm::LogEvent event;
    event.eventnum = 0;  // filled in by writeEvent
    event.timestamp = utime;
    event.channel = channel;
    event.datalen = static_cast<std::int32_t>(bytes.size());
    event.data = const_cast<std::uint8_t*>(bytes.data());  // it is only read
    bool good = file_.writeEvent(&event) == 0;
    // So that a killed run leaves its log; also if the time goes back or is invalid.
    const auto since = static_cast<std::uint64_t>(utime) - static_cast<std::uint64_t>(flushed_at_);
    if (since >= static_cast<std::uint64_t>(kFlushPeriod)) {
      flushed_at_ = utime;
      good = std::fflush(file_.getFilePtr()) == 0 && good;
    }
    return good;
  }

  bool finish() override { return std::fflush(file_.getFilePtr()) == 0; }

 private:
  lcm::LogFile file_;
  std::int64_t flushed_at_ = 0;
};

}  // namespace

std::unique_ptr<Sink> make_bus_sink(std::shared_ptr<lcm::LCM> bus) {
  return std::make_unique<BusSink>(std::move(bus));
}

std::unique_ptr<Sink> make_log_sink(const std::string& path) {
  return std::make_unique<LogSink>(path);
}

}  // namespace dashpot::lcmtypes
