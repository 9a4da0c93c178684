#include <dashpot/tests/support/kdl_solvers.hpp>

#include <kdl/chaindynparam.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainjnttojacdotsolver.hpp>
#include <kdl/chainjnttojacsolver.hpp>

#include <algorithm>
#include <stdexcept>

namespace dashpot::testing {

struct KdlSolvers::Solvers {
  Solvers(const KDL::Chain& source, const double* g)
      : chain(source),
        n(chain.getNrOfJoints()),
        parameters(chain, KDL::Vector(g[0], g[1], g[2])),
        jacobian(chain),
        jacobian_rate(chain),
        pose(chain),
        state(n),
        M(n),
        coriolis(n),
        gravity(n),
        J(n) {
    jacobian_rate.setRepresentation(KDL::ChainJntToJacDotSolver::HYBRID);
  }

  KDL::Chain chain;
  unsigned n;
  KDL::ChainDynParam parameters;
  KDL::ChainJntToJacSolver jacobian;
  KDL::ChainJntToJacDotSolver jacobian_rate;
  KDL::ChainFkSolverPos_recursive pose;
  KDL::JntArrayVel state;
  KDL::JntSpaceInertiaMatrix M;
  KDL::JntArray coriolis;
  KDL::JntArray gravity;
  KDL::Jacobian J;
  KDL::Twist Jdot_qd;
  KDL::Frame frame;
};

// Visible outside this library; Eigen's functions in it are not.
#define DASHPOT_VISIBLE __attribute__((visibility("default")))

DASHPOT_VISIBLE KdlSolvers::KdlSolvers(const KDL::Chain& chain, const double* gravity)
    : solvers_(std::make_unique<Solvers>(chain, gravity)) {}

DASHPOT_VISIBLE KdlSolvers::~KdlSolvers() = default;

DASHPOT_VISIBLE void KdlSolvers::solve(const double* q, const double* qd) {
  Solvers& s = *solvers_;
  std::copy_n(q, s.n, s.state.q.data.data());
  std::copy_n(qd, s.n, s.state.qdot.data.data());
  int failures = 0;
  failures |= s.parameters.JntToMass(s.state.q, s.M);
  failures |= s.parameters.JntToCoriolis(s.state.q, s.state.qdot, s.coriolis);
  failures |= s.parameters.JntToGravity(s.state.q, s.gravity);
  failures |= s.jacobian.JntToJac(s.state.q, s.J);
  failures |= s.jacobian_rate.JntToJacDot(s.state, s.Jdot_qd);
  failures |= s.pose.JntToCart(s.state.q, s.frame);
  if (failures != 0) throw std::runtime_error("a KDL solver failed");
}

DASHPOT_VISIBLE KdlTerms KdlSolvers::terms() const {
  const Solvers& s = *solvers_;
  const auto list = [](const auto& matrix) {
    return std::vector<double>(matrix.data(), matrix.data() + matrix.size());
  };
  KdlTerms terms{
      list(s.M.data), list(s.coriolis.data), list(s.gravity.data), list(s.J.data), {}, {}, {}};
  for (int i = 0; i < 3; ++i) {
    terms.Jdot_qd[i] = s.Jdot_qd.vel(i);
    terms.Jdot_qd[3 + i] = s.Jdot_qd.rot(i);
    terms.position[i] = s.frame.p(i);
    for (int j = 0; j < 3; ++j) terms.rotation[i + 3 * j] = s.frame.M(i, j);
  }
  return terms;
}

}  // namespace dashpot::testing
