#pragma once
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/controller/setpoint_check.hpp>

#include <array>
#include <atomic>
#include <mutex>

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

}  // namespace dashpot::controller
