#pragma once
#include <dashpot/controller/plugin.h>
#include <dashpot/apps/scene.hpp>
#include <dashpot/controller/types.hpp>

#include <memory>
#include <string>

namespace dashpot::apps {

/// What stands between a measurement and a torque, in the terms of plugin.h. But for the
/// constructors nothing allocates, throws or waits.
class LoopController {
 public:
  LoopController() = default;
  LoopController(const LoopController&) = delete;
  LoopController& operator=(const LoopController&) = delete;
  virtual ~LoopController() = default;

  /// A tick: the torque for this measurement, and a status. `time` in ns; n entries each.
  virtual std::int32_t update(std::int64_t time, const JointVector& q, const JointVector& qd,
                              JointVector& torque) noexcept = 0;
  /// Of the last tick.
  virtual const dashpot_snapshot& snapshot() noexcept = 0;
  /// Those that are newer than what was returned last; null if there are none.
  virtual const dashpot_modes* new_modes() noexcept = 0;
  /// Likewise of the sampled loop.
  virtual const dashpot_sampled_modes* new_sampled_modes() noexcept { return nullptr; }
  /// What to hold from the next tick on. Returns DASHPOT_OK, or the code of a refusal.
  virtual std::int32_t hold(const controller::Setpoint& setpoint) noexcept = 0;
  /// The next tick releases a latched fault.
  virtual std::int32_t release() noexcept { return DASHPOT_OK; }
  /// On any thread: whether the gains of a set-point would be taken at a joint position (n, rad;
  /// null: where the robot is). Returns DASHPOT_OK, or a code and the `reason`. Takes milliseconds
  /// and allocates.
  virtual std::int32_t judge(const controller::Setpoint& /*setpoint*/, std::string& /*reason*/,
                             const JointVector* /*position*/ = nullptr) {
    return DASHPOT_OK;
  }
};

/// The controller plugin, loaded at run time as any host would.
class PluginLibrary {
 public:
  /// Empty: libdashpot_plugin.so beside the program, where it is installed, or where the system
  /// looks for libraries. Throws InputError.
  explicit PluginLibrary(const std::string& path);

  /// A controller for the file. Throws InputError with the plugin's own words.
  std::unique_ptr<LoopController> create(const std::string& config_path, int joints) const;
  const dashpot_plugin& functions() const noexcept { return *functions_; }

 private:
  const dashpot_plugin* functions_ = nullptr;  // for the rest of the program
};

/// Nobody controls the masses of a system: zero torque, and the modes that its matrices have.
std::unique_ptr<LoopController> make_spectator(const MatrixSystem& system, double period);

}  // namespace dashpot::apps
