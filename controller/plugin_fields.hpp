#pragma once
// Maps the fields of the C structs of plugin.h to the fields of the C++ ones, for both directions.

#include <dashpot/controller/plugin.h>
#include <dashpot/controller/snapshot.hpp>

#include <type_traits>

namespace dashpot::controller {

/// Calls copy(field of `of`, field of `c`) for each field that both have; either may be const.
template <class S, class C, class Copy>
void copy_fields(S& of, C& c, const Copy& copy) noexcept {
  using Struct = std::remove_const_t<S>;
  if constexpr (std::is_same_v<Struct, Snapshot>) {
    copy(of.time, c.time);
    copy(of.tick, c.tick);
    copy(of.restarts, c.restarts);
    copy(of.status, c.status);
    copy(of.fault, c.fault);
    copy(of.mode, c.mode);
    copy(of.position, c.position);
    copy(of.velocity, c.velocity);
    copy(of.torque, c.torque);
    copy(of.law_torque, c.law_torque);
    copy(of.reference_position, c.reference_joint_position);
    copy(of.tip.position, c.tip_position);
    copy(of.tip.rotation, c.tip_rotation);
    copy(of.reference_tip.position, c.reference_tip_position);
    copy(of.reference_tip.rotation, c.reference_tip_rotation);
    copy(of.tip_error, c.tip_error);
    copy(of.tip_wrench, c.tip_wrench);
    copy(of.joint_damping_ratio, c.joint_damping_ratio);
    copy(of.task_damping_ratio, c.task_damping_ratio);
    copy(of.damping_level, c.damping_level);
    copy(of.energy_store, c.energy_store);
    copy(of.spring_share, c.spring_share);
    copy(of.payload.mass, c.payload_mass);
    copy(of.payload.center, c.payload_center);
    copy(of.payload.inertia, c.payload_inertia);
    copy(of.tool.position, c.tool_position);
    copy(of.tool.rotation, c.tool_rotation);
  } else if constexpr (std::is_same_v<Struct, VibrationMode>) {
    copy(of.natural_frequency, c.natural_frequency);
    copy(of.natural_frequency_bound, c.natural_frequency_bound);
    copy(of.damping_ratio, c.damping_ratio);
    copy(of.damping_ratio_bound, c.damping_ratio_bound);
    copy(of.damped_frequency, c.damped_frequency);
    copy(of.error_bound, c.eigenvalue_bound);
    copy(of.kind, c.kind);
    copy(of.label, c.label);
  } else if constexpr (std::is_same_v<Struct, VibrationCounters>) {
    copy(of.tracked, c.tracked);
    copy(of.reused, c.reused);
    copy(of.direct, c.direct);
    copy(of.unchanged, c.unchanged);
    copy(of.no_springs, c.no_springs);
    copy(of.failed, c.failed);
    copy(of.missed, c.missed);
    copy(of.no_zero_modes, c.no_zero_modes);
    copy(of.no_wrench, c.no_wrench);
    copy(of.no_shapes, c.no_shapes);
    copy(of.at_rest, c.at_rest);
  } else {
    copy(of.time, c.time);
    copy(of.tick, c.tick);
    copy(of.position, c.position);
    copy(of.status, c.status);
    copy(of.count, c.count);
    if constexpr (std::is_same_v<Struct, Vibration>) {
      copy(of.zero_modes, c.zero_modes);
      copy(of.origin, c.origin);
      copy_fields(of.counters, c, copy);
    } else {
      static_assert(std::is_same_v<Struct, SampledVibration>);
      copy(of.spectral_radius, c.spectral_radius);
      copy(of.gain_margin, c.gain_margin);
      copy(of.assumes, c.assumes);
    }
    for (int i = 0; i < of.count; ++i) {
      auto& mode = of.modes[static_cast<std::size_t>(i)];
      auto& c_mode = c.modes[i];
      if constexpr (std::is_same_v<Struct, Vibration>) {
        copy_fields(mode, c_mode, copy);
        copy.shape(mode, c_mode);
      } else {
        copy(mode.kind, c_mode.kind);
        copy(mode.continuous_frequency, c_mode.continuous_frequency);
        copy(mode.continuous_ratio, c_mode.continuous_ratio);
        copy(mode.natural_frequency, c_mode.natural_frequency);
        copy(mode.damping_ratio, c_mode.damping_ratio);
        copy(mode.damped_frequency, c_mode.damped_frequency);
      }
    }
  }
}

}  // namespace dashpot::controller
