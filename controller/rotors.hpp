#pragma once
#include <dashpot/analysis/system.hpp>
#include <dashpot/controller/drives.hpp>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::controller {

/// The joints of a model whose reflected inertia is unknown. Rotors behind gears often resist a
/// wrist ten times as much as its links do. Without them fast modes and the gain margin are wrong
/// by as much, while the slow modes hardly change.
struct UnknownRotors {
  std::vector<int> joints;            ///< from 0, in order
  const Drives* published = nullptr;  ///< public figures of an arm of this kind; null: none

  bool any() const noexcept { return !joints.empty(); }
};

/// Returns the joints without reflected inertia. If links and rotors of a direct drive are one
/// body, any small reflected inertia marks it as known.
UnknownRotors unknown_rotors(const RobotModel& model);

/// Returns the reflected inertia (n, kg m^2) of the joints where it is unknown, zero where none is
/// needed, with which `keeps` is true of the model: the least inertia that gives every joint the
/// same share of period * damping + period^2 * stiffness. `loop` is the closed loop of the model as
/// it is, in joint coordinates. Empty if no inertia is enough, or all of it is known. Calls `keeps`
/// some twenty times; an exception counts as false.
std::optional<JointVector> enough_reflected_inertia(
    const RobotModel& model, const analysis::System<>& loop, double period,
    const std::function<bool(const RobotModel&)>& keeps);

/// Returns the model with the larger of its reflected inertia and `inertia`, joint by joint.
RobotModel with_at_least(const RobotModel& model, const JointVector& inertia);

/// Returns "the model has no reflected inertia of joint5, joint6, joint7"; "of any joint" if it has
/// none at all. Empty if there is no such joint.
std::string missing_rotors_text(const RobotModel& model);

/// Returns the unit of a figure of the joints: `turns` of revolute ones, `slides` of prismatic
/// ones, "N m (N)" of both.
std::string unit_text(const RobotModel& model, const std::string& turns, const std::string& slides);

/// Returns "joint5 0.02, joint6 0.012 kg m^2", without zeros, each rounded up to two digits.
std::string inertia_text(const RobotModel& model, const JointVector& inertia);

/// Returns "an arm without rotors", or "... in these joints" if others have them.
std::string arm_without_rotors(const RobotModel& model);

/// Returns the doubt about the published drives `name`, and which others the arm looks like, if it
/// does. Empty if there is no name.
std::string drives_text(const RobotModel& model, const std::string& name);

/// Returns in a sentence the viscous friction of the joints, which counts as damping beside the
/// gains; empty if there is none.
std::string friction_text(const RobotModel& model);

/// Returns in two sentences where reflected inertia is found, and the public figures of an arm of
/// this kind, or of all with as many joints. The options are those that the caller takes:
/// "--reflected-inertia", "--drives".
std::string rotors_hint(const RobotModel& model, const std::string& inertia_option,
                        const std::string& drives_option, const std::string& between = " ");

}  // namespace dashpot::controller
