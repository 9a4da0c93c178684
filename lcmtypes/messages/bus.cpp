#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/log_file.hpp>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <lcm/lcm-cpp.hpp>
#include <stdexcept>
#include <string_view>
#include <system_error>

namespace dashpot::lcmtypes {
namespace {

constexpr std::string_view kFile = "file://";

/// Throws std::runtime_error with the reason if LCM must not read this log of a file:// URL,
/// because LCM crashes on a wrong length.
void check_log(const std::string& url) {
  const std::string options = url.substr(std::min(url.find('?'), url.size()));
  const bool writes = options.find("mode=w") != std::string::npos;
  if (writes && options.find("mode=r") == std::string::npos) return;
  const std::string path = path_of(url);
  std::error_code unknown;
  if (std::filesystem::exists(path, unknown) && !std::filesystem::is_regular_file(path, unknown)) {
    throw std::runtime_error("not a regular file");
  }
  LogFile log(path);
  while (log.read()) {
  }
  const std::string damage = describe(log.damage());
  if (!damage.empty()) throw std::runtime_error(damage);
}

}  // namespace

std::string default_url() {
  const char* url = std::getenv("LCM_DEFAULT_URL");
  return url != nullptr && *url != '\0' ? url : "udpm://239.255.76.67:7667?ttl=0";
}

std::string path_of(const std::string& url) {
  if (!url.starts_with(kFile)) return "";
  return url.substr(kFile.size(), std::min(url.find('?'), url.size()) - kFile.size());
}

std::shared_ptr<lcm::LCM> open_bus(const std::string& url) {
  const std::string chosen = url.empty() ? default_url() : url;
  const auto begins = [&chosen](const char* provider) { return chosen.starts_with(provider); };
  if (!begins("udpm://") && !begins("memq://") && !begins("file://") && !begins("tcpq://")) {
    throw std::runtime_error("cannot open the LCM bus " + chosen +
                             ": it does not begin with udpm://, memq://, file:// or tcpq://");
  }
  try {
    if (!path_of(chosen).empty()) check_log(chosen);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error("cannot open the LCM bus " + chosen + ": " + error.what());
  }
  auto bus = std::make_shared<lcm::LCM>(chosen);
  if (!bus->good()) throw std::runtime_error("cannot open the LCM bus " + chosen);
  return bus;
}

}  // namespace dashpot::lcmtypes
