#pragma once
#include <dashpot/analysis/identification/decay_cells.hpp>
#include <dashpot/analysis/identification/decay_fit.hpp>
#include <dashpot/analysis/identification/excited_cells.hpp>
#include <dashpot/analysis/identification/realization.hpp>

#include <functional>
#include <optional>
#include <vector>

namespace dashpot::analysis {

/// The search for the model that records support: in cells, which are few, and then refined on the
/// samples as they are.
class ModelSearch {
 public:
  /// See IdentifyOptions.
  ModelSearch(const std::vector<MotionRecord>& records, int max_order, bool refine);
  /// Of records with inputs; the cells are fine enough to be all that is looked at.
  ModelSearch(const ExcitedCells& cells, int max_order);

  DecayFit fit;                                     ///< of the samples as they are
  std::vector<std::vector<RealizedPole>> by_order;  ///< from order 1
  int order = 0;                                    ///< of the realization chosen
  std::optional<DecayFit> larger;                   ///< the best that was not worth it
  DecayData data;

 private:
  void choose_order(const Eigen::VectorXd& noise, bool products);
  void improve();
  void try_products(const Eigen::VectorXd& noise);
  void forget_useless_larger();
  std::vector<DecayFactor> candidates() const;
  bool add_from_rest();
  bool drop_one();
  void untangle();
  bool change(const std::vector<DecayFactor>& factors);

  std::vector<MotionRecord> cells_;
  std::vector<DecayFit> plain_by_order_;  ///< of the first orders, without products
  double duration_ = 0;                   ///< s
  int most_added_ = 6;                    ///< factors from what is left over
  int iterations_ = 40;                   ///< of a changed model
  /// Poles of what is left over in the cells, in units of the noise.
  std::function<std::vector<std::vector<RealizedPole>>(const std::vector<Eigen::MatrixXd>&)>
      poles_of_rest_;
};

}  // namespace dashpot::analysis
