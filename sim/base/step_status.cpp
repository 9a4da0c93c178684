#include <dashpot/sim/step_status.hpp>

namespace dashpot::sim {

const char* to_text(Status status) noexcept {
  switch (status) {
    case Status::kOk:
      return "ok";
    case Status::kCommandWrongSize:
      return "the torque command has the wrong size";
    case Status::kCommandNotFinite:
      return "the torque command is not finite";
    case Status::kStateNotFinite:
      return "the motion is not finite";
    case Status::kNotConverged:
      return "the implicit step did not converge";
    case Status::kTooManySteps:
      return "the adaptive integrator needs too many steps";
  }
  return "unknown status";
}

}  // namespace dashpot::sim
