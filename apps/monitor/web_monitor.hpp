#pragma once
#include <string>

namespace dashpot::apps {

inline constexpr int kWebPort = 8024;

struct WebMonitorOptions {
  int port = kWebPort;     ///< 0: any that is free
  std::string url;         ///< of the bus; "": the default
  std::string log;         ///< to show instead; "": none
  std::string config;      ///< of the arm; "": none
  std::string identified;  ///< JSON of measured modes; "": none
};

/// Serves the page of a bus or a log until Ctrl-C. Throws InputError for bad input.
void serve_monitor(const WebMonitorOptions& options);

}  // namespace dashpot::apps
