#pragma once
#include <dashpot/apps/design/design_options.hpp>
#include <dashpot/apps/design/region_report.hpp>

#include <functional>
#include <vector>

namespace dashpot::apps {

/// Designs one matrix for a list of configurations. Returns it though it keeps no margin.
using RegionSearch = std::function<RegionReport(const SystemFile&)>;
/// Returns the smallest ratio of the sampled loops with this matrix; 0 without a period.
using SampledRatio = std::function<double(const SystemFile&, const Eigen::MatrixXd&)>;

/// Finds one matrix that gives the ratio wanted in the air and against every stiffness up to
/// --contact, or up to the largest where it does. `air` has a configuration for each posture of
/// the model.
RegionReport design_for_contact(const DesignOptions& options, const SystemFile& air,
                                const controller::RobotModel& model,
                                const std::vector<controller::JointVector>& postures,
                                const RegionSearch& search, const SampledRatio& ratio);

}  // namespace dashpot::apps
