#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/apps/loop/loop_journal.hpp>
#include <dashpot/apps/monitor/monitor_view.hpp>
#include <dashpot/apps/report/modes.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/tick_status.hpp>
#include <dashpot/text/printable.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace dashpot::apps {
namespace {

using Align = TextTable::Align;

std::string status_text(std::int8_t status) {
  return controller::to_text(static_cast<controller::Status>(status));
}

std::string latched(const state_t& state) {
  return "FAULT LATCHED at tick " + std::to_string(state.fault_tick) + ": " +
         status_text(state.fault);
}

std::string mode_text(std::int8_t mode) {
  return mode == state_t::JOINT ? "joint" : mode == state_t::CARTESIAN ? "Cartesian" : "unknown";
}

std::string kind_text(std::int8_t kind) {
  return analysis::to_text(static_cast<analysis::ModeKind>(kind));
}

std::string solver_text(std::int8_t origin) {
  switch (origin) {
    case modes_t::DIRECT:
      return "solved directly";
    case modes_t::TRACKED:
      return "tracked";
    case modes_t::REUSED:
      return "reused";
    default:
      return "unknown";
  }
}

/// The stability of the loop, and its gain margin.
std::string verdict(const sampled_modes_t& modes) {
  const auto status = static_cast<analysis::Status>(modes.status);
  if (status != analysis::Status::kOk && status != analysis::Status::kUncertified) {
    return analysis::to_text(status);
  }
  const std::string margin = format_number(modes.gain_margin, 3);
  if (std::isnan(modes.spectral_radius)) return "unknown";
  if (modes.gain_margin < 1) {
    return "UNSTABLE; all gains have to shrink to " + margin + " of what they are";
  }
  if (std::isinf(modes.gain_margin)) return "stable, however large the gains";
  return "stable; all gains can grow to " + margin + " times what they are";
}

constexpr const char* kMixed =
    "more than one loop sends to this bus: what is shown is a mixture; an --lcm-url for each "
    "keeps them apart";

/// a - b, which wraps around on overflow: a hostile sender may send any numbers.
std::int64_t minus(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b));
}

double tip_error(const state_t& state) {
  return std::hypot(state.tip_error[0], state.tip_error[1], state.tip_error[2]);
}

std::string tick_times(const state_t& state) {
  return "tick " + text::fixed(1e-3 * state.tick_time, 1) + " us (longest " +
         text::fixed(1e-3 * state.longest_tick_time, 1) + ")";
}

/// " at (0.000, 0.000, 0.100) m"
std::string place(const double (&p)[3]) {
  return " at (" + text::fixed(p[0], 3) + ", " + text::fixed(p[1], 3) + ", " +
         text::fixed(p[2], 3) + ") m";
}

/// Returns the payload, the place of the tool, and the damping ratios of ratio damping.
std::string told(const state_t& state) {
  std::string text = "payload " + format_number(state.payload_mass, 4) + " kg";
  if (state.payload_mass != 0) text += place(state.payload_center);
  const auto& tool = state.tool_position;
  if (tool[0] != 0 || tool[1] != 0 || tool[2] != 0) text += "; tool" + place(tool);
  for (const auto& [name, ratio] :
       {std::pair("joint", state.joint_damping_ratio), {"task", state.task_damping_ratio}}) {
    if (ratio != 0) text += "; " + std::string(name) + " damping ratio " + format_number(ratio, 3);
  }
  if (state.damping_level < 1) {
    text += "; lowered to " + format_number(state.damping_level, 3) + " of it";
  }
  if (std::isfinite(state.energy_store)) {
    text += "; energy tank " + format_number(state.energy_store, 3) + " J";
  }
  if (state.spring_share < 1) {
    text += "; springs weakened to " + format_number(state.spring_share, 3);
  }
  return text;
}

}  // namespace

void MonitorView::note_time(std::int64_t utime) {
  if (empty()) first_utime_ = utime;
  last_utime_ = utime;
}

