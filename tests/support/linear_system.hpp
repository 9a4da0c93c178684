#pragma once

#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/sim/plant.hpp>
#include <dashpot/sim/schedule.hpp>
#include <dashpot/sim/simulated_system.hpp>

#include <Eigen/Cholesky>
#include <limits>
#include <vector>

namespace dashpot::testing {

/// Masses on springs and dampers: M qdd + C qd + K q = tau + f(t).
class LinearSystem : public sim::System {
 public:
  LinearSystem(const Eigen::MatrixXd& mass, const Eigen::MatrixXd& damping,
               const Eigen::MatrixXd& stiffness,
               const std::vector<sim::Piece<sim::JointVector>>& forces = {})
      : System(static_cast<int>(mass.rows())),
        M_(mass),
        M_inv_(mass.llt().solve(Eigen::MatrixXd::Identity(dof(), dof()))),
        C_(damping),
        K_(stiffness),
        forces_(forces, sim::JointVector::Zero(dof())),
        force_(sim::JointVector::Zero(dof())) {}

  double begin_segment(double t) noexcept override {
    if (forces_.empty()) return std::numeric_limits<double>::infinity();
    force_ = forces_.at(t);
    return forces_.next_edge(t);
  }

  void rates(const sim::StateVector& y, sim::StateVector& y_dot) noexcept override {
    const Eigen::Index n = dof();
    const auto q = y.head(n);
    const auto qd = y.segment(n, n);
    const sim::JointVector damping = C_.lazyProduct(qd);
    sim::JointVector rest = torque() - damping + force_;
    rest -= K_.lazyProduct(q);
    auto work = y_dot.tail<sim::kWorkChannels>();
    work.setZero();
    work[sim::kByActuators] = torque().dot(qd);
    work[sim::kViscousHeat] = damping.dot(qd);
    work[sim::kByWorld] = force_.dot(qd);
    y_dot.head(n) = qd;
    y_dot.segment(n, n) = M_inv_.lazyProduct(rest);
  }

  sim::StoredEnergy stored_energy(const sim::StateVector& y) noexcept override {
    const Eigen::Index n = dof();
    const sim::JointVector q = y.head(n), qd = y.segment(n, n);
    return {0.5 * qd.dot(M_.lazyProduct(qd)), 0, 0.5 * q.dot(K_.lazyProduct(q))};
  }

 private:
  sim::JointMatrix M_, M_inv_, C_, K_;
  sim::Schedule<sim::JointVector> forces_;
  sim::JointVector force_;
};

/// A simulated robot behind the drives that the analysis of a sampled loop supposes, with one step
/// of the integrator in a period.
inline sim::PlantOptions plant_options(const analysis::SampledLoop& loop) {
  sim::PlantOptions options;
  options.period = loop.period;
  options.integrator.max_step = loop.period;
  options.delay = loop.delay;
  options.torque_cutoff = loop.torque_cutoff;
  options.difference_velocity = loop.difference_velocity;
  return options;
}

}  // namespace dashpot::testing
