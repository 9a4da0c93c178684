#include <dashpot/analysis/base/require.hpp>
#include <dashpot/analysis/response.hpp>

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Position and velocity of one part of a motion at t = 0.
struct PartOfMotion {
  VectorXd q, v;
};

double energy_of(const System<>& system, const PartOfMotion& part) {
  return 0.5 * (part.q.dot(system.stiffness * part.q) + part.v.dot(system.mass * part.v));
}

/// Returns the largest |p(t)|, t >= 0, of  p'' - (l1 + l2) p' + l1 l2 p = 0  from p and v. After
/// the first time at which p' = 0 no stable motion comes as far again.
double farthest(const Mode<>& mode, double p, double v) {
  if (p == 0 && v == 0) return 0;
  if (mode.kind == ModeKind::kUnstable) return std::numeric_limits<double>::infinity();
  const auto& [first, second] = mode.eigenvalues;
  const double decay = -0.5 * (first + second).real();
  const Complex half = 0.5 * (first - second);
  // p' = exp(-decay t) (v cos(w t) - slope sin(w t) / w), with hyperbolic functions of two real
  // eigenvalues, and p likewise.
  const double slope = decay * v + (first * second).real() * p;
  double time = 0, cosine = 1, sine = 0;  // sine: sin(w t) / w
  if (half.imag() != 0) {
    const double w = std::abs(half.imag());
    double angle = std::atan2(w * v, slope);
    if (angle <= 0) angle += std::numbers::pi;
    time = angle / w, cosine = std::cos(angle), sine = std::sin(angle) / w;
  } else if (v / slope > 0) {
    constexpr double kNever = 1 - 1e-15;  // it only creeps away from p
    const double s = std::abs(half.real()), r = v / slope;
    time = s > 0 ? std::atanh(std::min(s * r, kNever)) / s : r;
    cosine = std::cosh(s * time), sine = s > 0 ? std::sinh(s * time) / s : time;
  }
  const double there = std::exp(-decay * time) * (p * cosine + (v + decay * p) * sine);
  return std::max(std::abs(p), std::abs(there));
}

/// The coordinates of the free motion; after a step, about its rest.
VectorXd free_coordinates(const System<>& system, const ModalBasis<>& basis, const Cause& cause) {
  const VectorXd zero = VectorXd::Zero(system.dof());
  VectorXd xi = coordinates<kDynamic>(basis, system.mass, system.damping,
                                      cause.position.value_or(zero), cause.velocity.value_or(zero));
  if (cause.impulse) xi += drive<kDynamic>(basis, *cause.impulse);
  if (!cause.force) return xi;
  const VectorXd pushed = drive<kDynamic>(basis, *cause.force);
  for (const Block& block : basis.blocks) {
    if (block.zero_mode) continue;
    xi.segment(block.first, block.size) +=
        basis.Lambda.block(block.first, block.first, block.size, block.size)
            .fullPivLu()
            .solve(pushed.segment(block.first, block.size));
  }
  return xi;
}

}  // namespace

ModeShares mode_shares(const System<>& system, const Spectrum<>& spectrum, const Cause& cause,
                       const MatrixXd& points) {
  Response(system, spectrum).caused(cause, 0);  // throws if the cause does not fit the system
  const Index n = system.dof();
  require("mode_shares", points.cols() == n, "points has not as many columns as coordinates");
  const ModalBasis<>& basis = spectrum.basis;
  const VectorXd xi = free_coordinates(system, basis, cause);
  const PartOfMotion none{VectorXd::Zero(n), VectorXd::Zero(n)};
  PartOfMotion zero_modes = none, whole = none;
  std::vector<PartOfMotion> parts(static_cast<std::size_t>(spectrum.modes.size()), none);
  for (const Block& block : basis.blocks) {
    const auto within = [&](int column) {
      return column >= block.first && column < block.first + block.size;
    };
    const MatrixXd U = basis.U.middleCols(block.first, block.size);
    const VectorXd x = xi.segment(block.first, block.size);
    const VectorXd x_rate =
        basis.Lambda.block(block.first, block.first, block.size, block.size) * x;
    const PartOfMotion moved{U * x, U * x_rate};
    whole.q += moved.q, whole.v += moved.v;
    double eigenvalues = 0;  // of modes that are in the block
    for (const Mode<>& mode : spectrum.modes) {
      for (const int column : mode.columns) eigenvalues += within(column) ? 1 : 0;
    }
    if (eigenvalues == 0) zero_modes.q += moved.q, zero_modes.v += moved.v;
    for (int i = 0; i < spectrum.modes.size(); ++i) {
      for (const int column : spectrum.modes[i].columns) {
        if (!within(column)) continue;
        PartOfMotion& part = parts[static_cast<std::size_t>(i)];
        part.q += moved.q / eigenvalues, part.v += moved.v / eigenvalues;
      }
    }
  }

  ModeShares result;
  result.energy.resize(spectrum.modes.size());
  result.amplitude.resize(points.rows(), spectrum.modes.size());
  for (int i = 0; i < spectrum.modes.size(); ++i) {
    const PartOfMotion& part = parts[static_cast<std::size_t>(i)];
    result.energy[i] = energy_of(system, part);
    for (Index k = 0; k < points.rows(); ++k) {
      result.amplitude(k, i) =
          farthest(spectrum.modes[i], points.row(k).dot(part.q), points.row(k).dot(part.v));
    }
  }
  result.zero_modes = energy_of(system, zero_modes);
  const double sum = result.energy.sum() + result.zero_modes;
  result.energy /= sum;
  result.zero_modes /= sum;
  result.cross = energy_of(system, whole) / sum - 1;
  return result;
}

}  // namespace dashpot::analysis