void MonitorView::note_order(std::int64_t tick) {
  constexpr std::int64_t kMostLost = 100;  // messages of a loop, while another one's came
  const std::int64_t last = state_->tick;
  const bool returned =
      minus(tick, last) > 1 && tick > left_at_ && minus(tick, left_at_) <= kMostLost;
  // Two loops in step send every tick twice; one whose controller is not called repeats a tick.
  const bool repeated = tick == last;
  const bool in_step = repeated && !repeated_[0] && repeated_[1];
  if (in_step || (left_at_ > last && returned)) ++returns_;
  repeated_ = {repeated, repeated_[0]};
  if (tick < last) left_at_ = last;
}

void MonitorView::take(const state_t& message) {
  note_time(message.utime);
  if (state_) note_order(message.tick);
  const bool restarted = state_ && message.tick < state_->tick;
  if (!state_ || restarted) {
    rate_utime_ = message.utime;
    rate_tick_ = message.tick;
    rate_ = 0;
  }
  const double elapsed = 1e-6 * static_cast<double>(minus(message.utime, rate_utime_));
  if (elapsed >= 1) {
    rate_ = static_cast<double>(minus(message.tick, rate_tick_)) / elapsed;
    rate_utime_ = message.utime;
    rate_tick_ = message.tick;
  }
  ++states_;
  ++statuses_[static_cast<std::uint8_t>(message.status)];
  if (message.mode == state_t::CARTESIAN) {
    largest_error_ = std::max(largest_error_, tip_error(message));
  }
  state_ = message;
}

void MonitorView::take(const modes_t& message) {
  note_time(message.utime);
  constexpr std::int64_t kFarthest = 1'000'000'000;  // a larger jump is another sequence
  const std::int64_t gap = modes_ ? minus(message.sequence, modes_->sequence) : 1;
  if (gap > 1 && gap < kFarthest) modes_lost_ += gap - 1;
  ++modes_messages_;
  modes_ = message;
}

void MonitorView::take(const sampled_modes_t& message) {
  note_time(message.utime);
  sampled_ = message;
}

std::string MonitorView::screen(bool bold) const {
  const auto heading = [bold](const std::string& text) {
    return bold ? "\033[1m" + text + "\033[0m\n" : text + "\n";
  };
  std::string out;
  if (mixed()) out += heading(std::string("Warning: ") + kMixed) + "\n";
  if (state_) out += heading("Loop") + health() + "\n";
  if (modes_) out += heading("Modes") + modes_table() + "\n";
  if (sampled_) out += heading("Sampled loop") + sampled_table() + "\n";
  if (state_) out += heading("Joints") + joints();
  return out;
}

std::string MonitorView::health() const {
  const state_t& state = *state_;
  std::string out = "  tick " + std::to_string(state.tick) + ", " + text::fixed(time(), 1) +
                    " s: " + status_text(state.status) + "; mode " + mode_text(state.mode) +
                    "; started " + count(state.restarts, "time") + "\n";
  if (state.fault != 0) out += "  " + latched(state) + "\n";
  out += "  " + (rate_ > 0 ? text::fixed(rate_, 0) : "-") + " ticks/s, " + tick_times(state) +
         ", " + count(state.overruns, "overrun") + ", " + count(state.states_dropped, "state") +
         " not published\n";
  out += commands();
  out += "  tip off its set-point by " + text::fixed(1e3 * tip_error(state), 2) + " mm and " +
         text::fixed(std::hypot(state.tip_error[3], state.tip_error[4], state.tip_error[5]) * 180 /
                         std::numbers::pi,
                     2) +
         " deg\n";
  return out + "  " + told(state) + "\n";
}

std::string MonitorView::commands() const {
  const state_t& state = *state_;
  std::string out =
      "  commands: " + verdicts_text(state.verdicts) + "; " +
      (state.commander == 0 ? "no commander"
                            : "sender " + std::to_string(state.commander) + " commands") +
      "\n";
  if (state.last_refusal == state_t::ACCEPTED) return out;
  const auto verdict = static_cast<lcmtypes::CommandVerdict>(state.last_refusal);
  return out + "  last rejected " +
         text::fixed(1e-6 * static_cast<double>(state.utime - state.last_refusal_utime), 1) +
         " s before: " + lcmtypes::to_text(verdict) + ", of sender " +
         std::to_string(state.last_refused_sender) + "\n";
}

