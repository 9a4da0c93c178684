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

  /// Sets where the robot is now (n, rad). For one thread.
  void locate(const JointVector& q) noexcept {
    for (int i = 0; i < joints_; ++i) {
      const auto at = static_cast<std::size_t>(i);
      position_[at].store(q[i], std::memory_order_relaxed);
    }
    located_.store(true, std::memory_order_release);
  }
  /// Sets `q` to where the robot was in its last good state or two, joint by joint; false if
  /// that is not known.
  bool where(JointVector& q) const noexcept {
    if (!located_.load(std::memory_order_acquire)) return false;
    q.resize(joints_);
    for (int i = 0; i < joints_; ++i) {
      q[i] = position_[static_cast<std::size_t>(i)].load(std::memory_order_relaxed);
    }
    return true;
  }

  /// Judges gains that have passed check_gains, at q. Unless it is to be done `again`, those that
  /// were accepted last, no joint further than 0.1 rad from q, pass. Throws if there is no memory.
  GainJudge::Verdict judge(const Gains& gains, const JointVector& q, bool again) {
    const std::lock_guard lock(mutex_);
    return here(gains, q, again);
  }
  /// Judges gains that have passed check_gains with something else attached to the tip link, at q
  /// or, if that has no entries, anywhere. What is attached stays so if the verdict is enough.
  /// Throws as judge().
  GainJudge::Verdict judge(const Gains& gains, const JointVector& q, const Attachment& attachment) {
    const std::lock_guard lock(mutex_);
    const Attachment before = attached_;
    replace(attachment);
    try {
      const GainJudge::Verdict verdict = q.size() == 0 ? anywhere(gains) : here(gains, q, true);
      if (!enough(verdict)) replace(before);
      return verdict;
    } catch (...) {
      replace(before);
      throw;
    }
  }
  /// Judges gains that have passed check_gains, as long as nobody knows where the robot is.
  GainJudge::Verdict judge_anywhere(const Gains& gains) {
    const std::lock_guard lock(mutex_);
    return anywhere(gains);
  }
  bool enough(const GainJudge::Verdict& verdict) const noexcept {
    return verdict.margin >= wanted_;
  }
  /// Returns what is attached to the tip link.
  Attachment attached() {
    const std::lock_guard lock(mutex_);
    return attached_;
  }
  /// Attaches something without judging it.
  void attach(const Attachment& attachment) noexcept {
    const std::lock_guard lock(mutex_);
    replace(attachment);
  }
  /// Returns Limits::gain_margin.
  double wanted() const noexcept { return wanted_; }

 private:
  // With the lock held:
  GainJudge::Verdict here(const Gains& gains, const JointVector& q, bool again) {
    const bool known =
        any_ && same_gains(gains, accepted_) && (q - accepted_at_).cwiseAbs().maxCoeff() < 0.1;
    if (wanted_ <= 1 || (known && !again)) return {wanted_, Mode::kJoint};
    const GainJudge::Verdict verdict = judge_.judge(q, gains);
    if (enough(verdict)) {
      accepted_ = gains;
      accepted_at_ = q;
      any_ = true;
    }
    return verdict;
  }
  GainJudge::Verdict anywhere(const Gains& gains) {
    if (wanted_ <= 1) return {wanted_, Mode::kJoint};
    return judge_.judge_anywhere(gains);
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
  std::mutex mutex_;  ///< of what follows
  GainJudge judge_;
  Attachment attached_;
  bool any_ = false;
  Gains accepted_;
  JointVector accepted_at_;  ///< n, rad
};

}  // namespace dashpot::controller
