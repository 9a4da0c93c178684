#pragma once
#include <dashpot/identification/check_model/torque_fit.hpp>

namespace dashpot::identification {

/// After a fit, adds the hypothesis that explains most, as long as one explains much. Returns the
/// gravity that explains the torques better, if gravity explains most or if `tilted`.
std::optional<Eigen::Vector3d> explain(TorqueFit& fit, const controller::RobotDescription& robot,
                                       bool tilted, ModelCheck& check);

/// Reports the fitted values with deviations, doubts, and where other forces acted.
void report(const TorqueFit& fit, ModelCheck& check);
/// Reports which joints are doubted for reasons that need no hypothesis; after the estimates.
void report_suspicions(const TorqueFit& fit, ModelCheck& check);
/// Reports the parameters that the records cannot separate.
void report_ambiguities(const TorqueFit& fit, ModelCheck& check);

void add_reason(std::string& text, const std::string& reason);
/// "0.9 +- 0.1 kg less than the model says"
std::string beside_model(double value, double deviation, const std::string& unit);
/// ": joint 2 then leaves 0.1 instead of 0.2 N m over"
std::string then_leaves(const TorqueFit& fit, Eigen::Index j, double now, double before);

}  // namespace dashpot::identification
