// The damping matrix that gives every mode of a task the damping ratio 0.7.
#include <cmath>
#include <cstdio>
#include <dashpot/analysis/damping_design.hpp>

using namespace dashpot::analysis;

int main() {
  TaskImpedance impedance;
  // The arm of task_space.cpp, its first link along x, the second at 60 degrees to it.
  impedance.mass = Eigen::Matrix2d{{2, 0.5}, {0.5, 1}};                   // kg m^2
  impedance.jacobian = Eigen::Matrix2d{{0, -std::sqrt(0.75)}, {1, 0.5}};  // m/rad
  impedance.task_stiffness = Eigen::Matrix2d{{400, 0}, {0, 400}};         // N/m
  const DampingDesign design = design_damping(impedance, DampingTarget::constant(0.7));
  for (const auto row : design.damping.rowwise()) {
    std::printf("%8.3f %8.3f N s/m\n", row[0], row[1]);
  }
  for (const Mode<>& mode : design.spectrum.modes) {
    std::printf("%.3f rad/s, damping ratio %.4f\n", mode.natural_frequency, mode.damping_ratio);
  }
  return design.misses.empty() ? 0 : 1;
}
