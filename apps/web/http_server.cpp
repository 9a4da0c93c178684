#include <dashpot/apps/web/http_server.hpp>

#include <arpa/inet.h>
#include <fcntl.h>
#include <microhttpd.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <exception>
#include <list>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace dashpot::apps {
namespace {

using HttpClock = std::chrono::steady_clock;

constexpr std::size_t kConnectionMemory = 32768;
constexpr int kBacklog = 256;  // a browser beyond the backlog waits for a second

/// Headers of every answer: nothing from other origins, no caching, no frames.
constexpr std::array<std::pair<const char*, const char*>, 6> kHeaders = {{
    {"Content-Security-Policy",
     "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self'; "
     "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"},
    {"X-Content-Type-Options", "nosniff"},
    {"Cross-Origin-Resource-Policy", "same-origin"},
    {"Cross-Origin-Opener-Policy", "same-origin"},
    {"Referrer-Policy", "no-referrer"},
    {"Cache-Control", "no-store"},
}};

HttpAnswer refusal(unsigned status, const std::string& why) {
  return {status, "text/plain; charset=utf-8", std::make_shared<const std::string>(why + "\n")};
}

int listen_on_loopback(int port) {
  const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const int on = 1;
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  void* any = &address;
  if (listener < 0 || setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0 ||
      bind(listener, static_cast<sockaddr*>(any), sizeof address) != 0 ||
      listen(listener, kBacklog) != 0) {
    const std::string reason = std::strerror(errno);
    if (listener >= 0) close(listener);
    throw std::runtime_error("cannot serve at 127.0.0.1:" + std::to_string(port) + ": " + reason);
  }
  return listener;
}

int port_of(int listener) {
  sockaddr_in address{};
  socklen_t size = sizeof address;
  void* any = &address;
  if (getsockname(listener, static_cast<sockaddr*>(any), &size) != 0) return 0;
  return ntohs(address.sin_port);
}

}  // namespace

struct HttpServer::Parts {
  /// A connection of libmicrohttpd.
  struct Client {
    int socket = -1;
    HttpClock::time_point since;  ///< when its request, or the wait for one, began
    bool stream = false;
    std::string body;  ///< of a POST
  };
  /// A response that never ends.
  struct Stream {
    Parts* parts = nullptr;
    MHD_Connection* connection = nullptr;
    std::shared_ptr<const std::string> event;
    std::size_t sent = 0;      // bytes of it
    std::uint64_t number = 0;  // of the event
    bool suspended = false;
  };

  HttpContent content;
  int listener = -1;
  int port = 0;
  MHD_Daemon* daemon = nullptr;
  std::list<Client> clients;
  std::list<Stream> streams;
  std::shared_ptr<const std::string> event;
  std::uint64_t number = 0;
  bool closing = false;

  HttpAnswer judge(MHD_Connection* connection, std::string_view method) const;
  HttpAnswer judge_post(MHD_Connection* connection) const;
  MHD_Result take(MHD_Connection* connection, const std::string& path, std::string_view method,
                  std::string_view data, std::size_t* upload, void** seen);
  MHD_Result answer(MHD_Connection* connection, const std::string& path, std::string_view method);
  MHD_Result open_stream(MHD_Connection* connection);
  ssize_t feed(Stream& stream, char* buffer, std::size_t most);
  void accept_clients();
  void cut_off_the_slow();
  void publish(std::shared_ptr<const std::string> next);
  Client& client_of(MHD_Connection* connection) const;
};

