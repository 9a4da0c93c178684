#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/web/web_site.hpp>
#include <dashpot/controller/input_error.hpp>

#include <cmath>
#include <cstdlib>
#include <exception>
#include <limits>
#include <stdexcept>
#include <utility>

namespace dashpot::apps {
namespace {

HttpAnswer json_answer(const Json& document) {
  return {200, "application/json", std::make_shared<const std::string>(line_of(document))};
}

HttpAnswer complaint(unsigned status, const std::string& reason) {
  HttpAnswer answer = json_answer({{"error", reason}});
  answer.status = status;
  return answer;
}

std::string value_of(const std::map<std::string, std::string>& query, const std::string& key) {
  const auto found = query.find(key);
  return found == query.end() ? "" : found->second;
}

}  // namespace

WebSite::WebSite(std::string source, std::optional<ArmView> arm, std::unique_ptr<LogFrames> log,
                 Json identified)
    : source_(std::move(source)),
      arm_(std::move(arm)),
      log_(std::move(log)),
      identified_(std::move(identified)) {}

Json WebSite::setup() const {
  Json document{{"source", source_}, {"live", live()}};
  document["duration"] = live() ? Json() : Json(log_->duration());
  document["damage"] = live() ? "" : log_->damage();
  document["arm"] = arm_ ? arm_->chain() : Json();
  document["period"] = arm_ ? Json(arm_->period()) : Json();
  document["gain_margin"] = arm_ ? Json(arm_->gain_margin()) : Json();
  document["wanted_ratio"] = {{"joint", arm_ ? arm_->wanted_ratio(state_t::JOINT) : 0},
                              {"cartesian", arm_ ? arm_->wanted_ratio(state_t::CARTESIAN) : 0}};
  document["identified"] = identified_;
  return document;
}

Frame WebSite::live_frame() const {
  Frame frame = frame_;
  frame.age = std::chrono::duration<double>(std::chrono::steady_clock::now() - came_at_).count();
  return frame;
}

Frame WebSite::frame_at(const std::map<std::string, std::string>& query) {
  if (live()) {
    const std::lock_guard lock(mutex_);
    return live_frame();
  }
  const std::string time = value_of(query, "t");
  char* end = nullptr;
  const double t = std::strtod(time.c_str(), &end);
  return log_->at(time.empty() || *end != '\0' ? std::numeric_limits<double>::infinity() : t);
}

HttpAnswer WebSite::response(const std::map<std::string, std::string>& query) {
  if (!arm_) return complaint(404, "without --config there is no arm");
  const Frame frame = frame_at(query);
  if (!frame.state && !frame.modes) return complaint(404, "there is no posture yet");
  const auto& posture = frame.state ? frame.state->joint_position : frame.modes->joint_position;
  const bool joint = frame.state && frame.state->mode == state_t::JOINT;
  const auto mode = joint ? state_t::JOINT : state_t::CARTESIAN;
  try {
    return json_answer(arm_->response(posture, mode, value_of(query, "at")));
  } catch (const controller::InputError& error) {
    return complaint(400, error.what());
  } catch (const std::exception& error) {
    return complaint(404, error.what());
  }
}

HttpAnswer WebSite::answer(const std::string& path,
                           const std::map<std::string, std::string>& query) {
  if (path == "/setup") return json_answer(setup());
  if (path == "/frame") return json_answer(frame_at(query).json());
  if (path == "/response") return response(query);
  if (path == "/history" && log_) return json_answer(log_->history(1500));
  if (const PageFile* file = find_page_file(path)) {
    return {200, std::string(file->type), std::make_shared<const std::string>(file->text)};
  }
  return {404, "text/plain", std::make_shared<const std::string>("not found\n")};
}

std::shared_ptr<const std::string> WebSite::next_event() {
  const auto now = std::chrono::steady_clock::now();
  Json document;
  {
    const std::lock_guard lock(mutex_);
    if (frame_.messages == sent_ && now - sent_at_ < std::chrono::seconds(1)) return nullptr;
    sent_ = frame_.messages;
    document = live_frame().json();
  }
  sent_at_ = now;
  return std::make_shared<const std::string>("data: " + line_of(document) + "\n\n");
}

}  // namespace dashpot::apps
