#pragma once
#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/rigid_body_elimination.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/apps/cli/system_file.hpp>
#include <dashpot/apps/report/json.hpp>

#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// Motion at the wanted times: the sum of the responses to all inputs.
struct ReportedResponse {
  std::vector<double> times;              ///< s
  std::vector<analysis::Motion> motions;  ///< one for each time
  analysis::ModeShares shares;            ///< of the modes in it
  std::string point;                      ///< whose amplitudes these are
};

/// The results of `dashpot analyze` for one system.
struct Report {
  Eigen::Index dof = 0;
  analysis::Spectrum<> spectrum;
  analysis::RigidBodyElimination elimination;  ///< the paper's reduction, for comparison
  std::optional<ReportedResponse> response;
  std::vector<std::string> notes;  ///< unexpected facts, a sentence each
};

/// Analyses `system`, the system of `entry` in joint space.
Report make_report(const SystemEntry& entry, const analysis::System<>& system,
                   const analysis::SpectrumOptions& options, analysis::Pivot pivot);

/// One report as an object. docs/command-line.md lists the keys.
Json report_json(const Report& report);
/// An object for each report, in a list if `as_list`.
std::string to_json(const std::vector<Report>& reports, bool as_list);
/// The reports as text for people, at most 100 columns wide if the numbers allow it. In a list each
/// report is headed by its index, counted from 0. `bold` marks headings for a terminal.
std::string to_table(const std::vector<Report>& reports, bool as_list, bool bold);

}  // namespace dashpot::apps
