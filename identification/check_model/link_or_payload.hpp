#pragma once
#include <dashpot/identification/check_model/hypotheses.hpp>
#include <dashpot/identification/check_model/robust_fit.hpp>

namespace dashpot::identification {

/// Whether an apparent payload may be a link of another mass.
struct LinkOrPayload {
  const Hypothesis* link = nullptr;  ///< explains about as much as the payload; null: none does
  bool clearly = false;              ///< it explains far more
  double mass = 0;                   ///< that the link has beyond the model's, kg
  Eigen::VectorXd spread;            ///< parameters, by how much they differ with the link
};

/// Compares, beside a fit, the payload (10 columns from `payload` on) with each hypothesis of a
/// link's mass in its place. Sums of squares are in units of each joint's residual and of as many
/// windows as are independent, so that differences above 10 are clear. No link without a clear
/// payload.
LinkOrPayload link_or_payload(const LinearModel& model, const RobustFit& fit,
                              const std::vector<Hypothesis>& hypotheses, Eigen::Index payload);

}  // namespace dashpot::identification
