// The arms ring down as predicted: the controller's published modes against modes that a fit finds
// in the simulated motion after small releases.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/released_arm.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cstdio>

namespace dashpot {
namespace {

using controller::JointVector;
using Eigen::VectorXd;
using testing::Random;
using testing::ReleasedArm;
using testing::TwinModels;
using testing::Worst;

/// One arm at one random posture with random gains, to be released with one period or another.
struct ReleasedTwin {
  const TwinModels& twin;
  Random& random;
  JointVector q0;
  controller::Gains gains;
  analysis::SampledLoop loop;
  const controller::Attachment* told = nullptr;

  ReleasedTwin(const TwinModels& models, Random& generator, bool hold_posture)
      : twin(models), random(generator), q0(random_posture(models, generator)) {
    VectorXd omega(6), zeta(6);
    for (int i = 0; i < 6; ++i) {
      omega[i] = random.log_uniform(8, 60);
      zeta[i] = random.uniform(0.15, 0.6);
    }
    gains = tip_gains(twin, q0, omega, zeta, 0.3, random);
    if (twin.dof() > 6 && hold_posture) {
      const double omega_0 = random.log_uniform(8, 30), zeta_0 = random.uniform(0.15, 0.6);
      const double softness = self_motion(twin, q0).squaredNorm();
      gains.null_stiffness.setConstant(omega_0 * omega_0 / softness);
      gains.null_damping.setConstant(2 * zeta_0 * omega_0 / softness);
    }
    loop.friction = twin.friction();
    loop.gravity_gradient = twin.gravity_gradient(q0);
  }
  /// Dampers of the tip that keep a ratio at every tick in place of constant ones.
  void hold_ratio() { gains.task_damping_ratio = 0.3; }

  /// Releases with the options of `loop`, fits the motion and compares with the controller's
  /// published modes, continuous or sampled.
  void compare(bool sampled, int ticks, int every, Worst& worst) {
    controller::Settings settings = release_settings(twin, gains, loop.period);
    settings.null_weights = JointVector::LinSpaced(twin.dof(), 0.3, 3);
    sim::PlantOptions options;
    options.delay = loop.delay;
    options.torque_cutoff = loop.torque_cutoff;
    options.difference_velocity = loop.difference_velocity;
    std::vector<testing::Recording> recordings;
    std::optional<ReleasedArm> arm;
    for (int k = 0; k < 3; ++k) {
      const JointVector dq = 1e-7 * random.vector(q0.size());
      arm.emplace(twin, settings, q0, dq, options, sim::ArmOptions(), told);
      recordings.push_back(arm->record(q0, ticks, every, 40));
      ASSERT_EQ(arm->worst, controller::Status::kOk) << to_text(arm->worst);
    }
    const auto fit = testing::fit_states(recordings, every * loop.period, arm->closed_loop.mass);
    EXPECT_LT(fit.residual, 1e-3);

    const analysis::SampledSpectrum images =
        sample_loop(arm->closed_loop, testing::spectrum_of(arm->closed_loop), loop);
    const controller::Vibration& published = arm->vibration;
    const bool free = twin.dof() > 6 && gains.null_stiffness.isZero(0);
    EXPECT_EQ(published.zero_modes, free ? 1 : 0);
    EXPECT_TRUE(images.stable() || free);  // late gravity compensation may drive the self-motion
    ASSERT_EQ(published.count, twin.dof() - published.zero_modes);
    for (int k = 0; k < published.count; ++k) {
      const auto index = static_cast<std::size_t>(k);
      const controller::VibrationMode& mode = published.modes[index];
      if (sampled) {
        worst.add(fit, images.modes[index], 1e-4, 1e-4);
      } else {
        worst.add(fit, mode.eigenvalues[0], mode.natural_frequency, mode.damping_ratio, 0.005,
                  0.005);
      }
    }
  }
};

class RingDown : public ::testing::TestWithParam<testing::Arm> {
 protected:
  static constexpr int kPostures = 12;
  TwinModels twin{GetParam()};

  /// Every other one holds its posture.
  ReleasedTwin scene_of(int seed, Random& random) const { return {twin, random, seed % 2 == 0}; }
  void report(const Worst& worst) const {
    std::printf(
        "%-12s %3d modes of the seeds from 1 on: frequency within %.2e, ratio within %.2e\n",
        GetParam().file, worst.modes, worst.frequency, worst.ratio);
  }
};
INSTANTIATE_TEST_SUITE_P(Arms, RingDown, ::testing::ValuesIn(testing::arms()),
                         [](const auto& instance) { return std::string(instance.param.file); });

TEST_P(RingDown, HasTheModesOfTheSampledLoopAtOneKilohertz) {
  Worst worst;
  for (int seed = 1; seed <= kPostures; ++seed) {
    Random random(static_cast<std::uint64_t>(seed));
    ReleasedTwin scene = scene_of(seed, random);
    if (seed % 3 == 1) scene.hold_ratio();
    scene.loop.delay = seed % 3;
    scene.loop.torque_cutoff = seed % 4 == 3 ? 200 : 0;
    scene.loop.difference_velocity = seed % 5 == 4;
    scene.compare(true, 400, 1, worst);
  }
  report(worst);
}

TEST_P(RingDown, HasTheModesOfTheSampledLoopWithABodyThatItIsToldOf) {
  controller::Payload payload{2, {0.02, -0.01, 0.06}, Eigen::Matrix3d::Zero()};
  payload.inertia.diagonal() << 0.004, 0.005, 0.003;
  const controller::Attachment told(payload, {});
  TwinModels loaded = twin;
  loaded.model = twin.model.with(told);
  twin.robot.carry({told.mass, payload.center, payload.inertia});
  Worst worst;
  for (int seed = 1; seed <= 2; ++seed) {
    Random random(static_cast<std::uint64_t>(seed));
    ReleasedTwin scene = scene_of(2, random);
    scene.told = &told;
    scene.loop.gravity_gradient = loaded.gravity_gradient(scene.q0);
    scene.compare(true, 400, 1, worst);
  }
  report(worst);
}

TEST_P(RingDown, HasTheModesOfTheSampledLoopWithOtherProjectors) {
  Worst worst;
  for (const auto& [name, projector] : controller::kNullProjectors) {
    const bool none = projector == controller::NullProjector::kNone;
    if (projector == controller::NullProjector::kDynamic || (twin.dof() == 6 && !none)) continue;
    for (int seed = 2; seed <= 4; seed += 2) {
      SCOPED_TRACE(std::string(name) + ", seed " + std::to_string(seed));
      Random random(static_cast<std::uint64_t>(seed));
      ReleasedTwin scene = scene_of(seed, random);
      scene.gains.null_projector = projector;
      if (twin.dof() == 6) scene.gains.null_stiffness.setConstant(6, 10);
      scene.gains.null_stiffness *= 8;  // enough to move the modes of the tip
      if (none && seed == 4) scene.gains.task_damping_ratio = scene.gains.null_damping_ratio = 0.3;
      scene.compare(true, 400, 1, worst);
    }
  }
  report(worst);
}

TEST_P(RingDown, HasThePublishedModesAtTenKilohertz) {
  DASHPOT_SKIP_IF_QUICK();
  Worst worst;
  for (int seed = 1; seed <= kPostures / 2; ++seed) {
    Random random(static_cast<std::uint64_t>(seed));
    ReleasedTwin scene = scene_of(seed, random);
    scene.loop.period = 1e-4;
    scene.compare(false, 2000, 10, worst);
  }
  report(worst);
}

}  // namespace
}  // namespace dashpot
