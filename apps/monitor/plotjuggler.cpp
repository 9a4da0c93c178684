#include <dashpot/apps/monitor/plotjuggler.hpp>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace dashpot::apps {

PlotJuggler::PlotJuggler(int port) : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  const void* any = &address;
  if (socket_ < 0 || connect(socket_, static_cast<const sockaddr*>(any), sizeof address) != 0) {
    const std::string reason = std::strerror(errno);
    if (socket_ >= 0) close(socket_);
    throw std::runtime_error("cannot send over UDP: " + reason);
  }
}

PlotJuggler::~PlotJuggler() {
  close(socket_);
}

void PlotJuggler::send(const std::string& text) const {
  // A receiver that is slow or missing loses messages.
  (void)::send(socket_, text.data(), text.size(), MSG_DONTWAIT);
}

}  // namespace dashpot::apps
