#pragma once
#include <dashpot/controller/posture_loop.hpp>

#include <string>

namespace dashpot::controller {

/// Computes, before gains are accepted, whether they leave the sampled loop the margin of
/// Limits::gain_margin. The loop has a zero-order hold, delay and filters (Analysis::Sampled), and
/// the integral of the springs; compensation of friction at the measured velocity subtracts from
/// the damping. The margin comes from analysis::gain_margin at one posture at rest, in both modes.
/// Motions slower than kSlowestVibration do not count.
///
/// Damping that is designed for a ratio grows with the specified payload, whether the arm carries
/// it or not. So in a mode with a ratio the same springs and dampers are also judged on the arm
/// without payload: they stay until the host reports that the payload was dropped. There a margin
/// of kDropped, or of Limits::gain_margin if that is less, is enough.
///
/// Not for the real-time thread, because it allocates, and takes milliseconds, or tenths of a
/// second with a long delay and many joints.
class GainJudge {
 public:
  struct Verdict {
    double margin;  ///< of the worst that is too little; Limits::gain_margin if all is enough;
                    ///< below 1 if the loop is unstable, 0 if it could not be analysed
    Mode mode;      ///< of the worst
    bool dropped = false;  ///< the worst is on the arm without payload
    JointVector q = {};    ///< posture that was judged, n, rad
  };
  /// The margin that is enough without the payload.
  static constexpr double kDropped = 1.2;

  /// The settings have to be valid.
  GainJudge(const RobotModel& model, const Settings& settings);

  /// Attaches something else to the tip link.
  void attach(const Attachment& attachment) noexcept {
    attached_ = attachment;
    posture_loop_.attach(attachment);
    loaded_ = attachment.mass > 0;
  }
  /// Judges gains at the posture `q` (n, rad). The gains must have passed check_gains in both
  /// modes.
  Verdict judge(const JointVector& q, const Gains& gains);
  /// Judges gains while the posture is not known yet. Returns the best verdict of kPostures
  /// postures spread over the position limits: gains without margin at any of them are taken to
  /// be wrong everywhere.
  Verdict judge_anywhere(const Gains& gains);
  static constexpr int kPostures = 8;
  /// Returns what the model lacks that could have made the verdict on these gains too small: "the
  /// model has no reflected inertia of joint7, with joint7 0.02 kg m^2 it would be enough ...".
  /// Empty if it lacks nothing. Takes the time of some twenty verdicts.
  std::string missing(const Verdict& verdict, const Gains& gains) const;

 private:
  RobotModel model_;
  Settings settings_;
  Attachment attached_;
  bool loaded_;      ///< there is a payload
  SampledArm bare_;  ///< without payload
  PostureLoop posture_loop_;
};

}  // namespace dashpot::controller
