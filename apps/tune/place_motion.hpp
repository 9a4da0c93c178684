#pragma once
#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace dashpot::apps {

/// Returns how a place that is released one unit away comes to rest; one minus it is the step to a
/// goal one unit away.
nlohmann::ordered_json release_json(const analysis::Response& response,
                                    const analysis::Spectrum<>& spectrum,
                                    const Eigen::VectorXd& motion, const Eigen::RowVectorXd& row);

}  // namespace dashpot::apps
