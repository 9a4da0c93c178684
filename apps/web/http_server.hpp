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
  /// Answers a POST of JSON; where this is empty, there is none. Nothing in the body is checked
  /// yet.
  std::function<HttpAnswer(const std::string& path, const std::string& body)> post;
  std::string token;  ///< that a POST has to bring in the header X-Dashpot-Token
  /// Returns the next text for every event stream, or null if there is nothing new. Streams stand
  /// at "/stream"; where this is empty, there are none.
  std::function<std::shared_ptr<const std::string>()> next_event;
};

/// Serves requests on 127.0.0.1 alone, on one thread, by libmicrohttpd.
///
/// Everything is bounded: kMostConnections connections, of them kMostStreams event streams; 32 KiB
/// of memory for each connection; a request that is not complete after kRequestTime, and a client
/// that takes nothing for that long, are cut off. A new connection beyond the bound ends the oldest
/// one that is no stream, so that neither many nor slow clients shut others out. A stream whose
/// client is slow leaves out events: the latest one counts.
///
/// A request is refused unless its Host is this server (which ends DNS rebinding), its Origin, if
/// it has one, is this server's page, its method is GET, and it has no body. Where the content
/// answers POSTs, one is taken with JSON of at most kMostBody bytes and the token of the content,
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
