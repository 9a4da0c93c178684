#include <dashpot/apps/loop/command_report.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/controller/tick_status.hpp>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <numeric>
#include <stdexcept>

namespace dashpot::apps {
namespace {

using lcmtypes::CommandVerdict;

std::string latched_text(std::int32_t fault) {
  return controller::to_text(static_cast<controller::Status>(fault));
}

}  // namespace

std::string verdicts_text(std::span<const std::int64_t> verdicts) {
  const std::int64_t accepted = verdicts.empty() ? 0 : verdicts.front();
  const std::int64_t all = std::accumulate(verdicts.begin(), verdicts.end(), std::int64_t{0});
  std::string out =
      std::to_string(accepted) + " accepted, " + std::to_string(all - accepted) + " rejected";
  std::string reasons;
  for (std::size_t i = 1; i < verdicts.size(); ++i) {
    if (verdicts[i] == 0) continue;
    reasons += (reasons.empty() ? "" : ", ") + std::to_string(verdicts[i]) + " " +
               lcmtypes::to_text(static_cast<CommandVerdict>(i));
  }
  return reasons.empty() ? out : out + " (" + reasons + ")";
}

std::string commands_text(const std::optional<CommandReport>& report, std::int64_t refused) {
  if (!report) return "  Commands: not taken (--commands)\n";
  const lcmtypes::CommandTally& tally = report->tally;
  std::string out = "  Commands: " + verdicts_text(tally.verdicts);
  if (refused > 0) {
    out += ", " + std::to_string(refused) + " of those accepted refused by the controller";
  }
  if (tally.last_refusal != CommandVerdict::kAccepted) {
    out += "; last rejected: " + report->last_reason + ", of sender " +
           std::to_string(tally.last_refused_sender);
  }
  return out + "\n";
}

std::string fault_text(const LoopRecord& loop) {
  if (loop.faults == 0) return "";
  std::string out = "  Faults latched: " + std::to_string(loop.faults);
  if (loop.fault != DASHPOT_OK) {
    out += "; not released: " + latched_text(loop.fault) + ", at tick " +
           std::to_string(loop.fault_tick);
  }
  return out + "\n";
}

void refuse_latched_fault(const LoopRecord& loop) {
  if (loop.fault == DASHPOT_OK) return;
  throw std::runtime_error("ended in a fault: " + latched_text(loop.fault) + ", at tick " +
                           std::to_string(loop.fault_tick) + " (docs/safety.md)");
}

Json commands_json(const std::optional<CommandReport>& report, std::int64_t refused) {
  const CommandReport commands = report.value_or(CommandReport());
  const lcmtypes::CommandTally& tally = commands.tally;
  Json verdicts = Json::object(), last_refusal;
  for (std::size_t i = 0; i < tally.verdicts.size(); ++i) {
    if (tally.verdicts[i] == 0) continue;
    verdicts[lcmtypes::to_text(static_cast<CommandVerdict>(i))] = tally.verdicts[i];
  }
  if (tally.last_refusal != CommandVerdict::kAccepted) {
    last_refusal = {{"verdict", lcmtypes::to_text(tally.last_refusal)},
                    {"reason", commands.last_reason},
                    {"sender", tally.last_refused_sender},
                    {"utime", tally.last_refusal_utime}};
  }
  return {{"taken", report.has_value()},  {"accepted", tally.accepted()},
          {"rejected", tally.rejected()}, {"refused", refused},
          {"verdicts", verdicts},         {"last_refusal", last_refusal},
          {"commander", tally.commander}};
}

Json fault_json(const LoopRecord& loop) {
  if (loop.fault == DASHPOT_OK) return nullptr;
  return {{"status", latched_text(loop.fault)}, {"tick", loop.fault_tick}};
}

}  // namespace dashpot::apps
