#include <dashpot/apps/cli/arm_option.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/modes.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/apps/run/run_report.hpp>
#include <dashpot/controller/tick_status.hpp>
#include <dashpot/text/printable.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::apps {
namespace {

using Align = TextTable::Align;

/// The tick time, us, that this share of the ticks does not exceed.
double percentile(const std::vector<std::int32_t>& sorted, double share) {
  if (sorted.empty()) return std::nan("");
  const auto rank = std::lround(share * static_cast<double>(sorted.size() - 1));
  return 1e-3 * sorted[static_cast<std::size_t>(rank)];
}

struct TickTimes {
  double median, p99, p99_9, longest;  // us
};

TickTimes tick_times(const LoopRecord& record) {
  std::vector<std::int32_t> sorted = record.tick_times;
  std::sort(sorted.begin(), sorted.end());
  return {percentile(sorted, 0.5), percentile(sorted, 0.99), percentile(sorted, 0.999),
          percentile(sorted, 1)};
}

std::string status_text(std::size_t status) {
  if (status > DASHPOT_NOT_FINITE) return "call refused";
  return controller::to_text(static_cast<controller::Status>(status));
}

/// The modes at a `time`, s, with their own time if it is much earlier or later.
std::string modes_text(const char* when, const dashpot_modes& modes, double time) {
  constexpr double kNear = 0.1;  // s
  const double apart = 1e-9 * static_cast<double>(modes.time) - time;
  std::string out = std::string("\nModes at the ") + when + ", ";
  if (std::abs(apart) > kNear) {
    out += "found " + format_number(std::abs(apart), 3) + " s " +
           (apart > 0 ? "later, " : "earlier, ");
  }
  return out + count(modes.zero_modes, "zero mode") + "\n" +
         table_of(loop_modes(modes), mode_fields());
}

std::vector<Field<RingDownMode>> ring_down_fields() {
  const auto field = [](const char* key, const char* above, const char* name, int digits,
                        double RingDownMode::*member) {
    return Field<RingDownMode>{
        key, "", {Align::kPoint, {above, name}, digits}, [member](const RingDownMode& m) {
          return Json(m.*member);
        }};
  };
  using M = RingDownMode;
  return {{"label", "", {Align::kRight, {"", "label"}}, [](const M& m) { return Json(m.label); }},
          field("predicted_frequency", "predicted", "rad/s", 5, &M::predicted_frequency),
          field("predicted_ratio", "", "ratio", 4, &M::predicted_ratio),
          field("sampled_frequency", "sampled", "rad/s", 5, &M::sampled_frequency),
          field("sampled_ratio", "", "ratio", 4, &M::sampled_ratio),
          field("measured_frequency", "simulated", "rad/s", 5, &M::measured_frequency),
          field("measured_ratio", "", "ratio", 4, &M::measured_ratio)};
}

std::string stability_text(const RingDown& ring_down) {
  const bool stable = ring_down.gain_margin >= 1;
  std::string text;
  if (ring_down.growth > 0) {
    text = std::string("  ") + (stable ? "A slow motion" : "In this loop a motion") +
           " grows e-fold every " + format_number(1 / ring_down.growth, 3) + " s: the torque " +
           (stable ? "against gravity comes late.\n" : "comes too late.\n");
  }
  if (stable) {
    text += "  All gains together may grow by a factor of " +
            format_number(ring_down.gain_margin, 3) + " before this loop becomes unstable.\n";
  }
  return text.empty() ? "" : text + assumes_text(ring_down.assumes);
}

std::string pace_text(const RunReport& report) {
  if (report.pace == Pace::kFast) {
    return "as fast as possible: " + format_number(report.wall_time, 3) + " s, " +
           format_number(report.simulated_time / report.wall_time, 3) + " times real time";
  }
  const Privileges& granted = report.privileges;
  return std::string("in real time; ") +
         (granted.scheduled ? "scheduled ahead of others (SCHED_FIFO)"
                            : "without SCHED_FIFO, which the system did not allow") +
         ", " +
         (granted.locked ? "memory locked" : "memory not locked, which the system did not allow");
}

std::string timing_text(const RunReport& report) {
  const LoopRecord& loop = report.loop;
  const TickTimes times = tick_times(loop);
  std::string out = "  Tick of the controller: median " + format_number(times.median, 3) +
                    " us, 99 % within " + format_number(times.p99, 3) + ", 99.9 % " +
                    format_number(times.p99_9, 3) + ", longest " + format_number(times.longest, 3) +
                    "\n  " + count(loop.overruns, "overrun");
  if (report.pace == Pace::kRealTime) {
    out += ", " + std::to_string(loop.own_overruns) +
           " of them by computing, the others by waiting for the processor; latest wake-up " +
           format_number(1e-6 * static_cast<double>(loop.latest_wake_up), 3) + " ms";
  }
  return out + "\n";
}

std::string statuses_text(const LoopRecord& loop) {
  std::string out = "  Status:";
  for (std::size_t i = 0; i < loop.statuses.size(); ++i) {
    if (loop.statuses[i] == 0) continue;
    out +=
        (out.back() == ':' ? " " : ", ") + status_text(i) + " " + std::to_string(loop.statuses[i]);
  }
  return out + "\n  " + count(loop.status_changes, "change") + " of status, " +
         count(static_cast<std::int64_t>(loop.restarts), "restart") + " of the springs\n";
}

std::string extremes_text(const Extremes& extremes) {
  const std::string energy = "kinetic energy " + format_number(extremes.kinetic_energy, 3) + " J\n";
  if (extremes.tip_speed == 0) return "  Greatest " + energy;
  return "  Greatest speed of a joint " + format_number(100 * extremes.speed_share, 3) +
         " % of its limit, of the tip " + format_number(extremes.tip_speed, 3) + " m/s, " + energy;
}

std::string contact_text(const RunReport& report) {
  if (!report.contact_force) return "";
  return "  Force of the wall on the tip: at most " +
         format_number(report.extremes.contact_force, 3) + " N, at the end " +
         format_number(report.contact_force->norm(), 3) + " N\n";
}

/// How the modes were found, in ticks after the first one of the run.
std::string solved_text(const dashpot_modes& first, const dashpot_modes& last) {
  std::string out = "  Modes:";
  const auto add = [&](std::uint64_t dashpot_modes::*ticks, const char* what) {
    if (last.*ticks == first.*ticks) return;
    out +=
        (out.back() == ':' ? " " : ", ") + std::to_string(last.*ticks - first.*ticks) + " " + what;
  };
  add(&dashpot_modes::tracked, "tracked");
  add(&dashpot_modes::reused, "reused");
  add(&dashpot_modes::unchanged, "unchanged");
  add(&dashpot_modes::direct, "solved directly");
  add(&dashpot_modes::no_springs, "without springs");
  add(&dashpot_modes::failed, "failed");
  add(&dashpot_modes::missed, "missed");
  return out + "\n";
}

std::string error_text(const LoopRecord& loop) {
  std::string out;
  if (loop.cartesian) {
    out += "  Tip farthest from where its springs are fixed: " +
           format_number(1e3 * loop.tip_error, 4) + " mm, " +
           format_number(loop.tip_angle_error, 3) + " rad\n";
  }
  if (loop.joint) {
    out +=
        "  Joint farthest from where its springs are fixed: " + format_number(loop.joint_error, 3) +
        " rad (m)\n";
  }
  if (loop.damping_level < 1) {
    out += "  Damping ratios lowered, because the sampled loop allows no more, to " +
           format_number(loop.damping_level, 3) + " of what was asked for\n";
  }
  return out;
}

/// Whether more than a hundredth of the energy that was moved is unaccounted for.
bool doubtful(const sim::EnergyAudit& energy) {
  const double moved = std::abs(energy.by_actuators) + std::abs(energy.by_world) +
                       energy.dissipated() + std::abs(energy.stored.sum() - energy.initial.sum());
  return std::abs(energy.imbalance()) > 0.01 * moved && std::abs(energy.imbalance()) > 1e-9;
}

std::string energy_text(const sim::EnergyAudit& energy) {
  const auto joule = [](double value) { return format_number(value, 4) + " J"; };
  return "  Energy: stored " + joule(energy.initial.sum()) + " at the start, " +
         joule(energy.stored.sum()) + " at the end; in by the drives " +
         joule(energy.by_actuators) + ", by the world " + joule(energy.by_world) + "; lost " +
         joule(energy.dissipated()) + "; unaccounted for " + format_number(energy.imbalance(), 2) +
         " J" +
         (doubtful(energy) ? ": the integrator's steps are too long (simulation.integrator.step)"
                           : "") +
         "\n";
}

std::string messages_text(const RunReport& report) {
  const lcmtypes::PublisherCounters& sent = report.messages;
  return "  Messages: " + count(sent.states, "state") + ", " + std::to_string(sent.modes) +
         " of modes (" + std::to_string(sent.modes_skipped) + " unchanged, not sent), " +
         std::to_string(sent.states_dropped + sent.modes_dropped) + " dropped, " +
         count(sent.send_errors, "error") + "\n";
}

Json modes_json(const dashpot_modes& modes) {
  return json_of(loop_modes(modes), mode_fields());
}

Json solved_json(const dashpot_modes& first, const dashpot_modes& last) {
  return {{"tracked", last.tracked - first.tracked},
          {"reused", last.reused - first.reused},
          {"direct", last.direct - first.direct},
          {"unchanged", last.unchanged - first.unchanged},
          {"no_springs", last.no_springs - first.no_springs},
          {"failed", last.failed - first.failed},
          {"missed", last.missed - first.missed}};
}

Json contact_json(const RunReport& report) {
  if (!report.contact_force) return nullptr;
  return {{"greatest_force", report.extremes.contact_force},
          {"final_force", json_list(*report.contact_force)}};
}

Json energy_json(const sim::EnergyAudit& energy) {
  const auto stored = [](const sim::StoredEnergy& at) {
    return Json{{"kinetic", at.kinetic}, {"gravity", at.gravity}, {"springs", at.springs}};
  };
  return {{"initial", stored(energy.initial)},   {"final", stored(energy.stored)},
          {"by_actuators", energy.by_actuators}, {"by_world", energy.by_world},
          {"viscous_heat", energy.viscous_heat}, {"friction_heat", energy.friction_heat},
          {"contact_heat", energy.contact_heat}, {"gear_heat", energy.gear_heat},
          {"imbalance", energy.imbalance()}};
}

Json ring_down_json(const RingDown& ring_down) {
  return {{"releases", ring_down.releases},
          {"residual", ring_down.residual},
          {"growth", ring_down.growth},
          {"gain_margin", ring_down.gain_margin},
          {"assumes", ring_down.assumes},
          {"integral_decays", ring_down.integral_decays},
          {"modes", json_of(ring_down.modes, ring_down_fields())}};
}

}  // namespace

