#include <dashpot/identification/check_model/link_or_payload.hpp>

#include <Eigen/Cholesky>
#include <cmath>

namespace dashpot::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kClearlyLess = 10;   // of a sum of squares: a link in place of the payload
constexpr double kClearlyMore = 16;   // the payload, which has four numbers, in place of a link
constexpr double kClearPayload = 20;  // likewise, in place of nothing

/// Sums of squares of fits with some of many columns.
class SubsetFits {
 public:
  SubsetFits(const MatrixXd& columns, const VectorXd& y, const VectorXd& prior)
      : square_(y.squaredNorm()) {
    scale_ = columns.colwise().norm().transpose();
    scale_ = (scale_.array() > 0).select(scale_.cwiseInverse(), 1);
    const MatrixXd scaled = columns * scale_.asDiagonal();
    normal_ = scaled.transpose() * scaled;
    normal_.diagonal().array() += 1e-10;  // what is unseen stays where it is
    moment_ = scaled.transpose() * y;
    for (Index i = 0; i < prior.size(); ++i) {
      if (prior[i] < 1e300) normal_(i, i) += std::pow(scale_[i] / prior[i], 2);
    }
  }

  /// Returns the sum of squares after a fit of these columns, and their values.
  double left(const std::vector<Index>& which, VectorXd& value) const {
    const VectorXd moment = moment_(which);
    const VectorXd x = normal_(which, which).ldlt().solve(moment);
    value.setZero(scale_.size());
    value(which) = x.cwiseProduct(scale_(which));
    return square_ - x.dot(moment);
  }

 private:
  double square_;
  VectorXd scale_, moment_;
  MatrixXd normal_;
};

}  // namespace

LinkOrPayload link_or_payload(const LinearModel& model, const RobustFit& fit,
                              const std::vector<Hypothesis>& hypotheses, Index payload) {
  std::vector<const Hypothesis*> links;
  for (const Hypothesis& one : hypotheses) {
    if (one.link_mass) links.push_back(&one);
  }
  const Index n = model.joints, p = model.A.cols();
  VectorXd root(model.y.size());
  for (Index row = 0; row < root.size(); ++row) {
    root[row] =
        std::sqrt(model.used[row] * fit.weight[row] / fit.inflation[row % n]) / fit.sigma[row % n];
  }
  MatrixXd columns(model.A.rows(), p + static_cast<Index>(links.size()));
  columns.leftCols(p) = model.A;
  for (std::size_t l = 0; l < links.size(); ++l) {
    const MatrixXd& own = links[l]->columns.front();
    columns.col(p + static_cast<Index>(l)) = VectorXd::Map(own.data(), own.size());
  }
  const SubsetFits fits(root.asDiagonal() * columns, root.cwiseProduct(model.y), model.prior);
  std::vector<Index> all, without;
  for (Index i = 0; i < p; ++i) {
    all.push_back(i);
    if (i < payload || i >= payload + kPayloadColumns) without.push_back(i);
  }
  VectorXd with_payload, value;
  const double least = fits.left(all, with_payload);
  LinkOrPayload found;
  if (fits.left(without, value) - least < kClearPayload) return found;
  double most = least + kClearlyMore;
  for (std::size_t l = 0; l < links.size(); ++l) {
    std::vector<Index> with_link = without;
    with_link.push_back(p + static_cast<Index>(l));
    const double left = fits.left(with_link, value);
    if (left >= most) continue;
    most = left;
    found = {links[l], left < least - kClearlyLess, value[with_link.back()],
             (value - with_payload).head(p)};
  }
  return found;
}

}  // namespace dashpot::identification
