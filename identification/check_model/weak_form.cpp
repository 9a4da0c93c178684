#include <dashpot/identification/check_model/weak_form.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::identification {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// p = M qd, dL/dq + g = Mdot qd - C qd, and g at one state.
class LagrangianTerms {
 public:
  explicit LagrangianTerms(const controller::DynamicsKernel& kernel) : kernel_(kernel) {}

  void evaluate(const controller::JointVector& q, const controller::JointVector& qd) {
    kernel_.evaluate(q, qd, at_);
    p.noalias() = at_.M * qd;
    gravity = at_.gravity;
    const double speed = qd.cwiseAbs().maxCoeff();
    if (speed == 0) {
      slope.setZero(q.size());
      return;
    }
    // A central difference along the motion: 1e-4 rad leaves 1e-8 of M's change, and no digits of
    // it are lost to rounding before the ninth.
    const double s = 1e-4 / speed;
    slope = -at_.coriolis;
    kernel_.evaluate(q + s * qd, qd, at_);
    slope.noalias() += at_.M * qd / (2 * s);
    kernel_.evaluate(q - s * qd, qd, at_);
    slope.noalias() -= at_.M * qd / (2 * s);
  }

  controller::JointVector p, slope, gravity;

 private:
  const controller::DynamicsKernel& kernel_;
  controller::DynamicsResult at_;
};

}  // namespace

WeakForm::WeakForm(const std::vector<SmoothRun>& runs, const RecordFilter& how) : runs_(&runs) {
  constexpr double kHalfWidth = 0.1;  // T, s, at least: passes 5 Hz at half its size
  m_ = std::max<Index>(12, static_cast<Index>(std::lround(kHalfWidth / how.step)));
  const double T = static_cast<double>(m_) * how.step;
  width_ = 2 * T;
  f_.resize(2 * m_ + 1);
  slope_.resize(2 * m_ + 1);
  double sum = 0, moment = 0;
  for (Index i = -m_; i <= m_; ++i) {
    const double phase = std::numbers::pi * static_cast<double>(i) / static_cast<double>(m_);
    f_[i + m_] = 1 + std::cos(phase);
    slope_[i + m_] = -std::sin(phase);
    sum += f_[i + m_];
    moment -= slope_[i + m_] * static_cast<double>(i) * how.step;
  }
  f_ /= sum;
  slope_ /= moment;  // so that a momentum that rises evenly has its exact rate
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const SmoothRun& run = runs[k];
    for (Index first = 0; first + 2 * m_ < run.position.cols(); first += m_) {
      const double from = run.begin + static_cast<double>(first) * how.step;
      windows_.push_back({k, first, run.record, from, from + width_});
    }
  }
}

template <typename Function>
MatrixXd WeakForm::means(const VectorXd& weights, const Function& function) const {
  if (windows_.empty()) return {};
  MatrixXd result(runs_->front().position.rows(), count());
  MatrixXd values;
  std::size_t run = runs_->size();
  for (std::size_t k = 0; k < windows_.size(); ++k) {
    if (windows_[k].run != run) values = function((*runs_)[run = windows_[k].run]);
    result.col(static_cast<Index>(k)).noalias() =
        values.middleCols(windows_[k].first, weights.size()) * weights;
  }
  return result;
}

MatrixXd WeakForm::torque() const {
  return means(f_, [](const SmoothRun& run) { return run.torque; });
}

MatrixXd WeakForm::torque_rate() const {
  return means(slope_, [](const SmoothRun& run) { return MatrixXd(-run.torque); });
}

MatrixXd WeakForm::acceleration() const {
  return means(slope_, [](const SmoothRun& run) { return MatrixXd(-run.velocity); });
}

MatrixXd WeakForm::velocity() const {
  return means(f_, [](const SmoothRun& run) { return run.velocity; });
}

MatrixXd WeakForm::sign(const VectorXd& v0) const {
  return means(f_, [&v0](const SmoothRun& run) {
    return MatrixXd((v0.cwiseInverse().asDiagonal() * run.velocity).cwiseMax(-1).cwiseMin(1));
  });
}

MatrixXd WeakForm::slow_sign(double v0) const {
  return means(f_, [v0](const SmoothRun& run) {
    return MatrixXd(run.velocity.array().sign() * (-(run.velocity / v0).array().square()).exp());
  });
}

MatrixXd WeakForm::slow_share(const VectorXd& v0) const {
  return means(f_, [&v0](const SmoothRun& run) {
    const MatrixXd relative = v0.cwiseInverse().asDiagonal() * run.velocity.cwiseAbs();
    return MatrixXd((relative.array() < 1).cast<double>());
  });
}

WindowTorques WeakForm::torques(const controller::DynamicsKernel& kernel, Index joints) const {
  WindowTorques result;
  if (windows_.empty()) return result;
  const Index n = runs_->front().position.rows();
  result.inertial.setZero(n, count());
  result.gravity.setZero(n, count());
  LagrangianTerms terms(kernel);
  MatrixXd p, slope, gravity;
  std::size_t run = runs_->size();
  for (std::size_t k = 0; k < windows_.size(); ++k) {
    const auto column = static_cast<Index>(k);
    if (windows_[k].run != run) {
      const SmoothRun& motion = (*runs_)[run = windows_[k].run];
      const Index N = motion.position.cols();
      for (MatrixXd* all : {&p, &slope, &gravity}) all->resize(joints, N);
      for (Index i = 0; i < N; ++i) {
        terms.evaluate(motion.position.col(i).head(joints), motion.velocity.col(i).head(joints));
        p.col(i) = terms.p;
        slope.col(i) = terms.slope;
        gravity.col(i) = terms.gravity;
      }
    }
    const Index first = windows_[k].first, size = f_.size();
    result.inertial.col(column).head(joints) =
        -p.middleCols(first, size) * slope_ - slope.middleCols(first, size) * f_;
    result.gravity.col(column).head(joints) = gravity.middleCols(first, size) * f_;
  }
  return result;
}

}  // namespace dashpot::identification
