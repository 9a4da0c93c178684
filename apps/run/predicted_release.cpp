#include <dashpot/apps/run/predicted_release.hpp>
#include <dashpot/controller/posture_loop.hpp>

namespace dashpot::apps {

std::optional<PredictedRelease> predict_release(const Scene& scene) {
  analysis::Cause cause{scene.start - scene.rest, scene.velocity, {}, {}};
  if (cause.position->isZero(0) && cause.velocity->isZero(0)) return std::nullopt;
  PredictedRelease result;
  const controller::Config& config = scene.arm->config;
  const controller::Setpoint& setpoint = scene.steps.front().setpoint;
  controller::PostureLoop loop(config.model, config.settings);
  const analysis::System<> system = loop.at(scene.rest, setpoint.gains, setpoint.mode).system;
  if (system.dof() != scene.dof()) return std::nullopt;
  const JointVector still = JointVector::Zero(scene.dof());
  const Eigen::MatrixXd tip = evaluate(config.model, scene.rest, still).J.topRows<3>();
  result.spectrum = analysis::analyze(system);
  if (result.spectrum.modes.empty()) return std::nullopt;
  result.shares = analysis::mode_shares(system, result.spectrum, cause, tip);
  return result;
}

}  // namespace dashpot::apps