namespace {

MHD_Result queue_answer(MHD_Connection* connection, const HttpAnswer& answer) {
  MHD_Response* response = MHD_create_response_from_buffer(
      answer.body->size(), const_cast<char*>(answer.body->data()),  // copied, not changed
      MHD_RESPMEM_MUST_COPY);
  if (response == nullptr) return MHD_NO;
  for (const auto& [name, value] : kHeaders) MHD_add_response_header(response, name, value);
  MHD_add_response_header(response, "Content-Type", answer.type.c_str());
  if (!answer.allow.empty()) {
    MHD_add_response_header(response, "Allow", answer.allow.c_str());
  }
  if (answer.status != 200) MHD_add_response_header(response, "Connection", "close");
  const MHD_Result result = MHD_queue_response(connection, answer.status, response);
  MHD_destroy_response(response);
  return result;
}

std::string header(MHD_Connection* connection, const char* name) {
  const char* value = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, name);
  return value == nullptr ? "" : value;
}

}  // namespace

HttpServer::Parts::Client& HttpServer::Parts::client_of(MHD_Connection* connection) const {
  const MHD_ConnectionInfo* info =
      MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
  return *static_cast<Client*>(info->socket_context);
}

/// An answer without body if the request may be answered.
HttpAnswer HttpServer::Parts::judge(MHD_Connection* connection, std::string_view method) const {
  const std::string end = ":" + std::to_string(port);
  const auto is_ours = [&end](const std::string& host) {
    return host == "127.0.0.1" + end || host == "localhost" + end;
  };
  if (!is_ours(header(connection, "Host"))) return refusal(403, "wrong Host");
  const std::string origin = header(connection, "Origin");
  if (!origin.empty() && !(origin.starts_with("http://") && is_ours(origin.substr(7)))) {
    return refusal(403, "wrong Origin");
  }
  if (method == "POST" && content.post) return judge_post(connection);
  if (method != "GET") {
    HttpAnswer refused = content.post ? refusal(405, "GET and POST only")
                                      : refusal(405, "GET only: nothing can be changed here");
    refused.allow = content.post ? "GET, POST" : "GET";
    return refused;
  }
  if (!header(connection, "Content-Length").empty() ||
      !header(connection, "Transfer-Encoding").empty()) {
    return refusal(400, "no body is taken");
  }
  return {};
}

/// Judges the headers of a POST likewise.
HttpAnswer HttpServer::Parts::judge_post(MHD_Connection* connection) const {
  if (header(connection, "X-Dashpot-Token") != content.token) return refusal(403, "wrong token");
  if (header(connection, "Content-Type") != "application/json") {
    return refusal(415, "JSON alone is taken");
  }
  if (!header(connection, "Transfer-Encoding").empty()) {  // its length is unknown
    return refusal(411, "a body in chunks is not taken");
  }
  const std::string length = header(connection, "Content-Length");
  if (length.empty() || length.find_first_not_of("0123456789") != std::string::npos) {
    return refusal(411, "the length of the body is missing");
  }
  if (length.size() > 6 || std::stoul(length) > kMostBody) return refusal(413, "too long a body");
  return {};
}

/// Takes one call of libmicrohttpd for a request: with the headers alone, then with parts of the
/// body, and at its end.
MHD_Result HttpServer::Parts::take(MHD_Connection* connection, const std::string& path,
                                   std::string_view method, std::string_view data,
                                   std::size_t* upload, void** seen) {
  *upload = 0;
  if (*seen == nullptr && !judge(connection, method).body) {
    *seen = this;
    client_of(connection).body.clear();
    return MHD_YES;
  }
  if (*seen != nullptr && !data.empty()) {
    std::string& body = client_of(connection).body;
    if (body.size() + data.size() > kMostBody) return MHD_NO;
    body.append(data);
    return MHD_YES;
  }
  return answer(connection, path, method);
}

MHD_Result HttpServer::Parts::answer(MHD_Connection* connection, const std::string& path,
                                     std::string_view method) {
  const HttpAnswer refused = judge(connection, method);
  if (refused.body) return queue_answer(connection, refused);
  if (method == "POST")
    return queue_answer(connection, content.post(path, client_of(connection).body));
  if (path == "/stream" && content.next_event) return open_stream(connection);
  std::map<std::string, std::string> query;
  MHD_get_connection_values(
      connection, MHD_GET_ARGUMENT_KIND,
      [](void* map, MHD_ValueKind, const char* key, const char* value) {
        auto& all = *static_cast<std::map<std::string, std::string>*>(map);
        if (all.size() < 8) all[key] = value == nullptr ? "" : value;
        return MHD_YES;
      },
      &query);
  return queue_answer(connection, content.answer(path, query));
}

