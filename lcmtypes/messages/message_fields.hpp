#pragma once
#include <dashpot/lcmtypes/command_t.hpp>
#include <dashpot/lcmtypes/contact_t.hpp>
#include <dashpot/lcmtypes/modes_t.hpp>
#include <dashpot/lcmtypes/sampled_modes_t.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <type_traits>

namespace dashpot::lcmtypes {

/// Calls visit(name, &Message::field) for each field of a message, in the order of its definition.
template <class Message, class Visit>
void visit_fields(const Visit& visit) {
  using M = Message;
  if constexpr (std::is_same_v<M, state_t>) {
    visit("n", &M::n);
    visit("utime", &M::utime);
    visit("tick", &M::tick);
    visit("restarts", &M::restarts);
    visit("mode", &M::mode);
    visit("status", &M::status);
    visit("fault", &M::fault);
    visit("fault_tick", &M::fault_tick);
    visit("joint_position", &M::joint_position);
    visit("joint_velocity", &M::joint_velocity);
    visit("joint_torque", &M::joint_torque);
    visit("law_torque", &M::law_torque);
    visit("reference_joint_position", &M::reference_joint_position);
    visit("tip_position", &M::tip_position);
    visit("tip_quaternion", &M::tip_quaternion);
    visit("reference_tip_position", &M::reference_tip_position);
    visit("reference_tip_quaternion", &M::reference_tip_quaternion);
    visit("tip_error", &M::tip_error);
    visit("tip_wrench", &M::tip_wrench);
    visit("joint_damping_ratio", &M::joint_damping_ratio);
    visit("task_damping_ratio", &M::task_damping_ratio);
    visit("damping_level", &M::damping_level);
    visit("payload_mass", &M::payload_mass);
    visit("payload_center", &M::payload_center);
    visit("tool_position", &M::tool_position);
    visit("tool_quaternion", &M::tool_quaternion);
    visit("tick_time", &M::tick_time);
    visit("longest_tick_time", &M::longest_tick_time);
    visit("overruns", &M::overruns);
    visit("states_dropped", &M::states_dropped);
    visit("verdicts", &M::verdicts);
    visit("last_refusal", &M::last_refusal);
    visit("last_refusal_utime", &M::last_refusal_utime);
    visit("last_refused_sender", &M::last_refused_sender);
    visit("commander", &M::commander);
    visit("commands_accepted", &M::commands_accepted);
    visit("commands_rejected", &M::commands_rejected);
  } else if constexpr (std::is_same_v<M, contact_t>) {
    visit("utime", &M::utime);
    visit("tick", &M::tick);
    visit("force", &M::force);
  } else if constexpr (std::is_same_v<M, modes_t>) {
    visit("n", &M::n);
    visit("num_modes", &M::num_modes);
    visit("utime", &M::utime);
    visit("tick", &M::tick);
    visit("sequence", &M::sequence);
    visit("origin", &M::origin);
    visit("status", &M::status);
    visit("joint_position", &M::joint_position);
    visit("zero_modes", &M::zero_modes);
    visit("label", &M::label);
    visit("eigenvalue_real", &M::eigenvalue_real);
    visit("eigenvalue_imag", &M::eigenvalue_imag);
    visit("natural_frequency", &M::natural_frequency);
    visit("damping_ratio", &M::damping_ratio);
    visit("damped_frequency", &M::damped_frequency);
    visit("kind", &M::kind);
    visit("eigenvalue_bound", &M::eigenvalue_bound);
    visit("natural_frequency_bound", &M::natural_frequency_bound);
    visit("damping_ratio_bound", &M::damping_ratio_bound);
    visit("shape_real", &M::shape_real);
    visit("shape_imag", &M::shape_imag);
  } else if constexpr (std::is_same_v<M, sampled_modes_t>) {
    visit("n", &M::n);
    visit("num_modes", &M::num_modes);
    visit("utime", &M::utime);
    visit("tick", &M::tick);
    visit("sequence", &M::sequence);
    visit("status", &M::status);
    visit("joint_position", &M::joint_position);
    visit("spectral_radius", &M::spectral_radius);
    visit("gain_margin", &M::gain_margin);
    visit("assumes", &M::assumes);
    visit("continuous_frequency", &M::continuous_frequency);
    visit("continuous_ratio", &M::continuous_ratio);
    visit("natural_frequency", &M::natural_frequency);
    visit("damping_ratio", &M::damping_ratio);
    visit("damped_frequency", &M::damped_frequency);
    visit("kind", &M::kind);
  } else {
    static_assert(std::is_same_v<M, command_t>);
    visit("n", &M::n);
    visit("sender", &M::sender);
    visit("utime", &M::utime);
    visit("sequence", &M::sequence);
    visit("parts", &M::parts);
    visit("mode", &M::mode);
    visit("joint_position", &M::joint_position);
    visit("tip_position", &M::tip_position);
    visit("tip_quaternion", &M::tip_quaternion);
    visit("wrench", &M::wrench);
    visit("joint_stiffness", &M::joint_stiffness);
    visit("joint_damping", &M::joint_damping);
    visit("frame", &M::frame);
    visit("directions", &M::directions);
    visit("task_stiffness", &M::task_stiffness);
    visit("task_damping", &M::task_damping);
    visit("null_stiffness", &M::null_stiffness);
    visit("null_damping", &M::null_damping);
    visit("task_damping_ratio", &M::task_damping_ratio);
    visit("joint_damping_ratio", &M::joint_damping_ratio);
    visit("payload_mass", &M::payload_mass);
    visit("payload_center", &M::payload_center);
    visit("payload_inertia", &M::payload_inertia);
    visit("tool_position", &M::tool_position);
    visit("tool_quaternion", &M::tool_quaternion);
    visit("linear_velocity", &M::linear_velocity);
    visit("angular_velocity", &M::angular_velocity);
    visit("tip_velocity", &M::tip_velocity);
    visit("fault_tick", &M::fault_tick);
  }
}

}  // namespace dashpot::lcmtypes
