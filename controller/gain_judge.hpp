#pragma once
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/robot_model.hpp>

namespace dashpot::controller {

/// Tells before they are taken whether gains leave the loop, as it is sampled, held, delayed and
/// filtered (Analysis::Sampled), the margin of Limits::gain_margin: at one posture at rest, in both
/// modes, by analysis::gain_margin. Motions slower than 1 rad/s do not count: those that the held
/// gravity compensation feeds along motions without springs grow that slowly.
///
/// For a lower rate than the tick's: allocates, and takes milliseconds, or tenths of a second with
/// a long delay and many joints.
class GainJudge {
 public:
  struct Verdict {
    double margin;  ///< of the worse mode; at most Limits::gain_margin, which is enough
    Mode mode;      ///< the worse one
  };

  /// The settings have to be valid.
  GainJudge(const RobotModel& model, const Settings& settings);

  /// `q`: n, rad. The gains have passed check_gains in both modes. Zero where the loop could not be
  /// analysed.
  Verdict judge(const JointVector& q, const Gains& gains);
  /// Where nobody knows yet where the robot is: the best verdict of kPostures postures, spread over
  /// the position limits. Gains that none of them bears are wrong anywhere.
  Verdict judge_anywhere(const Gains& gains);
  static constexpr int kPostures = 8;

 private:
  double margin(const JointVector& q, const Gains& gains, Mode mode);

  RobotModel model_;
  JointVector lower_, upper_;  ///< of the positions, rad
  double wanted_;
  bool gravity_;
  analysis::SampledLoop loop_;
  Controller controller_;  ///< takes the gains at once, wherever the robot is
  std::int64_t time_ = 0;
};

}  // namespace dashpot::controller