MHD_Result HttpServer::Parts::open_stream(MHD_Connection* connection) {
  if (streams.size() >= kMostStreams) {
    return queue_answer(connection, refusal(503, "too many pages are open"));
  }
  if (streams.empty()) event = nullptr;  // of an earlier page
  Stream& stream = streams.emplace_back();
  stream.parts = this;
  stream.connection = connection;
  MHD_Response* response = MHD_create_response_from_callback(
      MHD_SIZE_UNKNOWN, 4096,
      [](void* of, std::uint64_t, char* buffer, std::size_t most) {
        Stream& self = *static_cast<Stream*>(of);
        return self.parts->feed(self, buffer, most);
      },
      &stream,
      [](void* of) {
        Stream& self = *static_cast<Stream*>(of);
        self.parts->streams.remove_if([&self](const Stream& other) { return &other == &self; });
      });
  if (response == nullptr) {
    streams.pop_back();
    return MHD_NO;
  }
  for (const auto& [name, value] : kHeaders) MHD_add_response_header(response, name, value);
  MHD_add_response_header(response, "Content-Type", "text/event-stream");
  client_of(connection).stream = true;
  const MHD_Result result = MHD_queue_response(connection, 200, response);
  MHD_destroy_response(response);
  return result;
}

ssize_t HttpServer::Parts::feed(Stream& stream, char* buffer, std::size_t most) {
  if (!stream.event || stream.sent == stream.event->size()) {
    if (closing) return MHD_CONTENT_READER_END_OF_STREAM;
    if (!event || stream.number == number) {  // wait for the next
      stream.suspended = true;
      MHD_suspend_connection(stream.connection);
      return 0;
    }
    stream.event = event;
    stream.number = number;
    stream.sent = 0;
  }
  const std::size_t part = std::min(most, stream.event->size() - stream.sent);
  std::memcpy(buffer, stream.event->data() + stream.sent, part);
  stream.sent += part;
  return static_cast<ssize_t>(part);
}

void HttpServer::Parts::publish(std::shared_ptr<const std::string> next) {
  event = std::move(next);
  ++number;
  for (Stream& stream : streams) {
    if (stream.suspended) MHD_resume_connection(stream.connection);
    stream.suspended = false;
  }
}

