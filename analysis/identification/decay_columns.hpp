#pragma once
#include <dashpot/analysis/identification/decay_data.hpp>

#include <vector>

namespace dashpot::analysis {

/// The motions of a factor in all records, samples x 2 or x 1, and their derivatives by `first`,
/// `second` and the scales of all sources but the reference.
struct FactorColumns {
  Eigen::MatrixXd value;
  std::vector<Eigen::MatrixXd> derivative;
};

FactorColumns columns_of(const DecayFactor& factor, const DecayPart& part, bool derivatives);

/// The inputs themselves, samples x inputs: what follows them at once, such as modes far above.
Eigen::MatrixXd direct_columns(const DecayPart& part);

/// Columns of the factors alone.
Eigen::Index factor_width(const std::vector<DecayFactor>& factors);

}  // namespace dashpot::analysis
