#pragma once
#include <dashpot/analysis/system.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/law/null_space.hpp>
#include <dashpot/controller/vibration/spring_factors.hpp>

namespace dashpot::controller {

/// The closed loop of closed_loop.hpp in the form in which modes are followed from tick to tick:
/// M, C and a factor W of K = W' W with at most n rows that moves as smoothly as the robot does. K
/// itself is not formed, and nothing is squared.
///
/// W stacks the rows of the springs that are present:
///     F' J              K_C = F F' in the axes in which it is given, J turned into them,
///     G' (L Q)'         the null space: with M = L L', Q (n x r) spans the free motions in energy
///                       coordinates, G G' = Q' L^-1 K_0 L^-T Q,
///     H'                K_q = H H'.
/// If there are as many rows as joints, or more, they are replaced by the upper triangle with
/// W' W = K; exactly n rows of the tip's springs alone are not. Q is computed by projecting the Q
/// of the last tick. Where the arm is nearly singular or gains change between two sets of selected
/// directions, N has no such Q, and sqrt(K_0) N takes the place of the null space's rows.
class LoopSystem {
 public:
  /// Forgets the last tick.
  void reset() noexcept { dimension_ = 0; }

  /// Fills mass, damping and stiffness_factor of `system`. The factor has as many rows as there are
  /// modes. `null_space` is the robot's null space; it is used only if the impedance has null-space
  /// springs or dampers.
  void form(const DynamicsResult& robot, const Impedance& impedance, const NullSpace& null_space,
            const JointVector& viscous_friction, analysis::System<kMaxJoints>& system) noexcept;

 private:
  void add_tip_springs(const Jacobian& J, const TipImpedance& tip, const Eigen::Matrix3d* R,
                       SpringFactor& factor) noexcept;
  void add_null_space(const Impedance& impedance, const NullSpace& null_space,
                      JointMatrix& C) noexcept;
  bool add_free_motions(const Impedance& impedance, const NullSpace& null_space, int r,
                        JointMatrix& C) noexcept;
  bool follow_free_motions(const NullSpace& null_space, int r) noexcept;

  int n_ = 0;          ///< joints
  int dimension_ = 0;  ///< r of Q; 0: there is no Q
  std::array<JointVector, kMaxJoints> Q_;
  SpringFactor base_, tool_, joint_;
  FactorRows rows_;
};

/// Returns the number of selected directions, if each is selected wholly or not at all, and all in
/// one frame; otherwise -1.
int selected_directions(const TipImpedance& base, const TipImpedance& tool) noexcept;

}  // namespace dashpot::controller
