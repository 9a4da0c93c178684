// Responses against references of 50 digits, from t = 0 to long after all has died away.
#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/task_space.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/oracle.hpp>

#include <gtest/gtest.h>

namespace dashpot::analysis {
namespace {

using Eigen::VectorXd;
using testing::near;
using testing::ResponseCase;
using testing::Trajectory;

System<> system_of(const ResponseCase& reference) {
  if (reference.jacobian) {
    TaskImpedance impedance;
    impedance.mass = reference.mass;
    impedance.jacobian = reference.jacobian;
    impedance.task_stiffness = reference.task_stiffness;
    impedance.task_damping = reference.task_damping;
    return to_joint_space(impedance);
  }
  System<> system(reference.n);
  system.mass = reference.mass;
  system.damping = reference.damping;
  system.stiffness = reference.stiffness;
  return system;
}

constexpr double kTolerance = 1e-12;

class ResponseOracle : public ::testing::TestWithParam<std::string> {
 protected:
  const ResponseCase reference = testing::response_case(GetParam());
  System<> system = system_of(reference);
  Response response{system, analyze(system)};

  template <class Ask>
  void expect_agreement(const char* kind, const Trajectory& trajectory, const Ask& ask) {
    SCOPED_TRACE(kind);
    const double position_size = trajectory.position.cwiseAbs().maxCoeff();
    const double velocity_size = trajectory.velocity.cwiseAbs().maxCoeff();
    for (std::size_t i = 0; i < trajectory.times.size(); ++i) {
      const Motion motion = ask(trajectory.times[i]);
      const auto column = static_cast<Eigen::Index>(i);
      const VectorXd q = trajectory.position.col(column);
      const VectorXd v = trajectory.velocity.col(column);
      EXPECT_TRUE(near(motion.position, q, kTolerance * position_size))
          << "position at " << trajectory.times[i] << " s";
      EXPECT_TRUE(near(motion.velocity, v, kTolerance * velocity_size))
          << "velocity at " << trajectory.times[i] << " s";
    }
  }
};
INSTANTIATE_TEST_SUITE_P(Systems, ResponseOracle, ::testing::ValuesIn(testing::response_names()),
                         [](const auto& instance) {
                           std::string name = instance.param;
                           std::replace_if(
                               name.begin(), name.end(),
                               [](unsigned char c) { return !std::isalnum(c); }, '_');
                           return name;
                         });

TEST_P(ResponseOracle, Agrees) {
  const VectorXd rest = VectorXd::Zero(reference.n);
  expect_agreement("free", reference.free, [&](double t) {
    return response.free(reference.initial_position, reference.initial_velocity, t);
  });
  expect_agreement("impulse", reference.impulse_response,
                   [&](double t) { return response.impulse(reference.impulse, t); });
  expect_agreement("step", reference.step_response,
                   [&](double t) { return response.step(reference.constant_force, t); });
  expect_agreement("harmonic", reference.harmonic_response, [&](double t) {
    return response.harmonic(reference.harmonic_cosine, reference.harmonic_sine,
                             reference.harmonic_frequency, t);
  });
  expect_agreement("sampled", reference.sampled_response, [&](double t) {
    return response.sampled(rest, rest, reference.samples, reference.sample_step, {t}).front();
  });
  for (const auto& [frequency, value] : reference.receptance) {
    const Eigen::MatrixXcd H = response.receptance(frequency);
    EXPECT_TRUE(near(H, value, kTolerance * value.cwiseAbs().maxCoeff())) << frequency;
  }
}

}  // namespace
}  // namespace dashpot::analysis
