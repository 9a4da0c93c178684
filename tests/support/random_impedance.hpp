#pragma once
#include <dashpot/analysis/task_space.hpp>
#include <dashpot/tests/support/random.hpp>

namespace dashpot::testing {

/// n joints with stiffness and damping in m task directions only.
inline analysis::TaskImpedance random_impedance(Random& random, Eigen::Index n, Eigen::Index m) {
  analysis::TaskImpedance impedance;
  impedance.mass = random.spd(n);
  impedance.jacobian = random.matrix(m, n);
  impedance.task_stiffness = 1e3 * random.spd(m);
  impedance.task_damping = 10 * random.spd(m);
  return impedance;
}

}  // namespace dashpot::testing
