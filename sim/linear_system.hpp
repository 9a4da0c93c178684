#pragma once
#include <dashpot/sim/invalid_scene.hpp>
#include <dashpot/sim/schedule.hpp>
#include <dashpot/sim/simulated_system.hpp>

#include <vector>

namespace dashpot::sim {

/// Masses on springs and dampers: M qdd + C qd + K q = tau + f(t).
class LinearSystem : public System {
 public:
  /// Takes M symmetric positive definite (kg, kg m^2), C n x n (N s/m, ...), K symmetric (N/m,
  /// ...), and f as pieces of n entries. Throws InvalidScene.
  LinearSystem(const Eigen::MatrixXd& mass, const Eigen::MatrixXd& damping,
               const Eigen::MatrixXd& stiffness,
               const std::vector<Piece<JointVector>>& forces = {});

  double begin_segment(double t) noexcept override;
  void rates(const StateVector& y, StateVector& y_dot) noexcept override;
  StoredEnergy stored_energy(const StateVector& y) noexcept override;

 private:
  JointMatrix M_, M_inv_, C_, K_;
  Schedule<JointVector> forces_;
  JointVector force_;
};

}  // namespace dashpot::sim
