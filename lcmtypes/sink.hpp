#pragma once
#include <dashpot/lcmtypes/bus.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace dashpot::lcmtypes {

/// Takes encoded messages. One thread uses it, which may have to wait.
class Sink {
 public:
  Sink() = default;
  Sink(const Sink&) = delete;
  Sink& operator=(const Sink&) = delete;
  virtual ~Sink() = default;

  /// Sends a message. `utime` is the time of its sample, us since 1970-01-01 UTC. Returns false if
  /// the message got lost.
  virtual bool send(const std::string& channel, const std::vector<std::uint8_t>& bytes,
                    std::int64_t utime) = 0;
  /// Writes out all that waits in memory. Returns false if some of it got lost.
  virtual bool finish() { return true; }
};

/// Returns a sink that sends over a bus.
std::unique_ptr<Sink> make_bus_sink(std::shared_ptr<lcm::LCM> bus);

/// Returns a sink that writes a log, which lcm-logplayer and other readers of LCM understand. Its
/// times are the times of the samples, so that a simulation in fast motion is replayed at the
/// robot's pace. An existing file is overwritten. Throws std::runtime_error that names the file and
/// the reason.
std::unique_ptr<Sink> make_log_sink(const std::string& path);

}  // namespace dashpot::lcmtypes
