#pragma once
#include <memory>
#include <string>

namespace lcm {
class LCM;
}

namespace dashpot::lcmtypes {

inline constexpr const char* kStateChannel = "DASHPOT_STATE";
inline constexpr const char* kModesChannel = "DASHPOT_MODES";
inline constexpr const char* kSampledModesChannel = "DASHPOT_SAMPLED_MODES";
inline constexpr const char* kContactChannel = "DASHPOT_CONTACT";
inline constexpr const char* kCommandChannel = "DASHPOT_COMMAND";

/// Returns the environment's LCM_DEFAULT_URL, or else udpm://239.255.76.67:7667?ttl=0: multicast
/// whose messages do not leave this machine, though messages of other machines can come in.
std::string default_url();

/// Returns the path of the log that a file:// URL names; "" for any other URL.
std::string path_of(const std::string& url);

/// Opens a bus: udpm://, memq:// (within the process; all participants share the pointer),
/// file://, tcpq://; an empty URL stands for default_url(). Throws std::runtime_error that names
/// the URL, also for a log that is damaged or cut off (LogReader reads the remaining events of such
/// a log). One thread at a time may handle messages; any thread may publish.
std::shared_ptr<lcm::LCM> open_bus(const std::string& url);

}  // namespace dashpot::lcmtypes
