#pragma once
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/controller/posture_loop.hpp>

namespace dashpot::controller {

/// Computes, before gains are accepted, whether they leave the sampled loop the margin of
/// Limits::gain_margin. The loop has a zero-order hold, delay and filters (Analysis::Sampled). The
/// margin is that of analysis::gain_margin at one posture at rest, in both modes. Motions slower
/// than 1 rad/s do not count. Gravity compensation with a zero-order hold feeds motions without
/// springs, which then grow that slowly, so that otherwise all gains would be refused.
///
/// Not for the real-time thread, because it allocates, and takes milliseconds, or tenths of a
/// second with a long delay and many joints.
class GainJudge {
 public:
  struct Verdict {
    double margin;  ///< of the worse mode; at most Limits::gain_margin, which is enough; below 1
                    ///< if the loop is unstable, 0 if it could not be analysed
    Mode mode;      ///< the worse mode
  };

  /// The settings have to be valid.
  GainJudge(const RobotModel& model, const Settings& settings);

  /// Attaches something else to the tip link.
  void attach(const Attachment& attachment) noexcept {
    kernel_.attach(attachment);
    posture_loop_.attach(attachment);
  }
  /// Judges gains at the posture `q` (n, rad). The gains must have passed check_gains in both
  /// modes.
  Verdict judge(const JointVector& q, const Gains& gains);
  /// Judges gains while the posture is not known yet. Returns the best verdict of kPostures
  /// postures spread over the position limits: gains without margin at any of them are taken to
  /// be wrong everywhere.
  Verdict judge_anywhere(const Gains& gains);
  static constexpr int kPostures = 8;

 private:
  double margin(const JointVector& q, const Gains& gains, Mode mode);

  DynamicsKernel kernel_;
  JointVector lower_, upper_;  ///< of the positions, rad
  double wanted_;
  bool gravity_;
  analysis::SampledLoop loop_;
  PostureLoop posture_loop_;
};

}  // namespace dashpot::controller
