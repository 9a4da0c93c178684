#pragma once
#include <dashpot/analysis/damping_sampled.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/system_report.hpp>

#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// A design in the sampled loop.
struct LoopReport {
  analysis::LoopLimit limit;
  double level = 1;  ///< share of the wanted ratio that the loop allows
  double gain_margin = 0;
  analysis::SampledSpectrum sampled;
};

/// What `dashpot design` says of one system.
struct DesignReport {
  std::string key;  ///< of the matrix: "task_damping", or "damping" if there is no jacobian
  double ratio = 0;
  analysis::TaskImpedance impedance;  ///< with the new damping
  analysis::DampingDesign design;
  Report before;  ///< with the damping that the file gives
  Report after;
  std::optional<LoopReport> loop;  ///< none if the loop is taken for continuous
  std::vector<std::string> notes, assumes;
  std::optional<Eigen::VectorXd> q;  ///< of an arm, rad or m
  std::string rotors;                ///< of an arm: "known" or "unknown"
  std::string drives;                ///< name of the published drives that it has; empty: none
  bool gears = false;                ///< elastic, in `before` and `after`, but not in `design`
};

std::string design_json(const std::vector<DesignReport>& reports, bool as_list);
std::string design_table(const std::vector<DesignReport>& reports, bool as_list);

// Parts of reports on one design and on a region.
double smallest_eigenvalue(const Eigen::MatrixXd& A);
/// Returns the keys of a loop and its margin, without those that follow from them.
Json limit_value(const analysis::LoopLimit& limit, double gain_margin);
/// Returns the matrix in aligned columns; entries within the rounding of the largest are 0.
std::string matrix_text(const Eigen::MatrixXd& matrix);
std::string loop_margin_text(double gain_margin);

}  // namespace dashpot::apps
