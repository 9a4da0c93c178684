#pragma once
#include <chrono>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <string>

namespace dashpot::apps {

/// A page, a number or a refusal.
struct HttpAnswer {
  unsigned status = 200;
  std::string type;                         ///< "application/json"
  std::shared_ptr<const std::string> body;  ///< not null
  std::string allow = {};                   ///< of status 405: methods that are taken
};

/// What the server serves, called on the thread of HttpServer::run.
struct HttpContent {
  /// Answers a GET; the path begins with "/", and nothing in it or in the query is checked yet.
  std::function<HttpAnswer(const std::string& path,
                           const std::map<std::string, std::string>& query)>
      answer;
  /// Answers a POST of JSON; if empty, POST is refused. Nothing in the body is checked yet.
  std::function<HttpAnswer(const std::string& path, const std::string& body)> post;
  std::string token;  ///< that a POST must have in the header X-Dashpot-Token
  /// Returns the next text for every event stream, or null if there is nothing new. Streams are at
  /// "/stream"; if this is empty, there are none.
  std::function<std::shared_ptr<const std::string>()> next_event;
};

/// Serves requests on 127.0.0.1 alone, on one thread, by libmicrohttpd.
///
/// Everything is bounded: kMostConnections connections, of them kMostStreams event streams; 32 KiB
/// of memory for each connection; a request that is incomplete after kRequestTime, and a client
/// that takes nothing for that long, are cut off. A new connection beyond the bound ends the oldest
/// connection other than a stream, so neither many nor slow clients shut others out. A stream with
/// a slow client skips events: the latest one counts.
///
/// A request is refused unless its Host is this server (which prevents DNS rebinding), its Origin,
/// if it has one, is this server's page, its method is GET, and it has no body. If the content
/// answers POSTs, a POST is accepted with JSON of at most kMostBody bytes and the content's token,
/// which a page of another origin cannot read.
class HttpServer {
 public:
  static constexpr std::size_t kMostConnections = 48;
  static constexpr std::size_t kMostStreams = 8;
  static constexpr std::size_t kMostBody = 65536;
  static constexpr std::chrono::seconds kRequestTime{5};
  static constexpr std::chrono::milliseconds kEventPeriod{100};

  /// Listens on `port`, 0 for any that is free. Throws std::runtime_error with port and reason.
  HttpServer(int port, HttpContent content);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  int port() const noexcept;
  /// Serves until `stop` returns true, which is asked about ten times a second or more often.
  void run(const std::function<bool()>& stop);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace dashpot::apps
