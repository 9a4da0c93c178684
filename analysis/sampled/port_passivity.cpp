#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/base/require.hpp>
#include <dashpot/analysis/contact_limit.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

MatrixXd or_zero(const MatrixXd& A, Index n) {
  return A.size() > 0 ? A : MatrixXd::Zero(n, n);
}

/// The springs, dampers and memory of a controller beside the friction of the joints.
class Port {
 public:
  Port(const System<>& system, const SampledLoop& loop)
      : loop_(loop),
        n_(system.dof()),
        friction_(or_zero(loop.friction, n_)),
        dampers_(system.damping - friction_) {
    const MatrixXd gravity = or_zero(loop.gravity_gradient, n_);
    const MatrixXd compensation = loop.compensation.size() > 0 ? loop.compensation : gravity;
    springs_ = system.stiffness - or_zero(loop.passive_stiffness, n_) - compensation;
    rest_ = system.stiffness + gravity - compensation;
    if (loop.torque_cutoff > 0) share_ = -std::expm1(-2 * kPi * loop.torque_cutoff * loop.period);
    scale_ = std::max(friction_.norm(), dampers_.norm() + loop.period * springs_.norm());
  }

  double scale() const { return scale_; }
  bool instants() const {
    return !loop_.difference_velocity && !dampers_.isZero(kRounding * scale_);
  }
  /// Whether the springs at rest pull back, whatever the deflection.
  bool pulls_back() const {
    const double size = rest_.norm();
    if (size == 0) return true;
    if ((rest_ - rest_.transpose()).norm() > kSymmetric * size) return false;
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(rest_, Eigen::EigenvaluesOnly);
    return eigen.eigenvalues()[0] >= -kSymmetric * size;
  }

  /// Returns the friction that each joint lacks at an angle of theta rad a tick.
  double missing(double theta) const {
    const double T = loop_.period, half = std::sin(0.5 * theta), chord = 4 * half * half;
    const Complex z = std::polar(1.0, theta), back = std::conj(z);
    const Complex change = Complex(0, 2 * half) * std::polar(1.0, -0.5 * theta);  // 1 - 1 / z
    MatrixXcd H = springs_.cast<Complex>();
    H += (loop_.difference_velocity ? change / T : Complex(0, theta / T)) * dampers_;
    if (const Index m = loop_.memory.state.rows(); m > 0) {
      const MatrixXcd step = z * MatrixXd::Identity(m, m) - loop_.memory.state;
      const MatrixXcd read = loop_.memory.position.cast<Complex>();
      H += loop_.memory.output * step.partialPivLu().solve(read);
    }
    H *= std::pow(back, loop_.delay) * share_ / (1.0 - (1 - share_) * back);
    const MatrixXcd given = (0.5 * T / chord) * change * H;
    const double passing = instants() ? theta * theta / chord : 1;
    const MatrixXcd Phi = friction_ - (given + given.adjoint()) / passing;
    const Eigen::SelfAdjointEigenSolver<MatrixXcd> eigen(Phi, Eigen::EigenvaluesOnly);
    return -eigen.eigenvalues()[0];
  }

  static constexpr double kRounding = 1e-12;

 private:
  static constexpr double kSymmetric = 1e-9;
  const SampledLoop& loop_;
  Index n_;
  MatrixXd friction_, dampers_, springs_, rest_;
  double share_ = 1, scale_ = 0;
};

/// Returns the angles at which the port is looked at: even ones, and small ones below the first.
std::vector<double> angles(int delay) {
  constexpr int kEven = 200, kEvenPerTick = 20, kSmall = 60;
  constexpr double kLeast = 1e-6;
  const int even = kEven + kEvenPerTick * delay;
  std::vector<double> result;
  result.reserve(static_cast<std::size_t>(kSmall + even));
  for (int i = 0; i < kSmall; ++i) {
    result.push_back(kLeast * std::pow(kPi / even / kLeast, static_cast<double>(i) / kSmall));
  }
  for (int i = 1; i <= even; ++i) result.push_back(kPi * i / even);
  return result;
}

}  // namespace

PortPassivity port_passivity(const System<>& system, const SampledLoop& loop) {
  require("port_passivity", std::isfinite(loop.period) && loop.period > 0,
          "period has to be positive, s");
  const Port port(system, loop);
  PortPassivity result;
  result.missing_friction = -kInfinity;
  result.instants = port.instants();
  const double none = Port::kRounding * port.scale();
  const auto look = [&](double theta) {
    const double missing = port.missing(theta);
    if (missing > result.missing_friction) {
      result.missing_friction = missing;
      result.frequency = theta / loop.period;
    }
    return missing;
  };
  const std::vector<double> theta = angles(loop.delay);
  std::vector<double> missing;
  for (const double one : theta) {
    missing.push_back(look(one));
    if (!(missing.back() > none)) continue;
    if (result.to == 0) result.from = one / loop.period;
    result.to = one / loop.period;
  }
  for (std::size_t i = 1; i + 1 < theta.size(); ++i) {  // golden section towards each maximum
    if (missing[i] < missing[i - 1] || missing[i] < missing[i + 1]) continue;
    constexpr double kGolden = 0.618034;
    constexpr int kLooks = 40;
    double low = theta[i - 1], high = theta[i + 1];
    for (int k = 0; k < kLooks; ++k) {
      const double length = kGolden * (high - low), first = high - length, last = low + length;
      if (look(first) > look(last)) {
        high = last;
      } else {
        low = first;
      }
    }
  }
  result.passive = result.missing_friction <= none && !result.instants && port.pulls_back();
  return result;
}

}  // namespace dashpot::analysis
