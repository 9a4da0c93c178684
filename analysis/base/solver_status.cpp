#include <dashpot/analysis/solver_status.hpp>

namespace dashpot::analysis {

const char* to_text(Status status) noexcept {
  switch (status) {
    case Status::kOk:
      return "ok";
    case Status::kNotFinite:
      return "an entry is not a finite number";
    case Status::kNotSymmetric:
      return "the mass matrix is not symmetric";
    case Status::kMassNotPositiveDefinite:
      return "the mass matrix is not positive definite";
    case Status::kStiffnessIndefinite:
      return "the stiffness matrix is not positive semidefinite";
    case Status::kWrongSize:
      return "a matrix has a shape that does not fit the others";
    case Status::kNotConverged:
      return "the eigenvalue iteration did not converge";
    case Status::kOverflow:
      return "the entries are too large or too small to compute with";
    case Status::kUncertified:
      return "no error bound could be proved for some of the modes";
    case Status::kUnfinished:
      return "too much work for one tick: it goes on in the background";
  }
  return "unknown status";
}

}  // namespace dashpot::analysis
