#pragma once
// For those who use KDL beside Dashpot. Apart from robot_model.hpp, because KDL's headers are heavy.

#include <dashpot/controller/robot_model.hpp>

#include <kdl/chain.hpp>

namespace dashpot::controller {

/// The chain from B to T: a segment for each joint, whose tip is the URDF's link with all that is
/// rigidly fixed to it, and one more, without a joint and massless, that ends in T. Reflected
/// inertias are KDL's joint inertias. Lives as long as the model or a copy of it.
const KDL::Chain& kdl_chain(const RobotModel& model) noexcept;

}  // namespace dashpot::controller
