#pragma once
#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace dashpot::apps {

/// Returns how a motion that is let go one unit away comes to rest, and how that looks from the
/// goal: the step to a goal one unit away is one minus it.
nlohmann::ordered_json release_json(const analysis::Response& response,
                                    const analysis::Spectrum<>& spectrum,
                                    const Eigen::VectorXd& motion, const Eigen::RowVectorXd& row);

}  // namespace dashpot::apps
