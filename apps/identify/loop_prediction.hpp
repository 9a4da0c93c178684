#pragma once
#include <dashpot/apps/identify/identify.hpp>
#include <dashpot/controller/config.hpp>

#include <string>
#include <vector>

namespace dashpot::apps {

/// Predicts the modes of a configuration's loop with an arm that differs from its model.
class LoopPrediction {
 public:
  /// Reads the configuration. The channels have to be all joint positions, "q1" ... in any order,
  /// or as many as there are joints. Throws InputError.
  LoopPrediction(const std::string& config, const std::vector<MotionChannel>& channels);

  int dof() const { return config_.model.dof(); }

  /// The modes with the channels at `rest`, by falling frequency. The loop is sampled, delayed and
  /// filtered as the configuration says (analysis.sampled), and has its gains and the controller's
  /// model; the arm has the `correction`.
  std::vector<PredictedMode> predict(const Eigen::VectorXd& rest,
                                     const ModelCorrection& correction) const;

  /// Writes the configuration with the correction in it, without its comments. Throws InputError.
  void write(const std::string& path, const ModelCorrection& correction) const;

  const controller::Config& config() const { return config_; }

 private:
  std::vector<PredictedMode> predict_with_delay(const controller::JointVector& q,
                                                const ModelCorrection& correction, int delay) const;

  std::string path_;
  controller::Config config_;
  std::vector<Eigen::Index> joint_;  ///< of each channel
};

/// Matches each prediction with a measured mode: the nearest in frequency, ratio and shape
/// (nearest_pairs).
void match(const std::vector<identification::MeasuredMode>& measured,
           std::vector<PredictedMode>& predicted);

/// Puts modes into the order of equally many others with similar shapes, because the order by
/// frequency changes with an arm's parameters. Does nothing if the numbers differ.
void put_in_order(const std::vector<PredictedMode>& others, std::vector<PredictedMode>& modes);

/// Finds the change of the parameters `names` ("payload,reflected_inertia,friction,delay") that
/// explains the differences best: least squares of the measured numbers at all postures, each in
/// units of its deviation, with Huber's weights and within bounds (mass, inertia, friction and
/// delay are not negative, and a body can have the payload's inertia). Updates the predictions.
/// Throws InputError for other names.
Calibration calibrate(const LoopPrediction& loop, const std::string& names,
                      std::vector<PostureReport>& postures);

}  // namespace dashpot::apps
