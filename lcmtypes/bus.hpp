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
inline constexpr const char* kCommandChannel = "DASHPOT_COMMAND";

/// The environment's LCM_DEFAULT_URL, or else udpm://239.255.76.67:7667?ttl=0: multicast whose
/// messages do not leave this machine, though those of others can come in.
std::string default_url();

/// Of a file:// URL: the log that it names; otherwise "".
std::string path_of(const std::string& url);

/// Opens a bus: udpm://, memq:// (within the process: all who take part share the pointer),
/// file://, tcpq://; empty for default_url(). Throws std::runtime_error that names the URL, also
/// for a log that is damaged or cut off (LogReader reads what is left of it). One thread at a time
/// may handle messages; any may publish.
std::shared_ptr<lcm::LCM> open_bus(const std::string& url);

}  // namespace dashpot::lcmtypes
