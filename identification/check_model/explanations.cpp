#include <dashpot/identification/check_model/robust_fit.hpp>
#include <dashpot/identification/check_model/torque_fit.hpp>
#include <dashpot/identification/check_model/weak_form.hpp>
#include <dashpot/text/printable.hpp>

#include <Eigen/Cholesky>
#include <cmath>
#include <utility>

namespace dashpot::identification {
namespace {

/// Whether an apparent payload may be a link of another mass.
struct LinkOrPayload {
  const Hypothesis* link = nullptr;  ///< explains about as much as the payload; null: none does
  bool clearly = false;              ///< it explains far more
  double mass = 0;                   ///< that the link has beyond the model's, kg
  Eigen::VectorXd spread;            ///< parameters, by how much they differ with the link
};

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

/// Compares, beside a fit, the payload (10 columns from `payload` on) with each hypothesis of a
/// link's mass in its place. Sums of squares are in units of each joint's residual and of as many
/// windows as are independent, so that differences above 10 are clear. No link without a clear
/// payload.
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

void take(const Hypothesis& hypothesis, TorqueFit& fit) {
  for (const MatrixXd& column : hypothesis.columns) fit.add(column, kUndetermined);
  fit.result = robust_fit(fit.linear);
}

/// Friction that Coulomb's and a viscous one do not explain.
void add_frictions(const TorqueFit& fit, std::vector<Hypothesis>& all) {
  constexpr double kSlow = 0.1;  // rad/s (m/s)
  const MatrixXd slow = fit.form.slow_sign(kSlow);
  const auto add = [&](Index j, const Eigen::RowVectorXd& row, std::string what, std::string unit,
                       double factor) {
    MatrixXd column = MatrixXd::Zero(fit.n, fit.K);
    column.row(j) = row;
    all.push_back({static_cast<int>(j), {column}, std::move(what), std::move(unit), factor});
  };
  for (Index j = 0; j < fit.n; ++j) {
    if (!fit.moves[j]) continue;
    const auto sign = fit.linear.A.col(3 * j + 1).reshaped(fit.n, fit.K).row(j);
    add(j, sign.cwiseProduct(fit.model_torque.row(j).cwiseAbs()), "its Coulomb friction is",
        "% of its load", 100);
    add(j, slow.row(j), "its friction at low speed (Stribeck) is", fit.torque_unit(j).substr(1), 1);
  }
}

/// Words for the hypothesis taken last, if it has one column.
std::string what_it_is(const Hypothesis& hypothesis, const RobustFit& result) {
  const Index last = result.value.size() - 1;
  return hypothesis.what + " " +
         beside_model(result.value[last] * hypothesis.factor,
                      std::sqrt(result.covariance(last, last)) * hypothesis.factor,
                      " " + hypothesis.unit);
}

/// The gravity that follows of a tilt taken last.
Eigen::Vector3d tilted_gravity(const Eigen::Vector3d& before, const RobustFit& result) {
  const Eigen::Vector3d after = before + tilt_directions(before) * result.value.tail<2>();
  return before.norm() * after.normalized();
}

std::string& suspicious(const Hypothesis& hypothesis, ModelCheck& check) {
  return check.joints[static_cast<std::size_t>(hypothesis.joint)].suspicious;
}

/// If a payload was found, checks whether a link of another mass explains as much.
void weigh_link(TorqueFit& fit, const std::vector<Hypothesis>& hypotheses, ModelCheck& check) {
  const LinkOrPayload found = link_or_payload(fit.linear, fit.result, hypotheses, fit.payload());
  if (found.link == nullptr || fit.payload_known) return;
  if (found.clearly) {
    take(*found.link, fit);
    add_reason(suspicious(*found.link, check),
               "it looks as if " + what_it_is(*found.link, fit.result) +
                   ", which explains the torques better than a payload does");
    return;
  }
  check.ambiguities.push_back("link or payload: the torques are explained as well if " +
                              found.link->what + " " + text::number(std::abs(found.mass), 2) +
                              " kg " + (found.mass > 0 ? "more" : "less") +
                              " than the model says as by another payload");
  fit.spread = found.spread;
}

/// The hypothesis that reduces the weighted squares most; null if none does by much.
const Hypothesis* best_hypothesis(const TorqueFit& fit, const std::vector<Hypothesis>& all) {
  const LinearModel& linear = fit.linear;
  const RobustFit& result = fit.result;
  VectorXd root(linear.y.size());
  for (Index row = 0; row < root.size(); ++row) {
    root[row] = std::sqrt(linear.used[row] * result.weight[row]) / result.sigma[row % fit.n];
  }
  const MatrixXd A = root.asDiagonal() * linear.A * result.scale.asDiagonal();
  MatrixXd normal = A.transpose() * A;
  normal.diagonal().array() += 1e-10;  // what is unseen stays where it is
  for (Index i = 0; i < linear.prior.size(); ++i) {
    if (linear.prior[i] < kUndetermined)
      normal(i, i) += std::pow(result.scale[i] / linear.prior[i], 2);
  }
  const auto solver = normal.ldlt();
  const VectorXd r = root.cwiseProduct(result.residual);
  // One more number has to take a tenth of everything, or it would be found in any noise that is
  // not white; three numbers half as much again as one.
  double most = 0.1 * r.squaredNorm();
  const Hypothesis* best = nullptr;
  for (const Hypothesis& hypothesis : all) {
    const auto count = static_cast<Index>(hypothesis.columns.size());
    MatrixXd B(r.size(), count);
    for (Index i = 0; i < count; ++i) {
      B.col(i) = root.cwiseProduct(hypothesis.columns[static_cast<std::size_t>(i)].reshaped());
    }
    const VectorXd whole = B.colwise().squaredNorm().transpose();
    B -= A * solver.solve(A.transpose() * B);
    // Skips columns that depend on the others to 1e-6, such as one that was taken.
    if (!(B.colwise().squaredNorm().transpose().array() > 1e-6 * whole.array()).all()) continue;
    const MatrixXd own = B.transpose() * B;
    const VectorXd moment = B.transpose() * r;
    const double gain = moment.dot(own.ldlt().solve(moment)) / (count > 1 ? 1.5 : 1);
    if (gain > most) most = gain, best = &hypothesis;
  }
  return best;
}

/// Returns what is said of the hypothesis taken last; "" if it is not significant.
std::string reason_for(const Hypothesis& hypothesis, const TorqueFit& fit,
                       const RobustFit& before) {
  const RobustFit& result = fit.result;
  const auto count = static_cast<Index>(hypothesis.columns.size());
  double largest = 0;
  for (Index i = result.value.size() - count; i < result.value.size(); ++i) {
    largest = std::max(largest, std::abs(result.value[i]) / std::sqrt(result.covariance(i, i)));
  }
  constexpr double kClear = 4;  // deviations
  if (largest < kClear) return "";
  std::string leaves;
  double share = 0.8;  // a joint whose residual falls by less gives no reason to speak
  for (Index j = 0; j < fit.n; ++j) {
    const double old = fit.rms(before.residual, before, j);
    const double now = fit.rms(result.residual, before, j);
    constexpr double kSmall = 0.005;  // no model is better than that
    if (!(old > kSmall * fit.largest[j] && now / old < share)) continue;
    share = now / old;
    leaves = then_leaves(fit, j, now, old);
  }
  if (leaves.empty()) return "";
  return "it looks as if " +
         (count > 1 ? hypothesis.what + " elsewhere" : what_it_is(hypothesis, result)) + leaves;
}

}  // namespace

std::optional<Eigen::Vector3d> explain(TorqueFit& fit, const controller::RobotDescription& robot,
                                       bool tilted, ModelCheck& check) {
  fit.narrow_payload(check);
  std::vector<Hypothesis> hypotheses =
      list_hypotheses(robot, fit.model, fit.form, fit.model_torque);
  add_frictions(fit, hypotheses);
  if (check.kind != TorqueKind::kWhole) {  // the robot holds its weight itself
    std::erase_if(hypotheses,
                  [](const Hypothesis& h) { return h.what == "its torque reads" || h.gravity; });
  }
  check.joints.resize(static_cast<std::size_t>(fit.n));
  const Eigen::Vector3d& before = robot.options.gravity;
  std::optional<Eigen::Vector3d> gravity;
  if (tilted && hypotheses.front().gravity) {
    take(hypotheses.front(), fit);
    check.gravity_deviation = std::sqrt(fit.result.covariance.diagonal().tail<2>().mean());
    gravity = tilted_gravity(before, fit.result);
  }
  const bool explains = check.order.empty();  // otherwise the motion may belong to another arm
  const Hypothesis* best = explains ? best_hypothesis(fit, hypotheses) : nullptr;
  if (best == nullptr || !best->gravity) weigh_link(fit, hypotheses, check);
  for (int round = 0; round < 4 && explains; ++round) {
    best = best_hypothesis(fit, hypotheses);
    if (best == nullptr) break;
    LinearModel linear = fit.linear;
    RobustFit result = fit.result;
    take(*best, fit);
    const std::string reason = reason_for(*best, fit, result);
    if (reason.empty()) {
      fit.linear = std::move(linear);
      fit.result = std::move(result);
      break;
    }
    if (best->gravity) return tilted_gravity(before, fit.result);
    add_reason(suspicious(*best, check), reason);
  }
  return gravity;
}

}  // namespace dashpot::identification
