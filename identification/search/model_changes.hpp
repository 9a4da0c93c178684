#pragma once
#include <dashpot/identification/search/found_model.hpp>

#include <functional>
#include <vector>

namespace dashpot::identification {

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

}  // namespace dashpot::identification
