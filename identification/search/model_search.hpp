#pragma once
#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/model/decay_fit.hpp>
#include <dashpot/identification/model/excited_cells.hpp>
#include <dashpot/identification/model/realization.hpp>

#include <array>
#include <functional>
#include <optional>
#include <vector>

namespace dashpot::identification {

/// The model that records support, and the results of the search.
struct FoundModel {
  DecayData data;                                        ///< that it is fitted to
  DecayFit fit = {};                                     ///< the model
  std::vector<std::vector<RealizedPole>> by_order = {};  ///< from order 1
  int order = 0;                                         ///< of the realization chosen
  std::optional<DecayFit> larger = {};  ///< the best that was not worth its parameters
  /// Variance of each factor's `first` and `second` that parts of the records show beyond what
  /// each part's own deviations explain.
  std::vector<std::array<double, 2>> scatter = {};
  bool differs = false;  ///< parts of the records differ by more than their deviations
  std::vector<DecayFactor> not_repeated = {};  ///< found in the whole, but not in each part
};

/// The limits of a search.
struct SearchLimits {
  int rows = 0;   ///< most of the Hankel matrix of the realization of decays
  int worse = 6;  ///< orders in turn without a better one, after which no larger ones are tried
  int iterations = 0;  ///< of a fit
  int added = 0;       ///< factors from the residual
};

/// A search among the models of some cells.
struct Search {
  std::vector<MotionRecord> cells;
  double duration = 0;  ///< s
  SearchLimits limits;
  /// Poles of the residual in the cells, in units of the noise.
  std::function<std::vector<std::vector<RealizedPole>>(const std::vector<Eigen::MatrixXd>&)>
      poles_of_rest;
  std::function<bool(double)> stop;
  FoundModel found;                           ///< so far
  std::vector<DecayFit> plain_by_order = {};  ///< of the first orders, without products
  double colour = 1;                          ///< least whiteness of the models of rising order

  /// True to go on; `done` is the finished share.
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

/// Each of these changes the model if the change explains the cells better; the first two return
/// whether it did.
bool add_from_rest(Search& search);  ///< one factor more, from the residual
bool split_one(Search& search);      ///< two factors in place of one
void drop_useless(Search& search);   ///< factors, and halves of them, until all count

/// Adds factors of the residual, drops useless ones, and begins again without factors that cancel.
void improve(Search& search);

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

/// Searches for the model of decays, in cells, which are few, and refines it on the samples as they
/// are; without `refine` it is the one of the cells, a first estimate.
FoundModel find_model(const std::vector<MotionRecord>& all, const IdentifyOptions& options);

/// Searches for the model of records with inputs; the cells are fine enough to stand for all
/// samples.
FoundModel find_model(const ExcitedCells& cells, const IdentifyOptions& options);

/// Refines the model that was found in the beginnings of records on all of them.
void refine(const ExcitedCells& all, FoundModel& found);

}  // namespace dashpot::identification
