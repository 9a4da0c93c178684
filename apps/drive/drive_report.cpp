#include <dashpot/apps/drive/drive_session.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/controller/tick_status.hpp>
#include <dashpot/text/printable.hpp>

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

namespace dashpot::apps {
namespace {

/// The latency that this share of the commands does not exceed, us.
double latency_at(const DriveRecord& drive, double share) {
  const std::int64_t wanted = std::llround(share * static_cast<double>(drive.commands));
  std::int64_t count = 0;
  for (std::size_t us = 0; us + 1 < drive.latencies.size(); ++us) {
    count += drive.latencies[us];
    if (count >= wanted) return static_cast<double>(us);
  }
  return drive.longest_latency;
}

std::string line(const char* format, auto... values) {
  std::array<char, 512> text{};
  std::snprintf(text.data(), text.size(), format, values...);
  return std::string("  ") + text.data() + "\n";
}

std::string status_name(std::size_t status) {
  return controller::to_text(static_cast<controller::Status>(status));
}

long long n(std::int64_t count) {
  return count;
}

}  // namespace

std::string to_table(const DriveReport& report) {
  const DriveRecord& drive = report.drive;
  std::string text = std::string(lcmtypes::profile_of(report.driver).name) + ", " + report.config +
                     (report.dry_run ? ", dry run: nothing was commanded" : "") + "\n";
  text += "  " + report.ended + "\n";
  text += line(
      "statuses: %lld, of them unreadable %lld, repeated %lld, overtaken %lld, late %lld, "
      "of a stopped robot %lld, after a pause %lld; periods without one %lld",
      n(drive.statuses), n(drive.unreadable), n(drive.repeated), n(drive.overtaken), n(drive.late),
      n(drive.stopped), n(drive.awaited), n(drive.lost));
  if (!report.running) return text + "  the loop did not begin\n";
  text += line("period of the driver %.4g ms; commands sent: %lld", 1e3 * drive.period,
               n(drive.commands));
  if (drive.commands > 0) {
    text += line("from status to command: median %.0f us, 99.9 %% %.0f us, longest %.0f us",
                 latency_at(drive, 0.5), latency_at(drive, 0.999), drive.longest_latency);
  }
  text += line("ticks: %lld; springs restarted %lld times, faults %lld", n(report.loop.ticks),
               n(static_cast<std::int64_t>(report.loop.restarts)), n(report.loop.faults));
  for (std::size_t status = 0; status < report.loop.statuses.size(); ++status) {
    if (report.loop.statuses[status] == 0) continue;
    text += line("  %lld x %s", n(report.loop.statuses[status]), status_name(status).c_str());
  }
  const dashpot_modes& modes = report.loop.last_modes;
  if (modes.count > 0) text += "  modes, rad/s (ratio):";
  for (std::uint32_t i = 0; i < modes.count; ++i) {
    std::array<char, 64> mode{};
    std::snprintf(mode.data(), mode.size(), " %.4g (%.3g)", modes.modes[i].natural_frequency,
                  modes.modes[i].damping_ratio);
    text += mode.data();
  }
  if (modes.count > 0) text += "\n";
  text += fault_text(report.loop);
  text += commands_text(report.commands, report.loop.commands_refused);
  text += line("messages: %lld states, %lld modes, %lld sampled modes", n(report.messages.states),
               n(report.messages.modes), n(report.messages.sampled_modes));
  if (report.identified) text += "\n" + identify_table(*report.identified);
  return text;
}

std::string to_json(const DriveReport& report) {
  const DriveRecord& drive = report.drive;
  Json json;
  json["driver"] = lcmtypes::profile_of(report.driver).name;
  json["config"] = report.config;
  json["dry_run"] = report.dry_run;
  json["running"] = report.running;
  json["ended"] = report.ended;
  json["period"] = drive.period;
  json["statuses"] = {{"received", drive.statuses}, {"unreadable", drive.unreadable},
                      {"repeated", drive.repeated}, {"overtaken", drive.overtaken},
                      {"late", drive.late},         {"of_stopped_robot", drive.stopped},
                      {"awaited", drive.awaited},   {"lost", drive.lost}};
  json["commands_sent"] = drive.commands;
  json["latency"] = {{"median", 1e-6 * latency_at(drive, 0.5)},
                     {"p999", 1e-6 * latency_at(drive, 0.999)},
                     {"longest", 1e-6 * drive.longest_latency}};
  json["ticks"] = report.loop.ticks;
  json["restarts"] = report.loop.restarts;
  json["faults"] = report.loop.faults;
  json["fault"] = fault_json(report.loop);
  Json statuses = Json::object();
  for (std::size_t status = 0; status < report.loop.statuses.size(); ++status) {
    if (report.loop.statuses[status] > 0) {
      statuses[status_name(status)] = report.loop.statuses[status];
    }
  }
  json["tick_statuses"] = statuses;
  json["external_torque"] = std::vector<double>(drive.external.begin(), drive.external.end());
  json["modes"] = Json::array();
  for (std::uint32_t i = 0; i < report.loop.last_modes.count; ++i) {
    const dashpot_mode& mode = report.loop.last_modes.modes[i];
    json["modes"].push_back(
        {{"natural_frequency", mode.natural_frequency}, {"damping_ratio", mode.damping_ratio}});
  }
  json["commands"] = commands_json(report.commands, report.loop.commands_refused);
  json["messages"] = {{"states", report.messages.states},
                      {"modes", report.messages.modes},
                      {"sampled_modes", report.messages.sampled_modes}};
  if (report.identified) json["identified"] = identify_json(*report.identified);
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace dashpot::apps
