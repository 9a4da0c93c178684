#pragma once
// DynamicsResult by KDL's solvers.

#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/tests/support/kdl_solvers.hpp>

namespace dashpot::testing {

class KdlDynamics {
 public:
  explicit KdlDynamics(const controller::RobotModel& model)
      : n_(model.dof()), solvers_(controller::kdl_chain(model), model.gravity().data()) {}

  /// What a benchmark times.
  void solve(const controller::JointVector& q, const controller::JointVector& qd) {
    solvers_.solve(q.data(), qd.data());
  }

  controller::DynamicsResult result() const {
    const KdlTerms terms = solvers_.terms();
    const auto matrix = [](const auto& values, int rows, int cols) {
      return Eigen::Map<const Eigen::MatrixXd>(&values[0], rows, cols);
    };
    controller::DynamicsResult result;
    result.M = matrix(terms.M, n_, n_);
    result.coriolis = matrix(terms.coriolis, n_, 1);
    result.gravity = matrix(terms.gravity, n_, 1);
    result.J = matrix(terms.J, 6, n_);
    result.Jdot_qd = matrix(terms.Jdot_qd, 6, 1);
    result.p_BT_B = matrix(terms.position, 3, 1);
    result.R_BT = matrix(terms.rotation, 3, 3);
    return result;
  }

 private:
  int n_;
  KdlSolvers solvers_;
};

/// The terms at one state.
inline controller::DynamicsResult by_kdl(const controller::RobotModel& model,
                                         const controller::JointVector& q,
                                         const controller::JointVector& qd) {
  KdlDynamics kdl(model);
  kdl.solve(q, qd);
  return kdl.result();
}

}  // namespace dashpot::testing
