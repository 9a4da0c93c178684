#pragma once
#include <dashpot/apps/system_file.hpp>

#include <string>

namespace dashpot::apps {

/// An arm at one configuration, as the options of `dashpot design --urdf` give it; lists of numbers
/// between commas.
struct ArmOptions {
  std::string urdf, base, tip;
  std::string q;               ///< n; zeros if empty
  std::string task_stiffness;  ///< diagonal of K_C, 6: linear, then angular; N/m, N m/rad
  std::string task_damping;    ///< diagonal of C_C before, 6; none if empty
};

/// The arm with its springs, as a file would give it: mass, jacobian (6 x n, base-aligned axes at
/// the tip), task_stiffness, task_damping. Throws InputError.
SystemEntry read_arm(const ArmOptions& options);

}  // namespace dashpot::apps
