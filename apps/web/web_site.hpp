#pragma once
#include <dashpot/apps/web/arm_view.hpp>
#include <dashpot/apps/web/frame.hpp>
#include <dashpot/apps/web/http_server.hpp>
#include <dashpot/apps/web/log_frames.hpp>

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

namespace dashpot::apps {

/// The file of the page at a path ("/monitor/main.js"), and its type; null at any other path. The
/// files are part of the program.
struct PageFile {
  std::string_view path, type, text;
};
const PageFile* find_page_file(std::string_view path);

/// Serves the pages of `dashpot monitor --web` with a live frame, or the frames of a log.
class WebSite {
 public:
  /// `source` is its name on the page. Without `log` it is live. `identified` is the JSON of
  /// measured modes, or null.
  WebSite(std::string source, std::optional<ArmView> arm, std::unique_ptr<LogFrames> log,
          nlohmann::ordered_json identified);

  /// Takes a message of the live bus; from any thread.
  template <class Message>
  void take(const Message& message) {
    const std::lock_guard lock(mutex_);
    frame_.take(message);
    came_at_ = std::chrono::steady_clock::now();
  }
  /// A request cannot change what the server shows. On the server's thread.
  HttpAnswer answer(const std::string& path, const std::map<std::string, std::string>& query);
  /// The next event, or null if there was no message since the last one and a second has not
  /// passed. On the server's thread.
  std::shared_ptr<const std::string> next_event();
  bool live() const { return log_ == nullptr; }

 private:
  Frame live_frame() const;  ///< mutex_ is held
  Frame frame_at(const std::map<std::string, std::string>& query);
  nlohmann::ordered_json setup() const;
  HttpAnswer response(const std::map<std::string, std::string>& query);

  std::string source_;
  std::optional<ArmView> arm_;
  std::unique_ptr<LogFrames> log_;
  nlohmann::ordered_json identified_;
  std::mutex mutex_;
  Frame frame_;
  std::chrono::steady_clock::time_point came_at_ = std::chrono::steady_clock::now();
  std::int64_t sent_ = -1;
  std::chrono::steady_clock::time_point sent_at_{};
};

}  // namespace dashpot::apps
