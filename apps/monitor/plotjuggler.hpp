#pragma once
#include <dashpot/apps/report/message_json.hpp>

#include <string>

namespace dashpot::apps {

/// Sends messages as JSON over UDP to a program on this machine, one datagram each:
/// {"timestamp": s since 1970-01-01 UTC, "DASHPOT_STATE": {...}}. PlotJuggler's UDP server takes
/// them with the protocol "json" and the field "timestamp". The receiver may be absent.
class PlotJuggler {
 public:
  static constexpr int kPort = 9870;  ///< that PlotJuggler proposes

  /// Throws std::runtime_error.
  explicit PlotJuggler(int port);
  ~PlotJuggler();
  PlotJuggler(const PlotJuggler&) = delete;
  PlotJuggler& operator=(const PlotJuggler&) = delete;

  template <class Message>
  void send(const char* channel, const Message& message) {
    send(nlohmann::ordered_json{{"timestamp", 1e-6 * static_cast<double>(message.utime)},
                                {channel, message_json(message)}}
             .dump());
  }

 private:
  void send(const std::string& text) const;
  int socket_;
};

}  // namespace dashpot::apps
