#include <dashpot/apps/loop/loop_goal.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/text/quantity.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <string_view>

namespace dashpot::apps {
namespace {

constexpr double kMostForce = 20;          // N
constexpr double kMostTorque = 3;          // N m
constexpr double kLatestEnd = 600;         // s
constexpr double kHighestFrequency = 1e3;  // Hz
constexpr std::array<std::string_view, 6> kDirections = {"x", "y", "z", "rx", "ry", "rz"};

InputError refusal(const std::string& reason) {
  return {"--excite", reason};
}

/// The words of a specification by their keys; each key is taken once.
class ExcitationWords {
 public:
  explicit ExcitationWords(const std::string& text) {
    std::istringstream stream(text);
    std::getline(stream, kind_, ',');
    for (std::string word; std::getline(stream, word, ',');) {
      const std::size_t equals = word.find('=');
      if (equals == std::string::npos) throw refusal("KEY=VALUE is wanted, not '" + word + "'");
      const std::string key = word.substr(0, equals);
      if (!words_.emplace(key, word.substr(equals + 1)).second) {
        throw refusal(key + " is given twice");
      }
    }
  }
  const std::string& kind() const { return kind_; }
  bool has(const std::string& key) const { return words_.contains(key); }
  std::string take(const std::string& key) {
    const auto found = words_.extract(key);
    if (found.empty()) throw refusal("a " + kind_ + " needs " + key);
    return found.mapped();
  }
  /// A number from `least` to `most` in `unit`.
  double take(const std::string& key, const std::string& unit, double least, double most) {
    double value = 0;
    try {
      value = text::parse_quantity(take(key), unit);
    } catch (const std::invalid_argument& error) {
      throw refusal(key + " " + error.what());
    }
    if (value >= least && value <= most) return value;
    std::array<char, 96> range{};
    std::snprintf(range.data(), range.size(), " has to be from %.4g to %.4g %s", least, most,
                  unit.c_str());
    throw refusal(key + range.data());
  }
  void finish() const {
    if (words_.empty()) return;
    throw refusal("'" + words_.begin()->first + "' is not a key of a " + kind_);
  }

 private:
  std::string kind_;
  std::map<std::string, std::string> words_;
};

/// Refuses an excitation faster than motion.gain_time, which filters the wrench of a set-point.
void expect_through(const Excitation& excitation, const controller::Settings& settings) {
  if (!settings.feed_forward.wrench) {
    throw refusal("needs feed_forward.wrench: true, or no wrench acts");
  }
  const double lag = settings.motion.gain_time;
  const double highest = 1 / (2 * std::numbers::pi * lag);
  std::array<char, 160> reason{};
  if (!excitation.chirp && excitation.duration < lag) {
    std::snprintf(reason.data(), reason.size(),
                  "duration is below motion.gain_time, %.4g s, over which a wrench sets in", lag);
    throw refusal(reason.data());
  }
  if (excitation.chirp && std::max(excitation.from, excitation.to) > highest) {
    std::snprintf(reason.data(), reason.size(),
                  "frequencies above %.4g Hz do not get through motion.gain_time, %.4g s, over "
                  "which a wrench sets in",
                  highest, lag);
    throw refusal(reason.data());
  }
}

}  // namespace

const char* const kExciteHelp =
    R"(Let a wrench at the tip make the arm vibrate a little; with --log its modes are identified:
pulse,direction=z,force=5,duration=0.5,at=1,every=3,count=5 or
chirp,direction=rx,torque=1,from=0.1,to=5,duration=20,at=1)";

controller::Vector6 Excitation::wrench(double time) const noexcept {
  controller::Vector6 wrench = controller::Vector6::Zero();
  double since = time - at;
  if (since < 0) return wrench;
  if (!chirp && count > 1) since -= every * std::min(std::floor(since / every), count - 1.0);
  if (since >= duration) return wrench;
  const double cycles = since * (from + (to - from) * since / (2 * duration));
  wrench[direction] = amplitude * (chirp ? std::sin(2 * std::numbers::pi * cycles) : 1);
  return wrench;
}

Excitation read_excitation(const std::string& text, const controller::Settings& settings) {
  ExcitationWords words(text);
  Excitation result;
  result.chirp = words.kind() == "chirp";
  if (!result.chirp && words.kind() != "pulse") {
    throw refusal("pulse or chirp is wanted, not '" + words.kind() + "'");
  }
  const std::string direction = words.take("direction");
  const auto* const found = std::find(kDirections.begin(), kDirections.end(), direction);
  if (found == kDirections.end()) {
    throw refusal("direction is x, y, z, rx, ry or rz, not '" + direction + "'");
  }
  result.direction = static_cast<int>(found - kDirections.begin());
  result.amplitude = result.direction < 3 ? words.take("force", "N", -kMostForce, kMostForce)
                                          : words.take("torque", "N m", -kMostTorque, kMostTorque);
  result.duration = words.take("duration", "s", settings.period, kLatestEnd);
  if (words.has("at")) result.at = words.take("at", "s", 0, kLatestEnd);
  if (result.chirp) {
    result.from = words.take("from", "Hz", 0, kHighestFrequency);
    result.to = words.take("to", "Hz", 0, kHighestFrequency);
  } else if (words.has("count") || words.has("every")) {
    result.count = static_cast<int>(words.take("count", "", 1, 1000));
    result.every = words.take("every", "s", result.duration, kLatestEnd);
  }
  words.finish();
  const double end = result.at + result.every * (result.count - 1) + result.duration;
  if (end > kLatestEnd) throw refusal("has to end within 600 s");
  expect_through(result, settings);
  return result;
}