std::string to_table(const RunReport& report) {
  const LoopRecord& loop = report.loop;
  std::string out = text::printable(report.scene) + ": " + count(report.joints, "joint") + ", " +
                    count(loop.ticks, "tick") + " of " + format_number(1e3 * report.period, 3) +
                    " ms, " + pace_text(report) + (report.interrupted ? "; interrupted" : "") +
                    "\n\n";
  out += timing_text(report) + statuses_text(loop) + extremes_text(report.extremes) +
         contact_text(report) + error_text(loop) + energy_text(report.energy) + fault_text(loop) +
         messages_text(report) + commands_text(report.commands, loop.commands_refused);
  if (loop.first_modes.tick == 0) {
    out += "  Modes: none, because the analysis is off or did not finish while the loop ran\n";
  } else {
    out += solved_text(loop.first_modes, loop.last_modes);
    if (!report.friction_text.empty()) out += "\n  " + report.friction_text + "\n";
    if (!report.drives_text.empty()) out += "\n  " + report.drives_text + "\n";
    if (!report.missing_rotors.empty()) {
      out += "\n  Rotors unknown: " + report.missing_rotors +
             ". Fast modes and gain\n  margins are computed for " + report.without_rotors +
             ".\n  " + report.rotors_hint + "\n";
    }
    out += modes_text("start", loop.first_modes, 0) +
           modes_text("end", loop.last_modes, report.simulated_time);
  }
  if (report.release) {
    out += "\nRelease at the start: shares of the modes\n" +
           shares_table(report.release->spectrum, report.release->shares, "the tip's x, y, z, m");
  }
  if (report.ring_down) {
    out += "\nRing-down after " + count(report.ring_down->releases, "small release") +
           " (sampled: predicted with the drives of the scene)\n" +
           table_of(report.ring_down->modes, ring_down_fields());
    out += integral_text(report.ring_down->integral_decays) + stability_text(*report.ring_down);
  }
  if (report.identified) out += "\n" + identify_table(*report.identified);
  return out;
}

