#pragma once
#include <dashpot/identification/search/model_search.hpp>

#include <functional>
#include <vector>

namespace dashpot::identification {

/// The limits of a search.
struct SearchLimits {
  int rows = 0;   ///< most of the Hankel matrix of the realization of decays
  int worse = 6;  ///< orders in turn without a better one, after which no larger ones are tried
  int iterations = 0;  ///< of a fit
  int added = 0;       ///< factors from what is left over
};

/// A search among the models of some cells.
struct Search {
  std::vector<MotionRecord> cells;
  double duration = 0;  ///< s
  SearchLimits limits;
  /// Poles of what is left over in the cells, in units of the noise.
  std::function<std::vector<std::vector<RealizedPole>>(const std::vector<Eigen::MatrixXd>&)>
      poles_of_rest;
  std::function<bool(double)> stop;
  FoundModel found;                           ///< so far
  std::vector<DecayFit> plain_by_order = {};  ///< of the first orders, without products
  double colour = 1;                          ///< least whiteness of the models of rising order

  /// Whether it goes on; `done` of it is.
  bool goes_on(double done) const { return !stop || !stop(done); }
  /// Returns the criterion with a price of parameters that grows with the motion that no model
  /// explains, because its squares are fewer independent numbers than samples (quasi-likelihood;
  /// Lebreton et al. 1992).
  double score(const DecayFit& some) const {
    return some.criterion + (colour - 1) * parameter_penalty(some, found.data);
  }
};

/// Returns as factors the poles that a record of this length (s) can tell from a constant.
std::vector<DecayFactor> factors_of(const std::vector<RealizedPole>& poles, double duration);

/// Each of these changes the model found as described, if that explains the cells better, and
/// returns whether it did.
bool add_from_rest(Search& search);  ///< one factor more, of what is left over
bool split_one(Search& search);      ///< two factors in place of one
void drop_useless(Search& search);   ///< factors, and halves of them, until all count

/// Adds what is left over, drops what does not count, and begins again without factors that cancel.
void improve(Search& search);

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
