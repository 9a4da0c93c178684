#pragma once
#include <dashpot/apps/loop/loop_journal.hpp>
#include <dashpot/lcmtypes/command_verdict.hpp>

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace dashpot::apps {

/// The results of the commands of a run.
struct CommandReport {
  lcmtypes::CommandTally tally;
  std::string last_reason;  ///< of the last rejection
};

/// "3 accepted, 2 rejected (1 too old, 1 not finite)", of state_t::verdicts.
std::string verdicts_text(std::span<const std::int64_t> verdicts);

/// For people: lines that begin with two spaces. `report` without a value: commands were disabled;
/// `refused`: accepted commands that the controller refused.
std::string commands_text(const std::optional<CommandReport>& report, std::int64_t refused);
std::string fault_text(const LoopRecord& loop);

nlohmann::ordered_json commands_json(const std::optional<CommandReport>& report,
                                     std::int64_t refused);
/// Throws std::runtime_error if a fault is latched at the end, so that the exit status shows it.
void refuse_latched_fault(const LoopRecord& loop);
/// null if no fault is latched at the end
nlohmann::ordered_json fault_json(const LoopRecord& loop);

}  // namespace dashpot::apps
