#pragma once
#include <dashpot/apps/audit/audit_options.hpp>

#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// What `dashpot audit` found.
struct AuditReport {
  controller::PostureAudit posture;
  std::optional<controller::WorkspaceAudit> workspace;
  controller::DampingSuggestion suggestion;
  std::string no_suggestion;    ///< why there is none; empty if there is one
  std::string lost_directions;  ///< of the task, if the posture is singular
  bool interrupted = false;     ///< postures of the workspace are missing
};

std::string audit_json(const AuditTask& task, const AuditReport& report);
std::string audit_table(const AuditTask& task, const AuditReport& report);

/// The numbers of posture i as a line of a table in CSV; the heading has its units.
std::string csv_heading(const controller::RobotModel& model);
std::string csv_line(std::int64_t i, const controller::JointVector& q,
                     const controller::PostureNumbers& numbers);

/// Draws the smallest ratios of many postures, and their gain margins if they have any, to a file
/// whose name ends with .svg or .png. Throws std::runtime_error if gnuplot fails.
void draw_audit(const std::string& path, const AuditTask& task,
                const std::vector<controller::PostureNumbers>& numbers);

}  // namespace dashpot::apps
