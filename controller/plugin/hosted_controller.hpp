#pragma once
#include <dashpot/controller/plugin.h>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/controller/latest.hpp>
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/controller/vibration/vibration.hpp>

#include <array>
#include <atomic>
#include <cstdint>
#include <mutex>
#include <vector>

namespace dashpot::controller {

/// Judges gains for all threads of a host, one after the other.
class Judgement {
 public:
  Judgement(const RobotModel& model, const Settings& settings)
      : joints_(model.dof()),
        wanted_(settings.limits.gain_margin),
        judge_(model, settings),
        attached_(model.attachment()) {}

  void locate(const JointVector& q) noexcept {
    for (int i = 0; i < joints_; ++i) {
      const auto at = static_cast<std::size_t>(i);
      position_[at].store(q[i], std::memory_order_relaxed);
    }
    located_.store(true, std::memory_order_release);
  }
  /// Sets `q` to the joints' positions in the last good state or two; false before the first one.
  bool where(JointVector& q) const noexcept {
    if (!located_.load(std::memory_order_acquire)) return false;
    q.resize(joints_);
    for (int i = 0; i < joints_; ++i) {
      q[i] = position_[static_cast<std::size_t>(i)].load(std::memory_order_relaxed);
    }
    return true;
  }

  /// Judges gains that have passed check_gains, at q, or at any posture if q has no entries because
  /// the robot's posture is unknown. Throws if there is no memory.
  GainJudge::Verdict judge(const Gains& gains, const JointVector& q) {
    const std::lock_guard lock(mutex_);
    return look(gains, q, true);
  }
  /// Result of judging a change.
  struct Change {
    GainJudge::Verdict verdict;  ///< of the new state
    double before;               ///< margin of the old state; if the verdict is enough, its margin
    bool taken;
  };
  /// Judges the change from the gains `before` to `wanted`, both of which have passed check_gains,
  /// and to another attachment, as a whole. It is taken if the verdict is enough, or better than
  /// the verdict on the old state. Gains that were accepted last with the same attachment, no joint
  /// further than 0.1 rad from q, pass without a new verdict. A change that is not taken, or an
  /// exception, leaves everything as it was. Otherwise as judge().
  Change change(const Gains& before, const Gains& wanted, const JointVector& q,
                const Attachment& attachment) {
    const std::lock_guard lock(mutex_);
    const Attachment old = attached_;
    const bool moves = !(attachment == old);
    if (moves) replace(attachment);
    try {
      const GainJudge::Verdict found = look(wanted, q, moves);
      if (enough(found)) return {found, found.margin, true};
      if (moves) replace(old);
      const GainJudge::Verdict now = look(before, q, true);
      const bool better = found.margin > now.margin;
      if (better && moves) replace(attachment);
      return {found, now.margin, better};
    } catch (...) {
      if (moves) replace(old);
      throw;
    }
  }
  /// Returns what the model lacks that could have made a verdict on gains too small.
  std::string missing(const GainJudge::Verdict& verdict, const Gains& gains) {
    const std::lock_guard lock(mutex_);
    return judge_.missing(verdict, gains);
  }
  bool enough(const GainJudge::Verdict& verdict) const noexcept {
    return verdict.margin >= wanted_;
  }
  /// Returns what is attached to the tip link.
  Attachment attached() {
    const std::lock_guard lock(mutex_);
    return attached_;
  }
  /// Returns Limits::gain_margin.
  double wanted() const noexcept { return wanted_; }

 private:
  // With the lock held:
  GainJudge::Verdict look(const Gains& gains, const JointVector& q, bool again) {
    if (wanted_ <= 1) return {wanted_, Mode::kJoint};
    if (q.size() == 0) return judge_.judge_anywhere(gains);
    const bool known =
        any_ && same_gains(gains, accepted_) && (q - accepted_at_).cwiseAbs().maxCoeff() < 0.1;
    if (known && !again) return {wanted_, Mode::kJoint};
    GainJudge::Verdict verdict = judge_.judge(q, gains);
    if (enough(verdict)) {
      accepted_ = gains;
      accepted_at_ = q;
      any_ = true;
    }
    return verdict;
  }
  void replace(const Attachment& attachment) noexcept {
    judge_.attach(attachment);
    attached_ = attachment;
    any_ = false;
  }

  const int joints_;
  const double wanted_;
  std::array<std::atomic<double>, kMaxJoints> position_{};
  std::atomic<bool> located_{false};
  std::mutex mutex_;  ///< guards the following members
  GainJudge judge_;
  Attachment attached_;
  bool any_ = false;
  Gains accepted_;
  JointVector accepted_at_;  ///< n, rad
};

/// The commands of the other thread as a whole: each request that the real-time thread fetches is
/// complete.
struct Request {
  std::uint64_t setpoints = 0;  ///< number given so far
  std::uint64_t gain_changes = 0;
  std::uint64_t releases = 0;
  std::uint64_t attachments = 0;
  std::uint64_t tip_speeds = 0;
  Attachment attachment;
  TipSpeed tip_speed;
  bool on_arrival = false;  ///< the tick that takes up the set-point sets its time
  Setpoint setpoint;        ///< with the gains
};

/// One controller, and the data that its two threads exchange.
struct HostedController {
  explicit HostedController(const Config& config);

