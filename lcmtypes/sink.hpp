#pragma once
#include <dashpot/lcmtypes/bus.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace dashpot::lcmtypes {

/// Where encoded messages go. Used by one thread, which may have to wait.
class Sink {
 public:
  Sink() = default;
  Sink(const Sink&) = delete;
  Sink& operator=(const Sink&) = delete;
  virtual ~Sink() = default;

  /// `utime`: of what the message tells, us since 1970-01-01 UTC. Returns false if it got lost.
  virtual bool send(const std::string& channel, const std::vector<std::uint8_t>& bytes,
                    std::int64_t utime) = 0;
};

/// Sends over a bus.
std::unique_ptr<Sink> make_bus_sink(std::shared_ptr<lcm::LCM> bus);

/// Writes a log that lcm-logplayer and other readers of LCM understand; its times are those of the
/// samples, so that a simulation in fast motion is replayed at the robot's pace. An existing file
/// is overwritten. Throws std::runtime_error that names the file and the reason.
std::unique_ptr<Sink> make_log_sink(const std::string& path);

}  // namespace dashpot::lcmtypes
