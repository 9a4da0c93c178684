#pragma once
// For users of KDL. It is not in robot_model.hpp, because KDL's headers take long to compile.

#include <dashpot/controller/robot_model.hpp>

#include <kdl/chain.hpp>

namespace dashpot::controller {

/// Careful with KDL's solvers: JntArray, Jacobian and others contain Eigen matrices in the
/// alignment that KDL was compiled with, 16 bytes on Debian. Dashpot asks for 64 (docs/decisions),
/// so code that hands these types over belongs in a shared library that is compiled without
/// Dashpot's definitions, as tests/support/kdl_solvers.hpp is. A KDL::Chain and KDL's frames
/// contain no Eigen matrices.

/// Returns the chain from B to T. It has a segment for each joint, whose tip is the URDF's link
/// (by which it is called) with all links that are rigidly fixed to it, and one more segment,
/// without a joint and massless, that ends in T. Reflected inertias are KDL's joint inertias. The
/// chain lives as long as the model or a copy of the model.
const KDL::Chain& kdl_chain(const RobotModel& model) noexcept;

}  // namespace dashpot::controller