std::string to_json(const RunReport& report) {
  const LoopRecord& loop = report.loop;
  const TickTimes times = tick_times(loop);
  Json statuses = Json::object();
  for (std::size_t i = 0; i < loop.statuses.size(); ++i) {
    if (loop.statuses[i] != 0) statuses[status_text(i)] = loop.statuses[i];
  }
  Json result = {
      {"scene", report.scene},
      {"drives", report.drives.empty() ? Json() : drives_json(report.drives)},
      {"joints", report.joints},
      {"rotors", report.missing_rotors.empty() ? "known" : "unknown"},
      {"period", report.period},
      {"ticks", loop.ticks},
      {"simulated_time", report.simulated_time},
      {"wall_time", report.wall_time},
      {"real_time", report.pace == Pace::kRealTime},
      {"scheduled_ahead", report.privileges.scheduled},
      {"memory_locked", report.privileges.locked},
      {"interrupted", report.interrupted},
      {"overruns", loop.overruns},
      {"overruns_by_computing", loop.own_overruns},
      {"latest_wake_up", 1e-9 * static_cast<double>(loop.latest_wake_up)},
      {"tick_time",
       {{"median", 1e-6 * times.median},
        {"p99", 1e-6 * times.p99},
        {"p99_9", 1e-6 * times.p99_9},
        {"longest", 1e-6 * times.longest}}},
      {"status", statuses},
      {"status_changes", loop.status_changes},
      {"restarts", loop.restarts},
      {"greatest",
       {{"joint_speed_share", report.extremes.speed_share},
        {"tip_speed", report.extremes.tip_speed},
        {"kinetic_energy", report.extremes.kinetic_energy}}},
      {"contact", contact_json(report)},
      {"zero_modes", loop.last_modes.zero_modes},
      {"modes", {{"start", modes_json(loop.first_modes)}, {"end", modes_json(loop.last_modes)}}},
      {"solved", solved_json(loop.first_modes, loop.last_modes)},
      {"largest_tracking_error",
       {{"tip", loop.tip_error}, {"tip_angle", loop.tip_angle_error}, {"joint", loop.joint_error}}},
      {"least_damping_level", loop.damping_level},
      {"energy", energy_json(report.energy)},
      {"messages",
       {{"states", report.messages.states},
        {"modes", report.messages.modes},
        {"modes_skipped", report.messages.modes_skipped},
        {"states_dropped", report.messages.states_dropped},
        {"modes_dropped", report.messages.modes_dropped},
        {"sampled_modes", report.messages.sampled_modes},
        {"errors", report.messages.send_errors}}},
      {"commands", commands_json(report.commands, loop.commands_refused)},
      {"faults", loop.faults},
      {"fault", fault_json(loop)}};
  if (report.identified) result["identified"] = identify_json(*report.identified);
  if (report.release) {
    result["release"] = {{"modes", modes_json(report.release->spectrum)},
                         {"shares", shares_json(report.release->shares)}};
  }
  if (report.ring_down) result["ring_down"] = ring_down_json(*report.ring_down);
  return json_text(result);
}

}  // namespace dashpot::apps
