#pragma once
// How well a computed motion solves  M q'' + C q' + K q = f.

#include <dashpot/analysis/response.hpp>
#include <dashpot/tests/support/random.hpp>

#include <algorithm>

namespace dashpot::testing {

/// Largest |M q'' + C q' + K q - f| at random times between `earliest` and `latest` (s), relative
/// to the sum of the sizes of its terms. q'' comes from the velocities by an eighth-order
/// difference with a step of `h` (s): its error is about (omega h)^8 / 630 for a motion of
/// frequency omega.
template <class MotionAt, class ForceAt>
double worst_residual(const analysis::System<>& system, Random& random, double earliest,
                      double latest, double h, const MotionAt& motion, const ForceAt& force) {
  using Eigen::VectorXd;
  double worst = 0;
  for (int i = 0; i < 20; ++i) {
    const double t = random.log_uniform(earliest, latest);
    const auto v = [&](int k) -> VectorXd { return motion(t + k * h).velocity; };
    const VectorXd acceleration =
        (672 * (v(1) - v(-1)) - 168 * (v(2) - v(-2)) + 32 * (v(3) - v(-3)) - 3 * (v(4) - v(-4))) /
        (840 * h);
    const analysis::Motion now = motion(t);
    const VectorXd residual = system.mass * acceleration + system.damping * now.velocity +
                              system.stiffness * now.position - force(t);
    const double size = system.mass.norm() * acceleration.norm() +
                        system.damping.norm() * now.velocity.norm() +
                        system.stiffness.norm() * now.position.norm() + force(t).norm();
    worst = std::max(worst, residual.norm() / size);
  }
  return worst;
}

}  // namespace dashpot::testing
