#pragma once
// For those who use KDL beside Dashpot. Apart from robot_model.hpp, because KDL's headers are
// heavy.

#include <dashpot/controller/robot_model.hpp>

#include <kdl/chain.hpp>

namespace dashpot::controller {

/// Careful with KDL's solvers: JntArray, Jacobian and others hold Eigen matrices in the alignment
/// that KDL was compiled with, 16 bytes on Debian. Dashpot asks for 64 (docs/decisions), so code
/// that hands these types over belongs in a shared library that is compiled without Dashpot's
/// definitions, as tests/support/kdl_solvers.hpp is. A KDL::Chain and KDL's frames hold none.

/// The chain from B to T: a segment for each joint, whose tip is the URDF's link with all that is
/// rigidly fixed to it, and one more, without a joint and massless, that ends in T. Reflected
/// inertias are KDL's joint inertias. Lives as long as the model or a copy of it.
const KDL::Chain& kdl_chain(const RobotModel& model) noexcept;

}  // namespace dashpot::controller
