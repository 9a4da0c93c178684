#include <dashpot/analysis/mode.hpp>
#include <dashpot/analysis/solver_status.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/web/web_site.hpp>
#include <dashpot/controller/input_error.hpp>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <limits>
#include <map>
#include <stdexcept>
#include <utility>

namespace dashpot::apps {
namespace {

template <class T>
Json or_null(const std::optional<T>& value) {
  return value ? Json(*value) : Json();
}

bool has_modes(std::int8_t status) {
  const auto of = static_cast<analysis::Status>(status);
  return of == analysis::Status::kOk || of == analysis::Status::kUncertified;
}

}  // namespace

void Alarms::take(const state_t& message) {
  const double ratio =
      message.mode == state_t::JOINT ? message.joint_damping_ratio : message.task_damping_ratio;
  if (wanted_ratio && ratio != *wanted_ratio) {
    smallest_ratio.reset();
    worst_posture.clear();
    worst_utime = 0;
    ++changes_of_ratio;
    changed_at_ = message.tick;
  }
  if (message.tick < changed_at_) changed_at_ = 0;  // the loop has restarted
  wanted_ratio = ratio;
  if (message.fault != 0 && message.fault_tick != fault_tick_) ++faults;
  fault_tick_ = message.fault != 0 ? message.fault_tick : 0;
}

void Alarms::take(const modes_t& message) {
  if (!has_modes(message.status)) ++modes_lost;
  bool bounded = true;
  for (std::size_t i = 0; i < message.damping_ratio.size(); ++i) {
    bounded = bounded && std::isfinite(message.eigenvalue_bound[i]);
    const double ratio = message.damping_ratio[i];
    const auto kind = static_cast<analysis::ModeKind>(message.kind[i]);
    if (kind == analysis::ModeKind::kSoft || !std::isfinite(ratio)) continue;
    if (message.tick < changed_at_) continue;  // the wanted ratio was another one then
    if (smallest_ratio && ratio >= *smallest_ratio) continue;
    smallest_ratio = ratio;
    worst_utime = message.utime;
    worst_posture = message.joint_position;
  }
  if (!bounded) ++bounds_lost;
}

void Alarms::take(const sampled_modes_t& message) {
  if (!has_modes(message.status) || std::isnan(message.gain_margin)) return;
  smallest_margin = std::min(smallest_margin.value_or(message.gain_margin), message.gain_margin);
}

Json Frame::json() const {
  Json document{{"utime", utime}, {"messages", messages}, {"age", age}};
  document["state"] = state ? message_json(*state) : Json();
  document["modes"] = modes ? message_json(*modes) : Json();
  document["sampled"] = sampled ? message_json(*sampled) : Json();
  document["alarms"] = {{"smallest_ratio", or_null(alarms.smallest_ratio)},
                        {"changes_of_ratio", alarms.changes_of_ratio},
                        {"worst_utime", alarms.worst_utime},
                        {"worst_posture", alarms.worst_posture},
                        {"smallest_margin", or_null(alarms.smallest_margin)},
                        {"bounds_lost", alarms.bounds_lost},
                        {"modes_lost", alarms.modes_lost},
                        {"faults", alarms.faults}};
  return document;
}

std::string line_of(const Json& document) {
  return document.dump(-1, ' ', false, Json::error_handler_t::replace);
}

namespace {

/// Hands the messages of a log to a frame.
lcmtypes::MessageHandlers frame_handlers(Frame& frame) {
  lcmtypes::MessageHandlers handlers;
  handlers.on_state = [&frame](const state_t& message) { frame.take(message); };
  handlers.on_modes = [&frame](const modes_t& message) { frame.take(message); };
  handlers.on_sampled_modes = [&frame](const sampled_modes_t& message) { frame.take(message); };
  return handlers;
}

void hand_on(const lcmtypes::LogFile::Event& event, lcmtypes::MessageHandlers& handlers) {
  handlers.take(event.channel, event.data.data(), event.data.size());
}

/// Time of an event since the first, us. Times in a log may be anything: if one runs backward, or
/// leaps by more than three years, the time of the event before is returned.
std::int64_t elapsed(std::int64_t utime, std::int64_t first, std::int64_t before) {
  constexpr std::int64_t kLongest = 100'000'000'000'000;
  const auto since = static_cast<std::int64_t>(static_cast<std::uint64_t>(utime) -
                                               static_cast<std::uint64_t>(first));
  return since >= before && since <= kLongest ? since : before;
}

bool same(const Alarms& a, const Alarms& b) {
  return a.wanted_ratio == b.wanted_ratio && a.changes_of_ratio == b.changes_of_ratio &&
         a.smallest_ratio == b.smallest_ratio && a.smallest_margin == b.smallest_margin &&
         a.bounds_lost == b.bounds_lost && a.modes_lost == b.modes_lost && a.faults == b.faults;
}

}  // namespace

LogFrames::LogFrames(const std::string& path, const std::function<bool()>& stop) : file_(path) {
  Frame frame;
  lcmtypes::MessageHandlers handlers = frame_handlers(frame);
  Entry next;
  for (std::int64_t count = 0; file_.read() && !((++count & 1023) == 0 && stop());) {
    const auto& event = file_.event();
    if (entries_.empty()) {
      first_ = event.utime;
      alarms_.push_back(frame.alarms);
    }
    duration_ = elapsed(event.utime, first_, duration_);
    const auto offset = static_cast<std::int64_t>(file_.offset());
    if (entries_.empty() || duration_ - entries_.back().time >= interval_) {
      next.time = duration_;
      next.offset = file_.offset();
      next.messages = frame.messages;
      next.frame_utime = frame.utime;
      if (!same(alarms_.back(), frame.alarms)) alarms_.push_back(frame.alarms);
      next.alarms = static_cast<std::uint32_t>(alarms_.size() - 1);
      next.tick_time = frame.state ? 1e-3F * static_cast<float>(frame.state->tick_time) : 0;
      next.status = frame.state ? frame.state->status : std::int8_t{0};
      next.curves.clear();
      for (std::size_t i = 0; frame.modes && i < frame.modes->label.size(); ++i) {
        next.curves.push_back({static_cast<float>(frame.modes->label[i]),
                               static_cast<float>(frame.modes->natural_frequency[i]),
                               static_cast<float>(frame.modes->damping_ratio[i])});
      }
      add(next);
    }
    const std::int64_t before = handlers.malformed;
    const std::int64_t messages = frame.messages;
    hand_on(event, handlers);
    if (handlers.malformed != before || frame.messages == messages) continue;
    if (event.channel == lcmtypes::kStateChannel) next.state = offset;
    if (event.channel == lcmtypes::kModesChannel) next.modes = offset;
    if (event.channel == lcmtypes::kSampledModesChannel) next.sampled = offset;
  }
  damage_ = describe(file_.damage());
  malformed_ = handlers.malformed;
}

void LogFrames::add(const Entry& entry) {
  if (entries_.size() >= kMostEntries) {  // every second one stays
    for (std::size_t i = 0; 2 * i < entries_.size(); ++i) {
      if (i > 0) entries_[i] = std::move(entries_[2 * i]);
    }
    entries_.resize((entries_.size() + 1) / 2);
    interval_ *= 2;
    std::vector<Alarms> kept;
    std::uint32_t last = ~0U;
    for (Entry& e : entries_) {
      if (e.alarms != last) {
        last = e.alarms;
        kept.push_back(std::move(alarms_[last]));
      }
      e.alarms = static_cast<std::uint32_t>(kept.size() - 1);
    }
    if (entry.alarms != last) kept.push_back(alarms_[entry.alarms]);
    alarms_ = std::move(kept);
    entries_.push_back(entry);
    entries_.back().alarms = static_cast<std::uint32_t>(alarms_.size() - 1);
    return;
  }
  entries_.push_back(entry);
}

void LogFrames::read_one(std::int64_t offset, Frame& frame) {
  if (offset < 0) return;
  lcmtypes::MessageHandlers handlers = frame_handlers(frame);
  file_.seek(static_cast<std::uint64_t>(offset));
  if (file_.read()) hand_on(file_.event(), handlers);
}

Frame LogFrames::at(double time) {
  Frame frame;
  if (entries_.empty()) return frame;
  const double most = duration();
  const auto wanted =
      std::llround(1e6 * (std::isfinite(time) ? std::clamp(time, 0.0, most) : most));
  const auto after =
      std::upper_bound(entries_.begin(), entries_.end(), wanted,
                       [](std::int64_t t, const Entry& entry) { return t < entry.time; });
  const Entry& entry = after == entries_.begin() ? *after : *std::prev(after);
  for (const std::int64_t offset : {entry.state, entry.modes, entry.sampled}) {
    read_one(offset, frame);
  }
  frame.alarms = alarms_[entry.alarms];
  frame.messages = entry.messages;
  frame.utime = entry.frame_utime;
  lcmtypes::MessageHandlers handlers = frame_handlers(frame);
  file_.seek(entry.offset);
  std::int64_t now = entry.time, last = now;
  while (file_.read()) {
    now = elapsed(file_.event().utime, first_, now);
    if (now > wanted) break;
    last = now;
    hand_on(file_.event(), handlers);
  }
  frame.age = 1e-6 * static_cast<double>(wanted - last);
  return frame;
}

nlohmann::ordered_json LogFrames::history(std::size_t most) const {
  const std::size_t stride = entries_.size() / std::max<std::size_t>(most, 1) + 1;
  std::map<int, std::array<std::vector<Json>, 2>> modes;
  std::vector<double> times, tick_times;
  std::vector<int> statuses;
  for (std::size_t i = 0; i < entries_.size(); i += stride) {
    const Entry& entry = entries_[i];
    for (const auto& curve : entry.curves) {
      auto& of = modes[static_cast<int>(curve[0])];
      if (modes.size() > 64) continue;  // a mode that is lost repeatedly changes its label
      for (std::size_t k = 0; k < 2; ++k) {
        of[k].resize(times.size());
        of[k].emplace_back(curve[k + 1]);
      }
    }
    times.push_back(1e-6 * static_cast<double>(entry.time));
    tick_times.push_back(static_cast<double>(entry.tick_time));
    statuses.push_back(entry.status);
  }
  Json curves = Json::object();
  for (auto& [label, of] : modes) {
    for (auto& list : of) list.resize(times.size());
    curves[std::to_string(label)] = {{"natural_frequency", of[0]}, {"damping_ratio", of[1]}};
  }
  return {{"time", times}, {"tick_time", tick_times}, {"status", statuses}, {"mode", curves}};
}

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
