#pragma once
#include <dashpot/sim/simulated_system.hpp>
#include <dashpot/sim/step_status.hpp>

#include <Eigen/LU>
#include <array>
#include <cstdint>

namespace dashpot::sim {

/// One-step methods: all restart cleanly where the torque jumps.
enum class Method : std::uint8_t {
  kSemiImplicitEuler,  ///< order 1, symplectic: qd += h qdd(q, qd), then q += h qd; 1 evaluation
  kRungeKutta4,        ///< order 4, 4 evaluations; stable on the axes for omega h < 2.8
  kDormandPrince8,     ///< order 8 with an error estimate of orders 5 and 3, 12 evaluations
  kImplicitMidpoint,   ///< order 2, symplectic, stable for any stiffness; 2n + 4 or so evaluations
  kRosenbrock,         ///< RODAS3: order 3 with an estimate of order 2, damps the stiffest motions
                       ///< (L-stable); 2n + 3 evaluations, nothing to iterate
};

struct IntegratorOptions {
  Method method = Method::kRungeKutta4;
  double max_step = 0.001;  ///< s; a segment is cut into equal steps no longer than this
  /// True: the step size follows from the error estimate of the method, which has to have one, up
  /// to max_step, and steps end where a contact begins or ends. False: contacts begin and end
  /// within a step, or with implicit methods at the end of a step.
  bool adaptive = false;
  double absolute_tolerance = 1e-10;  ///< of a step, adaptive: rad, rad/s (m, m/s)
  double relative_tolerance = 1e-8;
  int max_steps = 100000;  ///< in one segment, including rejected steps, adaptive
};

/// True if a method has an error estimate, which IntegratorOptions::adaptive needs.
bool estimates_error(Method method) noexcept;

/// Moves a system through a segment of time (system.hpp), without allocating.
class Integrator {
 public:
  /// Throws InvalidScene.
  explicit Integrator(const IntegratorOptions& options = {});

  /// Replaces y(t) by y(t + duration). Unless the status is kOk, y is left somewhere on the way.
  Status advance(System& system, double duration, StateVector& y) noexcept;

 private:
  using StepFunction = Status (Integrator::*)(System& system, double h) noexcept;
  Status semi_implicit_euler(System& system, double h) noexcept;
  Status runge_kutta_4(System& system, double h) noexcept;
  Status dormand_prince_8(System& system, double h) noexcept;
  Status implicit_midpoint(System& system, double h) noexcept;
  Status rosenbrock(System& system, double h) noexcept;

  Status advance_fixed(System& system, double duration, StateVector& y) noexcept;
  Status advance_adaptive(System& system, double duration, StateVector& y) noexcept;
  Status land_on_contact(System& system, ContactModes modes, double& h) noexcept;
  double error_norm() const noexcept;
  double weighted_size(const StateVector& x) const noexcept;
  double first_step(System& system) noexcept;

  /// Computes rates_[0], y' at y_, unless it is known.
  void begin_step(System& system) noexcept;
  /// Sets y_ to next_.
  void end_step() noexcept;

  /// Computes (d qdd, d work') / d (q, qd) at y_ by differences; rates_[0] is y' at y_.
  void differentiate(System& system) noexcept;
  /// Factors s 1 - J, J = dy'/dy.
  bool factor(double s) noexcept;
  /// Replaces x by (s 1 - J)^-1 x.
  void solve(double s, StateVector& x) const noexcept;

  using JacobianMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor,
                                       kMaxJoints + kWorkChannels, 2 * kMaxJoints>;

  IntegratorOptions options_;
  StepFunction step_;
  double exponent_ = 0;                   // of the error in the choice of the step, adaptive
  double next_step_ = 0;                  // s, adaptive; 0: none tried so far
  StateVector y_, next_, error_, stage_;  // a step goes from y_ to next_
  std::array<StateVector, 12> rates_;     // y' at the stages, the first at y_
  bool start_known_ = false;              // rates_[0] is y' at y_
  bool jacobian_known_ = false;           // jacobian_ belongs to y_
  JacobianMatrix jacobian_;
  JointMatrix reduced_;
  Eigen::PartialPivLU<JointMatrix> factors_;
};

}  // namespace dashpot::sim
