#include <dashpot/analysis/system.hpp>

#include <Eigen/Cholesky>

namespace dashpot::analysis {

namespace {

void check_optional_parts(const System<>& system) {
  const Eigen::Index n = system.dof();
  if (system.stiffness_factor.rows() > 0) {
    check_size("stiffness_factor", system.stiffness_factor, system.stiffness_factor.rows(), n);
    check_finite("stiffness_factor", system.stiffness_factor);
  }
  if (system.has_low_words) {
    check_size("damping_low", system.damping_low, n, n);
    check_size("stiffness_low", system.stiffness_low, n, n);
    check_finite("damping_low", system.damping_low);
    check_finite("stiffness_low", system.stiffness_low);
    check_low_word("damping_low", system.damping, system.damping_low);
    check_low_word("stiffness_low", system.stiffness, system.stiffness_low);
  }
  check_error("mass_error", system.mass_error, n);
  check_error("damping_error", system.damping_error, n);
  check_error("stiffness_error", system.stiffness_error, n);
}

}  // namespace

void validate(const System<>& system) {
  const Eigen::Index n = system.mass.rows();
  check_size("mass", system.mass, n, n);
  check_size("damping", system.damping, n, n);
  check_size("stiffness", system.stiffness, n, n);
  check_finite("mass", system.mass);
  check_finite("damping", system.damping);
  check_finite("stiffness", system.stiffness);
  check_optional_parts(system);

  check_symmetric("mass", system.mass);
  if (n > 0 && system.mass.llt().info() != Eigen::Success) {
    throw InvalidSystem("mass", "is not positive definite");
  }
}

}  // namespace dashpot::analysis
