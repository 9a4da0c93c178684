#pragma once
#include <dashpot/apps/loop/loop_controller.hpp>
#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/latest.hpp>
#include <dashpot/controller/robot_types.hpp>
#include <dashpot/controller/settings.hpp>

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>

namespace dashpot::apps {

extern const char* const kExciteHelp;  ///< what --excite takes

/// A wrench at the tip that makes an arm vibrate a little, so that its modes can be identified.
struct Excitation {
  bool chirp = false;
  int direction = 0;     ///< of the wrench, in the axes of the base: 0 to 5
  double amplitude = 0;  ///< N or N m
  double at = 1;         ///< when it begins, s
  double duration = 0;   ///< of a pulse or of the chirp, s
  double every = 0;      ///< from pulse to pulse, s
  int count = 1;         ///< of pulses
  double from = 0;       ///< frequency at the chirp's beginning, Hz
  double to = 0;         ///< frequency at its end, Hz

  /// Returns the wrench at `time`, s.
  controller::Vector6 wrench(double time) const noexcept;
};

/// Reads "pulse,direction=z,force=5,duration=0.5". Throws controller::InputError with the option as
/// key if it is not as kExciteHelp says, or if the controller would suppress it.
Excitation read_excitation(const std::string& text, const controller::Settings& settings);

/// The goal of a loop: the set-point, which is repeated so that it does not go stale, the active
/// gains, and what is attached to the tip link. Shared by the loop's thread and the threads that
/// command it. With a new T the goal of the tip link stays the same.
class LoopGoal {
 public:
  /// The controller must outlive it. The set-point is repeated every `repeat_every` ticks.
  LoopGoal(LoopController& controller, std::int64_t repeat_every)
      : controller_(controller), repeat_every_(repeat_every) {}

  // Before the loop begins:
  /// Holds `setpoint`, with its gains, which the controller has already, and with what is attached
  /// to the tip link.
  void begin(const controller::Setpoint& setpoint, const controller::Attachment& attachment);

  /// Adds this wrench to the set-point's. Its time begins with the next tick; a fault ends it for
  /// good.
  void excite(const Excitation& excitation) noexcept { excitation_ = excitation; }

  // The loop's thread:
  /// Before a tick at `time`, ns: the set-point for the controller; null as long as no tick is
  /// known to have taken up a new T.
  const controller::Setpoint* told(std::int64_t time) noexcept;
  /// After that tick.
  void note_status(std::int32_t status) noexcept;
  /// Holds `setpoint`, with a pose of tool(), from the next tick on. Its gains do not count.
  void hold(const controller::Setpoint& setpoint) noexcept;
  /// Stops the arm for good: the controller gets no further set-point.
  void stop() noexcept {
    if (!stopped_) controller_.stop();
    stopped_ = true;
  }
  /// The last set-point for the controller.
  const controller::Setpoint& setpoint() const noexcept { return setpoint_; }
  /// T in the tip link, of the pose in setpoint().
  const controller::Pose& tool() const noexcept { return tool_; }
  /// After a tick: whether a fault is latched, during which nothing is held. After release() the
  /// robot is held where it is until a new set-point comes; if the controller has released the
  /// fault by itself, the previous set-point is held again.
  void note_fault(bool latched) noexcept;

  // Other threads, which may have to wait for each other. Before begin() changes are refused
  // (DASHPOT_NOTHING_YET) and releases do nothing, because the controller is being started:
  /// Changes by a command or a scenario beside the set-point; empty parts stay as they are.
  struct Change {
    std::function<void(controller::Gains&)> gains;
    std::optional<controller::Payload> payload;
    std::optional<controller::Pose> tool;  ///< T in the tip link
    std::optional<controller::TipSpeed> tip_speed;
  };
  /// Makes all of a change, or nothing if the controller refuses its result: DASHPOT_OK, or the
  /// code of the refusal, with its reason in one line. Warnings of the controller go to stderr.
  std::int32_t change(const Change& change, std::string& reason);
  /// The last T in the tip link for the controller; the loop may not have taken it up yet.
  controller::Pose latest_tool();
  /// Releases a latched fault at the next tick.
  void release();

 private:
  /// Converts the set-points to a new T. False as long as it is unknown which T the controller uses
  /// in the next tick.
  bool follow_tool() noexcept;
  /// Gives the controller the payload, the tool and, unless null, the gains.
  std::int32_t attach(const Change& change, const controller::Gains* gains, std::string& said);

  LoopController& controller_;
  std::int64_t repeat_every_;

  // The loop's own:
  controller::Setpoint setpoint_;
  controller::Setpoint excited_;  ///< setpoint_ with the wrench of excitation_
  std::optional<Excitation> excitation_;
  std::optional<std::int64_t> excited_since_;  ///< ns
  controller::Setpoint accepted_;              ///< the last that the controller did not reject
  bool stopped_ = false;
  bool in_force_ = false;  ///< setpoint_ is active
  bool news_ = true;       ///< setpoint_ is to be read again
  bool told_ = false;      ///< the controller got it in this tick
  bool faulted_ = false;   ///< a fault was latched after the last tick
  std::int64_t ticks_ = 0;
  std::int64_t gain_changes_seen_ = 0;
  controller::Pose tool_;  ///< T in the tip link, of the poses above
  std::int64_t tool_changes_seen_ = 0;

  // Between the threads:
  std::atomic<std::int64_t> gain_changes_{0};  ///< so far
  std::atomic<bool> released_{false};          ///< the release of the fault was asked for
  std::atomic<std::int64_t> tool_changes_{0};  ///< twice those so far; odd: one is under way
  controller::Latest<controller::Pose> tools_;

  std::mutex mutex_;  ///< of what follows, and of the controller's functions for other threads
  bool begun_ = false;
  controller::Gains gains_;
  controller::Payload payload_;
  controller::Pose latest_tool_;
  controller::TipSpeed tip_speed_;
};

}  // namespace dashpot::apps
