#pragma once
// KDL's own solvers behind plain arrays. They live in a library of their own, compiled as KDL is:
// their types hold Eigen matrices whose alignment would differ in Dashpot's code.

#include <kdl/chain.hpp>

#include <memory>
#include <vector>

namespace dashpot::testing {

/// Matrices are in column order.
struct KdlTerms {
  std::vector<double> M, coriolis, gravity, J;  ///< n x n, n, n, 6 x n
  double Jdot_qd[6];
  double position[3];
  double rotation[9];
};

class KdlSolvers {
 public:
  /// `gravity`: 3 entries, axes of the chain's root.
  KdlSolvers(const KDL::Chain& chain, const double* gravity);
  ~KdlSolvers();

  /// n entries each. Throws std::runtime_error if a solver reports an error.
  void solve(const double* q, const double* qd);
  KdlTerms terms() const;

 private:
  struct Solvers;
  std::unique_ptr<Solvers> solvers_;
};

}  // namespace dashpot::testing
