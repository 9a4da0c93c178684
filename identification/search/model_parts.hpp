#pragma once
#include <dashpot/identification/search/model_changes.hpp>

#include <vector>

namespace dashpot::identification {

/// Prefers a model that all parts of the records have over a larger one that explains the whole
/// better: motion that is not linear looks like many modes, and each part has others. If there is
/// none, removes the factors that the parts contradict, one after the other.
void keep_repeated(Search& search);

/// The geometric mean over the records in which a channel moves, as a fit's noise is one; `noise`
/// of all of them where it moves in none alone. No less than what is not linear in the `motion`.
Eigen::VectorXd usual_noise(const std::vector<MotionRecord>& all, const Eigen::VectorXd& noise,
                            const Eigen::VectorXd& motion);

/// Widens the deviations by what the likelihood does not know: that an arm is not quite linear. One
/// record of a decay does not show it, where several differ (measured on arms of another engine:
/// docs/identify.md); and where more is left over than `sensors` make, it is in the way of all
/// modes.
void widen(FoundModel& found, const Eigen::VectorXd& sensors);

}  // namespace dashpot::identification
