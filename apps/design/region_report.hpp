#pragma once
#include <dashpot/analysis/damping_region.hpp>
#include <dashpot/analysis/damping_sampled.hpp>
#include <dashpot/controller/robot_types.hpp>

#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// Touch of the tip in a configuration: a spring, N/m, along a direction; 0: nothing.
struct RegionTouch {
  double stiffness = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
};

/// Result of `dashpot design --region` and `--contact`.
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

std::string region_json(const RegionReport& report);
std::string region_table(const RegionReport& report);
/// Returns why the damping is not as wanted: less than a tenth of the ratio somewhere, or more than
/// is allowed. Empty if it is.
std::string region_complaint(const RegionReport& report);
/// The map of the worst mode: a line of headings, then one for each configuration.
std::string region_csv(const RegionReport& report);

}  // namespace dashpot::apps