void HttpServer::Parts::accept_clients() {
  for (int i = 0; i < kBacklog; ++i) {
    sockaddr_in address{};
    socklen_t size = sizeof address;
    void* any = &address;
    const int socket =
        accept4(listener, static_cast<sockaddr*>(any), &size, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (socket < 0) return;
    const int on = 1;
    setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    if (clients.size() >= kMostConnections) {
      const auto oldest =
          std::min_element(clients.begin(), clients.end(), [](const Client& a, const Client& b) {
            return std::pair(a.stream, a.since) < std::pair(b.stream, b.since);
          });
      shutdown(oldest->socket, SHUT_RDWR);
      MHD_run(daemon);  // lets go of it
    }
    MHD_add_connection(daemon, socket, static_cast<sockaddr*>(any), size);  // closes it on failure
    MHD_run(daemon);  // from version 1 on, this starts it
  }
}

void HttpServer::Parts::cut_off_the_slow() {
  const auto now = HttpClock::now();
  for (const Client& client : clients) {
    if (!client.stream && now - client.since > kRequestTime) shutdown(client.socket, SHUT_RDWR);
  }
}

HttpServer::HttpServer(int port, HttpContent content) : parts_(std::make_unique<Parts>()) {
  Parts& parts = *parts_;
  parts.content = std::move(content);
  parts.listener = listen_on_loopback(port);
  parts.port = port_of(parts.listener);
  const MHD_AccessHandlerCallback handle = [](void* of, MHD_Connection* connection, const char* url,
                                              const char* method, const char*, const char* data,
                                              std::size_t* upload, void** seen) {
    try {  // exceptions must not pass through a C library
      return static_cast<Parts*>(of)->take(connection, url, method, {data, *upload}, upload, seen);
    } catch (const std::exception&) {
      return MHD_NO;
    }
  };
  const MHD_NotifyConnectionCallback notify = [](void* of, MHD_Connection* connection,
                                                 void** context,
                                                 MHD_ConnectionNotificationCode code) {
    Parts& self = *static_cast<Parts*>(of);
    if (code == MHD_CONNECTION_NOTIFY_STARTED) {
      const MHD_ConnectionInfo* info =
          MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
      *context =
          &self.clients.emplace_back(Parts::Client{info->connect_fd, HttpClock::now(), false, {}});
    } else {
      const void* gone = *context;
      self.clients.remove_if([gone](const Parts::Client& client) { return &client == gone; });
    }
  };
  const MHD_RequestCompletedCallback complete = [](void* of, MHD_Connection* connection, void**,
                                                   MHD_RequestTerminationCode) {
    static_cast<Parts*>(of)->client_of(connection).since = HttpClock::now();
  };
  parts.daemon = MHD_start_daemon(
      MHD_USE_NO_LISTEN_SOCKET | MHD_USE_EPOLL | MHD_ALLOW_SUSPEND_RESUME, 0, nullptr, nullptr,
      handle, &parts, MHD_OPTION_NOTIFY_CONNECTION, notify, &parts, MHD_OPTION_NOTIFY_COMPLETED,
      complete, &parts, MHD_OPTION_CONNECTION_LIMIT, static_cast<unsigned>(2 * kMostConnections),
      MHD_OPTION_CONNECTION_MEMORY_LIMIT, kConnectionMemory, MHD_OPTION_CONNECTION_TIMEOUT,
      static_cast<unsigned>(kRequestTime.count()), MHD_OPTION_END);
  if (parts.daemon == nullptr) {
    close(parts.listener);
    throw std::runtime_error("cannot start the web server");
  }
}

HttpServer::~HttpServer() {
  parts_->closing = true;  // no stream is suspended again, or the daemon could not stop
  for (Parts::Stream& stream : parts_->streams) {
    if (stream.suspended) MHD_resume_connection(stream.connection);
    stream.suspended = false;
  }
  MHD_run(parts_->daemon);
  MHD_stop_daemon(parts_->daemon);
  close(parts_->listener);
}

int HttpServer::port() const noexcept {
  return parts_->port;
}

void HttpServer::run(const std::function<bool()>& stop) {
  Parts& parts = *parts_;
  const int events = MHD_get_daemon_info(parts.daemon, MHD_DAEMON_INFO_EPOLL_FD)->epoll_fd;
  auto next = HttpClock::now();
  while (!stop()) {
    std::array<pollfd, 2> ready{{{parts.listener, POLLIN, 0}, {events, POLLIN, 0}}};
    MHD_UNSIGNED_LONG_LONG pending = 0;  // ms until libmicrohttpd has to run again
    const bool hurried = MHD_get_timeout(parts.daemon, &pending) == MHD_YES &&
                         pending < static_cast<MHD_UNSIGNED_LONG_LONG>(kEventPeriod.count());
    poll(ready.data(), ready.size(), static_cast<int>(hurried ? pending : kEventPeriod.count()));
    if (ready[0].revents != 0) parts.accept_clients();
    MHD_run(parts.daemon);
    const auto now = HttpClock::now();
    if (now < next) continue;
    next = now + kEventPeriod;
    parts.cut_off_the_slow();
    if (!parts.streams.empty()) {
      if (auto event = parts.content.next_event()) parts.publish(std::move(event));
    }
  }
}

}  // namespace dashpot::apps
