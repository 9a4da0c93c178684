#pragma once
#include <dashpot/identification/search/model_changes.hpp>

#include <vector>

namespace dashpot::identification {

/// Prefers a model that all parts of the records have over a larger one that explains the whole
/// better: nonlinear motion looks like many modes, different in each part. If there is no such
/// model, removes the factors that the parts contradict, one after the other.
void keep_repeated(Search& search);

/// The geometric mean over the records in which a channel moves, like a fit's noise; `noise` of all
/// of them if it moves in none alone. At least the nonlinearity of the `motion`.
Eigen::VectorXd usual_noise(const std::vector<MotionRecord>& all, const Eigen::VectorXd& noise,
                            const Eigen::VectorXd& motion);

/// Widens the deviations for nonlinearity, which the likelihood does not include. One record of a
/// decay does not show it, while several differ (measured on arms of another engine:
/// docs/identify.md). A residual above the noise of `sensors` affects all modes.
void widen(FoundModel& found, const Eigen::VectorXd& sensors);

}  // namespace dashpot::identification