std::string MonitorView::joints() const {
  const state_t& state = *state_;
  TextTable table({{Align::kRight, {"joint", ""}},
                   {Align::kRight, {"position", "rad"}},
                   {Align::kRight, {"goal", "rad"}},
                   {Align::kRight, {"velocity", "rad/s"}},
                   {Align::kRight, {"torque", "N m"}}});
  for (std::size_t i = 0; i < static_cast<std::size_t>(state.n); ++i) {
    table.add_row({joint_name(static_cast<Eigen::Index>(i)),
                   text::fixed(state.joint_position[i], 4),
                   text::fixed(state.reference_joint_position[i], 4),
                   text::fixed(state.joint_velocity[i], 4), text::fixed(state.joint_torque[i], 3)});
  }
  return table.text();
}

std::string MonitorView::modes_table() const {
  const modes_t& modes = *modes_;
  std::string out = "  " + count(modes.num_modes, "mode") + ", " +
                    count(modes.zero_modes, "zero mode") + " at tick " +
                    std::to_string(modes.tick) + ", " + solver_text(modes.origin) + ": " +
                    analysis::to_text(static_cast<analysis::Status>(modes.status)) + "\n\n";
  return out + table_of(loop_modes(modes), mode_fields({"mode", true, 36}));
}

std::string MonitorView::sampled_table() const {
  const sampled_modes_t& modes = *sampled_;
  std::string out =
      "  tick " + std::to_string(modes.tick) + ": " + verdict(modes) + "\n" +
      assumes_text(controller::assumption_names(static_cast<std::uint32_t>(modes.assumes))) + "\n";
  TextTable table({{Align::kPoint, {"continuous", "rad/s"}},
                   {Align::kPoint, {"", "ratio"}},
                   {Align::kPoint, {"sampled", "rad/s"}},
                   {Align::kPoint, {"", "ratio"}},
                   {Align::kLeft, {"kind", ""}}});
  for (std::size_t i = 0; i < static_cast<std::size_t>(modes.num_modes); ++i) {
    table.add_row({format_number(modes.continuous_frequency[i], 6),
                   format_number(modes.continuous_ratio[i], 6),
                   format_number(modes.natural_frequency[i], 6),
                   format_number(modes.damping_ratio[i], 6), kind_text(modes.kind[i])});
  }
  return out + table.text();
}

std::string MonitorView::line() const {
  std::string out = text::fixed(time(), 1) + " s";
  if (state_) {
    out += "  tick " + std::to_string(state_->tick) + "  " + status_text(state_->status) + "  " +
           (rate_ > 0 ? text::fixed(rate_, 0) : "-") + " ticks/s, " + tick_times(*state_) + ", " +
           count(state_->overruns, "overrun");
    if (state_->fault != 0) out += "  " + latched(*state_);
  }
  if (modes_) {
    out += "  modes, rad/s (ratio):";
    for (std::size_t i = 0; i < static_cast<std::size_t>(modes_->num_modes); ++i) {
      out += " " + format_number(modes_->natural_frequency[i], 4) + " (" +
             format_number(modes_->damping_ratio[i], 3) + ")";
    }
  }
  if (mixed()) out += "  WARNING: more than one loop on this bus";
  return out + "\n";
}

std::string MonitorView::summary(std::int64_t malformed) const {
  std::string out = "\n" + count(states_, "state") + " and " +
                    count(modes_messages_, "modes message") + " over " + text::fixed(time(), 1) +
                    " s; " + count(modes_lost_, "modes message") + " lost, " +
                    count(malformed, "message") + " malformed\n";
  if (mixed()) out += std::string("  Warning: ") + kMixed + "\n";
  for (std::size_t i = 0; i < statuses_.size(); ++i) {
    if (statuses_[i] == 0) continue;
    out += "  " + status_text(static_cast<std::int8_t>(i)) + ": " + count(statuses_[i], "state") +
           "\n";
  }
  if (state_) {
    out += "  " + count(state_->overruns, "overrun") + ", longest " +
           text::fixed(1e-3 * state_->longest_tick_time, 1) + " us; largest tip error " +
           text::fixed(1e3 * largest_error_, 2) + " mm\n" + commands();
    if (state_->fault != 0) out += "  " + latched(*state_) + "\n";
  }
  if (modes_) out += "\nModes at the end\n" + modes_table();
  if (sampled_) out += "\nSampled loop at the end\n" + sampled_table();
  return out;
}

}  // namespace dashpot::apps
