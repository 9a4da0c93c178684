// Compiled against the installation, for the plainest processor: what the library was compiled for
// must not show in the layout of its types.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/identification/identification.hpp>

#include <cmath>
#include <cstdio>

using dashpot::analysis::analyze;
using dashpot::analysis::kMaxDof;
using dashpot::analysis::Mode;
using dashpot::analysis::Spectrum;
using dashpot::analysis::SpectrumSolver;
using dashpot::analysis::Square;
using dashpot::analysis::Status;
using dashpot::analysis::System;

/// A pendulum of 2 kg, 0.5 m long, held out level; its dynamics from the library's kernel.
bool model_works() {
  using dashpot::controller::DynamicsKernel;
  const auto model = dashpot::controller::RobotModel::from_urdf_text(
      "<robot name='pendulum'><link name='wall'/><link name='arm'><inertial>"
      "<origin xyz='0.5 0 0'/><mass value='2'/><inertia ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' "
      "izz='0'/></inertial></link><joint name='pivot' type='continuous'><parent link='wall'/>"
      "<child link='arm'/><axis xyz='0 1 0'/></joint></robot>",
      "wall", "arm");
  const DynamicsKernel kernel(model);
  const dashpot::controller::JointVector zero = dashpot::controller::JointVector::Zero(1);
  dashpot::controller::DynamicsResult result;
  kernel.evaluate(zero, zero, result);
  std::printf("consumer: %.4f kg m^2, %.4f N m\n", result.M(0, 0), result.gravity[0]);
  return std::abs(result.M(0, 0) - 0.5) < 1e-14 && std::abs(result.gravity[0] + 9.81) < 1e-13 &&
         dashpot::controller::kdl_chain(model).getNrOfJoints() == 1;
}

/// The mode of a decay at 10 rad/s with ratio 0.1.
bool identification_works() {
  dashpot::identification::MotionRecord record{Eigen::VectorXd(500), Eigen::MatrixXd(1, 500)};
  for (int i = 0; i < 500; ++i) {
    record.time[i] = 0.01 * i;
    record.output(0, i) = std::exp(-record.time[i]) * std::cos(std::sqrt(99.0) * record.time[i]);
  }
  const auto found = dashpot::identification::identify_decays({record});
  return found.modes.size() == 1 && std::abs(found.modes[0].natural_frequency - 10) < 1e-9 &&
         std::abs(found.modes[0].damping_ratio - 0.1) < 1e-10;
}

static_assert(EIGEN_DEFAULT_ALIGN_BYTES == 64, "alignment of what Eigen allocates");
static_assert(EIGEN_MAX_STATIC_ALIGN_BYTES == 64, "alignment of Eigen members");
static_assert(alignof(Square<8>) == 64);

int main() {
  if (!model_works() || !identification_works()) return 1;
  // Two masses of 1 kg on springs of 100 N/m and 50 N/m, lightly damped.
  System<> system(2);
  system.stiffness << 150, -50, -50, 50;
  system.damping << 1.5, -0.5, -0.5, 0.5;
  const Spectrum<> spectrum = analyze(system);
  for (const Mode<>& mode : spectrum.modes) {
    std::printf("consumer: %.4f rad/s, damping ratio %.4f\n", mode.natural_frequency,
                mode.damping_ratio);
  }
  // Fixed storage gives the same, across the library's boundary.
  System<kMaxDof> fixed(2);
  fixed.stiffness = system.stiffness;
  fixed.damping = system.damping;
  static SpectrumSolver<kMaxDof> solver;
  static Spectrum<kMaxDof> same;
  if (solver.solve(fixed, same) != Status::kOk || same.modes.size() != 2) return 1;
  const double difference = same.modes[1].natural_frequency - spectrum.modes[1].natural_frequency;
  return std::abs(difference) < 1e-12 ? 0 : 1;
}
