#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/sampled/circle_count.hpp>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A distance where rounding leaves none.
constexpr double kNone = 1e-12;

Complex exp_less_1(Complex x) {
  const double half = std::sin(0.5 * x.imag()), grown = std::exp(x.real());
  return {std::expm1(x.real()) - 2 * grown * half * half, grown * std::sin(x.imag())};
}

/// F at a point of the path, and its inverse.
struct CirclePoint {
  Complex z_less_1, h, change;  ///< change: h (1 - 1 / z)
  MatrixXcd inverse;
  std::array<MatrixXcd, 2> pulls;  ///< inverse B C; the second empty where nothing differences
  double phase = 0;                ///< of det F
};

double phase_of_determinant(const Eigen::PartialPivLU<MatrixXcd>& lu) {
  double phase = lu.permutationP().determinant() < 0 ? kPi : 0;
  for (Index i = 0; i < lu.matrixLU().rows(); ++i) phase += std::arg(lu.matrixLU()(i, i));
  return phase;
}

auto moduli(const MatrixXcd& A) {
  return A.cwiseAbs2().cwiseSqrt();
}

/// A bound of the largest eigenvalue of a nonnegative matrix; improves its eigenvector.
double perron_bound(const MatrixXd& N, VectorXd& vector) {
  double least = kInfinity;
  for (int i = 0; i < 3; ++i) {
    const VectorXd next = N * vector;
    least = std::min(least, next.cwiseQuotient(vector).maxCoeff());
    vector = (next / next.maxCoeff()).cwiseMax(1e-9);
  }
  return least;
}

}  // namespace

CircleCount::CircleCount(const SampledDataModel& loop, double slowest)
    : slowest_(std::max(slowest, 1e-6)),
      delay_(loop.delay),
      filter_gain_(loop.filter_gain),
      differences_(loop.difference) {
  rate_ = delay_ + (1 - filter_gain_) / filter_gain_;
  const Index n = loop.n, m = loop.states.state.rows(), p = 2 * n + m;
  rest_ = MatrixXd::Zero(p, p);
  rest_.topLeftCorner(2 * n, 2 * n) = loop.motion.leftCols(2 * n);
  rest_.bottomLeftCorner(m, n) = loop.states.position;
  rest_.bottomRightCorner(m, m) = loop.states.state;
  rest_.diagonal().array() -= 1;
  const MatrixXd B = loop.motion.rightCols(n), damping = B * (loop.C - loop.D);
  for (int i = 0; i < 2; ++i) fixed_[i] = scaled_[i] = MatrixXd::Zero(p, p);
  fixed_[0].topLeftCorner(2 * n, n) = B * loop.H;
  scaled_[0].topLeftCorner(2 * n, n) = B * (loop.P - loop.K);
  scaled_[0].topRightCorner(2 * n, m) = -B * loop.states.output;
  (loop.difference ? scaled_[1].leftCols(n) : scaled_[0].middleCols(n, n)).topRows(2 * n) -=
      damping;
}

double CircleCount::excess(double factor) const {
  const Index p = rest_.rows();
  const MatrixXd pull[2] = {fixed_[0] + factor * scaled_[0], factor * scaled_[1]};
  // |tr log(1 + E) - tr E + tr E^2 / 2| <= p (-log(1 - r) - r - r^2 / 2) for spectral radii r
  double radius = 0.5;
  while (static_cast<double>(p) * (-std::log1p(-radius) - radius - 0.5 * radius * radius) > 2.5) {
    radius *= 0.8;
  }
  const double arc = 0.5 * kPi * slowest_, length = arc + kPi - slowest_;
  const auto point_at = [&](double t) {
    const Complex x = t < arc ? std::polar(slowest_, t / slowest_) : Complex(0, slowest_ + t - arc);
    CirclePoint point;
    point.z_less_1 = exp_less_1(x);
    const Complex back = std::exp(-x);
    point.h = std::exp(-delay_ * x) * filter_gain_ / (1.0 - (1 - filter_gain_) * back);
    point.change = point.h * back * point.z_less_1;
    MatrixXcd F = -point.h * pull[0] - rest_;
    if (differences_) F -= point.change * pull[1];
    F.diagonal().array() += point.z_less_1;
    const Eigen::PartialPivLU<MatrixXcd> lu(F);
    point.phase = phase_of_determinant(lu);
    point.inverse = lu.inverse();
    point.pulls[0].noalias() = point.inverse * pull[0];
    if (differences_) point.pulls[1].noalias() = point.inverse * pull[1];
    return point;
  };
  const double speed = std::exp(slowest_);  // largest |dz / dx|
  VectorXd vector = VectorXd::Ones(p);
  double turned = 0, t = 0, nearest = kInfinity;
  CirclePoint here = point_at(t);
  while (t < length) {
    const double distance = t < arc ? slowest_ : slowest_ + t - arc;  // |log z|
    MatrixXd N = speed * moduli(here.inverse) + rate_ * moduli(here.pulls[0]);
    if (differences_) N += (rate_ * std::min(1.5 * distance, 2.0) + 1) * moduli(here.pulls[1]);
    const double clear = 1 / perron_bound(N, vector),
                 step = std::min(radius * clear, 0.5 * distance);
    if (!(step > 1e-9 * distance)) return step > 0 ? step : kNone;
    nearest = std::min(nearest, clear);
    t = std::min(t + step, length);
    CirclePoint next = point_at(t);
    MatrixXcd E =
        (next.z_less_1 - here.z_less_1) * here.inverse - (next.h - here.h) * here.pulls[0];
    if (differences_) E -= (next.change - here.change) * here.pulls[1];
    const double about = (E.trace() - 0.5 * E.cwiseProduct(E.transpose()).sum()).imag();
    turned += about + std::remainder(next.phase - here.phase - about, 2 * kPi);
    here = std::move(next);
  }
  return std::lround(turned / kPi) == p ? -nearest : nearest;  // it is half the path
}

}  // namespace dashpot::analysis
