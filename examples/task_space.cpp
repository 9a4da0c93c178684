// A two-joint arm, stretched out along x and held at its tip by a spring in the y direction: a
// mode, and a motion of the joints that leaves the spring alone.
#include <cstdio>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/task_space.hpp>

using namespace dashpot::analysis;

int main() {
  TaskImpedance impedance;
  // Links of 1 m without mass, 1 kg at the elbow and at the tip; angles of the links to x, rad.
  impedance.mass = Eigen::Matrix2d{{2, 1}, {1, 1}};     // kg m^2
  impedance.jacobian = Eigen::MatrixXd{{1.0, 1.0}};     // tip along y, m/rad
  impedance.task_stiffness = Eigen::MatrixXd{{400.0}};  // N/m
  impedance.task_damping = Eigen::MatrixXd{{8.0}};      // N s/m
  const Spectrum<> spectrum = analyze(to_joint_space(impedance));
  for (const Mode<>& mode : spectrum.modes) {
    std::printf("%.3f rad/s, damping ratio %.3f\n", mode.natural_frequency, mode.damping_ratio);
  }
  const Eigen::VectorXd free = spectrum.zero_modes.basis.col(0);
  std::printf("free: the second link turns by %.3f rad for each rad of the first\n",
              free[1] / free[0]);
}
