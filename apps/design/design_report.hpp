#pragma once
#include <dashpot/analysis/damping_region.hpp>
#include <dashpot/analysis/damping_sampled.hpp>
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

/// What the tip touches in a configuration: a spring, N/m, along a direction; 0: nothing.
struct RegionTouch {
  double stiffness = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
};

/// What `dashpot design --region` and `--contact` say.
struct RegionReport {
  std::string key;
  double ratio = 0;
  analysis::RegionDesign design;
  std::vector<std::string> assumes = {};
  std::vector<controller::JointVector> postures = {};  ///< of an arm, one for each sample
  std::optional<analysis::LoopLimit> limit = {};  ///< none if the loops are taken for continuous
  std::vector<RegionTouch> touches = {};          ///< one for each sample; none without --contact
  double asked_contact = 0;                       ///< N/m
  double sampled_ratio = 0;  ///< with --contact, the smallest of all loops; 0 without a period
  std::optional<double> contact = {};  ///< up to which the ratio holds, N/m; none: nowhere
};

std::string design_json(const std::vector<DesignReport>& reports, bool as_list);
std::string design_table(const std::vector<DesignReport>& reports, bool as_list);
std::string region_json(const RegionReport& report);
std::string region_table(const RegionReport& report);
/// Returns why the damping is not as wanted: less than a tenth of the ratio somewhere, or more than
/// is allowed. Empty if it is.
std::string region_complaint(const RegionReport& report);
/// The map of the worst mode: a line of headings, then one for each configuration.
std::string region_csv(const RegionReport& report);

}  // namespace dashpot::apps
