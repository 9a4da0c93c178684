#include <dashpot/lcmtypes/bus.hpp>

#include <cstdlib>
#include <lcm/lcm-cpp.hpp>
#include <stdexcept>

namespace dashpot::lcmtypes {

std::string default_url() {
  const char* url = std::getenv("LCM_DEFAULT_URL");
  return url != nullptr && *url != '\0' ? url : "udpm://239.255.76.67:7667?ttl=0";
}

std::shared_ptr<lcm::LCM> open_bus(const std::string& url) {
  const std::string chosen = url.empty() ? default_url() : url;
  const auto begins = [&chosen](const char* provider) { return chosen.starts_with(provider); };
  if (!begins("udpm://") && !begins("memq://") && !begins("file://") && !begins("tcpq://")) {
    throw std::runtime_error("cannot open the LCM bus " + chosen +
                             ": it begins with none of udpm://, memq://, file://, tcpq://");
  }
  auto bus = std::make_shared<lcm::LCM>(chosen);
  if (!bus->good()) throw std::runtime_error("cannot open the LCM bus " + chosen);
  return bus;
}

}  // namespace dashpot::lcmtypes
