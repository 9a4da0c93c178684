#pragma once
#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/model/decay_fit.hpp>
#include <dashpot/identification/model/excited_cells.hpp>
#include <dashpot/identification/model/realization.hpp>
#include <dashpot/identification/records/decay_cells.hpp>

#include <array>
#include <functional>
#include <optional>
#include <vector>

namespace dashpot::identification {

/// The search for the model that records support: in cells, which are few, and then refined on the
/// samples as they are.
class ModelSearch {
 public:
  /// See IdentifyOptions.
  ModelSearch(const std::vector<MotionRecord>& all, const IdentifyOptions& options);
  /// Searches records with inputs; the cells are fine enough to stand for all samples.
  ModelSearch(const ExcitedCells& cells, const IdentifyOptions& options);

  /// Refines what was found in the beginnings of records on all of them.
  void refine(const ExcitedCells& all);

  DecayFit fit;                                     ///< of the samples as they are
  std::vector<std::vector<RealizedPole>> by_order;  ///< from order 1
  int order = 0;                                    ///< of the realization chosen
  std::optional<DecayFit> larger;                   ///< the best that was not worth it
  DecayData data;
  /// Variance of each factor's `first` and `second` that parts of the records show beyond what
  /// each part's own deviations explain.
  std::vector<std::array<double, 2>> scatter;
  bool differs = false;  ///< parts of the records differ by more than their deviations
  std::vector<DecayFactor> not_repeated;  ///< found in the whole, but not in each part

 private:
  void choose_order(const Eigen::VectorXd& noise, bool products);
  void improve();
  void try_products(const Eigen::VectorXd& noise);
  void forget_useless_larger();
  void widen(const Eigen::VectorXd& sensors);
  void widen(const std::vector<MotionRecord>& all, const Eigen::VectorXd& noise);
  void try_drift();
  void keep_repeated();
  std::vector<DecayStep> steps_of_parts(const DecayFit& whole) const;
  std::size_t contradicted(const DecayFit& whole, std::vector<std::array<double, 2>>& shown) const;
  void drop(std::size_t factor);
  std::size_t copy_in(const DecayFit& whole) const;
  void add_spread_of_orders();
  double score(const DecayFit& some) const;
  std::vector<DecayFactor> candidates() const;
  bool add_from_rest();
  bool split_one();
  bool drop_one();
  void untangle();
  bool change(const std::vector<DecayFactor>& factors);

  /// Whether the search goes on; `done` of it is.
  bool goes_on(double done) const { return !stop_ || !stop_(done); }

  std::function<bool(double)> stop_;
  std::vector<MotionRecord> cells_;
  std::vector<DecayFit> plain_by_order_;  ///< of the first orders, without products
  double duration_ = 0;                   ///< s
  double colour_ = 1;                     ///< least whiteness of the models of rising order
  bool rough_ = false;                    ///< a first estimate is wanted
  int most_added_ = 6;                    ///< factors from what is left over
  /// A model of too small an order that has not settled loses to one of too large an order, whose
  /// surplus modes cancel. Decays that have cancel further with more; chirps need 60.
  int iterations_ = 30;
  /// Poles of what is left over in the cells, in units of the noise.
  std::function<std::vector<std::vector<RealizedPole>>(const std::vector<Eigen::MatrixXd>&)>
      poles_of_rest_;
};

}  // namespace dashpot::identification