  // For every thread:
  const std::vector<Joint> joints;
  const int n;
  const Settings settings;
  const std::int64_t period;  ///< ns
  const RobotModel model;
  const DynamicsKernel kernel;
  mutable Judgement judgement;
  /// Finds the closed loop of gains at a posture at rest, and its modes. Returns kOk, or the status
  /// of an impossible state. Throws only what allocation throws.
  Status at_posture(const JointVector& q, const Gains& gains, Mode mode, VibrationTask& task,
                    Vibration& found) const;

  Latest<Request> requests;      ///< from the other thread to the real-time thread
  Latest<Snapshot> snapshots;    ///< back
  Latest<Vibration> vibrations;  ///< likewise

  // For the other thread:
  Request request;
  const SampledVibration* sampled() noexcept { return controller_.sampled_vibration(); }

  // For the real-time thread:
  Status update(const dashpot_state* given, const dashpot_setpoint* wanted,
                JointVector& torque) noexcept;
  /// Without entries: the last torque acts.
  void reset(const JointVector& torque) noexcept;
  void stop() noexcept;
  bool needs_brakes() const noexcept {
    return controller::needs_brakes(controller_.snapshot().status, controller_.snapshot().fault);
  }

 private:
  void forget_setpoint() noexcept;
  /// Takes over attachment and tip speed. The current set-point keeps its place on the tip link.
  void take_up_tip(const Request& latest) noexcept;
  /// Puts the commands of the caller and of the other thread into `setpoint_`. Returns false, and
  /// keeps the current set-point, if `wanted` is given but invalid.
  bool take_up(const dashpot_setpoint* wanted, std::int64_t now) noexcept;
  /// Before a set-point was given: makes one with which the springs stay where they are and are
  /// never stale. Returns false before the robot is located, or where it must not be.
  bool stay(std::int64_t now) noexcept;

  Controller controller_;
  Setpoint setpoint_;            ///< current
  bool has_setpoint_ = false;    ///< a set-point was given
  bool stopped_ = false;         ///< it was given up, and no other was given
  bool located_ = false;         ///< the controller knows where the robot is
  std::int64_t time_ = 0;        ///< of the last state, ns
  std::uint64_t setpoints_ = 0;  ///< of the other thread, taken up so far
  std::uint64_t gain_changes_ = 0;
  std::uint64_t releases_ = 0;
  std::uint64_t attachments_ = 0;
  std::uint64_t tip_speeds_ = 0;
  Pose tool_;                          ///< T in the tip link, of the set-points
  bool latched_ = false;               ///< a fault was latched after the last tick
  std::int64_t given_time_ = 0;        ///< of the caller's last set-point, unchanged
  bool forgotten_ = false;             ///< the release of a fault made that set-point invalid
  std::uint64_t published_modes_ = 0;  ///< tick of the published modes
  analysis::Status published_status_ = analysis::Status::kOk;
};

/// Returns the gravity torque at q with something attached.
JointVector weight_of(const HostedController& controller, const Attachment& attachment,
                      const JointVector& q) noexcept;

/// Sets what dashpot_last_error says; returns `code`.
std::int32_t finish(std::int32_t code, const char* text) noexcept;
std::int32_t finish(std::int32_t code) noexcept;
/// Adds a warning to DASHPOT_OK and the call's earlier warnings; to be called after
/// finish(DASHPOT_OK).
std::int32_t warn(const char* text) noexcept;
void warn_of_gains(const HostedController& controller, const Gains& gains) noexcept;
/// Describes a verdict with too little margin, found `here` or wherever the robot may be, in one
/// line: the margin, what `became` of the gains, and what the model lacks that may be why.
using VerdictText = std::array<char, 960>;
VerdictText describe(Judgement& judgement, const GainJudge::Verdict& verdict, const Gains& gains,
                     bool here, const char* became = "") noexcept;
/// Puts the given gains into `wanted`. Returns DASHPOT_OK, or why the gains are invalid.
std::int32_t read_gains(const dashpot_gains* given, int n, Gains& wanted) noexcept;

/// Returns a controller as dashpot_create does, from a configuration that was read before. Throws
/// InputError, with the key `gains`, for gains that dashpot_set_gains would refuse.
dashpot_controller* create_controller(const Config& config);

}  // namespace dashpot::controller

struct dashpot_controller  // NOLINT(readability-identifier-naming): C's
    : dashpot::controller::HostedController {
  using HostedController::HostedController;
};