void LoopGoal::begin(const controller::Setpoint& setpoint,
                     const controller::Attachment& attachment) {
  setpoint_ = accepted_ = setpoint;
  in_force_ = news_ = true;
  tool_ = attachment.tool;
  const std::lock_guard lock(mutex_);
  gains_ = setpoint.gains;
  payload_ = attachment.payload();
  latest_tool_ = attachment.tool;
  begun_ = true;
}

const controller::Setpoint* LoopGoal::told(std::int64_t time) noexcept {
  told_ = false;
  if (!follow_tool()) return nullptr;
  // The controller must read the set-point again for new gains to count.
  const std::int64_t changes = gain_changes_.load(std::memory_order_acquire);
  if (ticks_++ % repeat_every_ == 0 || changes != gain_changes_seen_) news_ = true;
  gain_changes_seen_ = changes;
  controller::Vector6 wrench = setpoint_.wrench;
  if (excitation_) {
    if (!excited_since_) excited_since_ = time;
    wrench += excitation_->wrench(1e-9 * static_cast<double>(time - *excited_since_));
    if (wrench != excited_.wrench) news_ = true;
  }
  if (news_) setpoint_.time = time;
  told_ = in_force_ && !stopped_;
  if (!told_) return nullptr;
  if (!excitation_) return &setpoint_;
  if (news_) excited_ = setpoint_;
  excited_.wrench = wrench;
  return &excited_;
}

bool LoopGoal::follow_tool() noexcept {
  const std::int64_t changes = tool_changes_.load(std::memory_order_acquire);
  if (changes == tool_changes_seen_) return true;
  if (changes % 2 != 0) return false;
  tool_changes_seen_ = changes;
  if (!tools_.fetch()) return false;  // it was refused
  for (controller::Setpoint* held : {&setpoint_, &accepted_}) {
    held->tip_pose = controller::carried(held->tip_pose, tool_, tools_.value());
  }
  tool_ = tools_.value();
  news_ = true;
  return false;  // this tick takes T up unless an earlier one did
}

void LoopGoal::note_status(std::int32_t status) noexcept {
  if (!told_) return;
  // A rejection shows in the status once; then the previous set-point is held again.
  const bool rejected = news_ && status == DASHPOT_SETPOINT_REJECTED;
  if (rejected) setpoint_ = accepted_;
  if (news_ && !rejected) accepted_ = setpoint_;
  news_ = rejected;
}

void LoopGoal::hold(const controller::Setpoint& setpoint) noexcept {
  setpoint_ = setpoint;
  in_force_ = news_ = true;
}

void LoopGoal::note_fault(bool latched) noexcept {
  if (latched) {
    in_force_ = false;
    excitation_.reset();
  }
  if (faulted_ && !latched && !released_.exchange(false, std::memory_order_acquire)) {
    in_force_ = news_ = true;
  }
  faulted_ = latched;
}

std::int32_t LoopGoal::change(const Change& change, std::string& reason) {
  const std::lock_guard lock(mutex_);
  if (!begun_) {
    reason = "the loop has not begun";
    return DASHPOT_NOTHING_YET;
  }
  controller::Gains gains = gains_;
  if (change.gains) change.gains(gains);
  const bool news = !controller::same_gains(gains, gains_);
  std::string said;
  std::int32_t code = DASHPOT_OK;
  if (change.tip_speed) code = controller_.limit_tip_speed(*change.tip_speed, said);
  const bool slowed = change.tip_speed && code == DASHPOT_OK;
  if (code == DASHPOT_OK && (change.payload || change.tool)) {
    code = attach(change, news ? &gains : nullptr, said);
  } else if (code == DASHPOT_OK && news) {
    code = controller_.set_gains(gains, said);
  }
  if (code != DASHPOT_OK) {
    reason = said;
    // The previous speed was accepted before, so it is not refused.
    if (slowed) controller_.limit_tip_speed(tip_speed_, said);
    return code;
  }
  if (!said.empty()) std::fprintf(stderr, "warning: %s\n", said.c_str());
  tip_speed_ = change.tip_speed.value_or(tip_speed_);
  gains_ = gains;
  if (news) gain_changes_.fetch_add(1, std::memory_order_release);
  return code;
}

std::int32_t LoopGoal::attach(const Change& change, const controller::Gains* gains,
                              std::string& said) {
  struct UnderWay {
    explicit UnderWay(std::atomic<std::int64_t>& changes) : count(changes) { ++count; }
    ~UnderWay() { ++count; }
    UnderWay(const UnderWay&) = delete;
    UnderWay& operator=(const UnderWay&) = delete;
    std::atomic<std::int64_t>& count;
  };
  const controller::Payload payload = change.payload.value_or(payload_);
  const controller::Pose tool = change.tool.value_or(latest_tool_);
  std::optional<UnderWay> under_way;
  if (change.tool) under_way.emplace(tool_changes_);
  const std::int32_t code = controller_.set_payload(payload, tool, gains, said);
  if (code != DASHPOT_OK) return code;
  if (change.tool) tools_.write(tool);
  payload_ = payload;
  latest_tool_ = tool;
  return code;
}

controller::Pose LoopGoal::latest_tool() {
  const std::lock_guard lock(mutex_);
  return latest_tool_;
}

void LoopGoal::release() {
  const std::lock_guard lock(mutex_);
  if (!begun_) return;
  released_.store(true, std::memory_order_release);  // first, so that no tick takes it for its own
  controller_.release();
}

}  // namespace dashpot::apps
