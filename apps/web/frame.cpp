#include <dashpot/analysis/mode.hpp>
#include <dashpot/analysis/solver_status.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/message_json.hpp>
#include <dashpot/apps/web/frame.hpp>

#include <algorithm>
#include <cmath>

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

}  // namespace dashpot::apps
