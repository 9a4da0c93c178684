// Responses against references of 50 digits, from t = 0 to long after all has died away.
#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/task_space.hpp>
#include <dashpot/tests/support/equation_residual.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/oracle.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
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

/// With bases of the solver, and zero modes that a factor of K tells.
TEST(ResponseOfRandomSystems, MeetsItsInitialConditionsAndSolvesTheEquation) {
  testing::Random random(42);
  for (int i = 0; i < 50; ++i) {
    const int n = random.integer(1, 8), r = random.integer(0, std::min(2, n));
    System<> system(n);
    const MatrixXd W = 5 * random.matrix(n - r, n);
    system.mass = random.spd(n);
    system.damping = random.uniform(0, 4) * random.spd(n);
    system.stiffness = W.transpose() * W;
    system.stiffness = (0.5 * (system.stiffness + system.stiffness.transpose())).eval();
    system.stiffness_factor = W;
    const Response response(system, analyze(system));
    const VectorXd q = random.vector(n), v = 10 * random.vector(n), f = 100 * random.vector(n);
    const Motion start = response.free(q, v, 0);
    EXPECT_TRUE(near(start.position, q, 1e-13 * q.norm()));
    EXPECT_TRUE(near(start.velocity, v, 1e-13 * (v.norm() + 50 * q.norm())));
    const auto residual = [&](const auto& motion, const auto& force) {
      return testing::worst_residual(system, random, 0.01, 10, 5e-4, motion, force);
    };
    EXPECT_LT(residual([&](double t) { return response.free(q, v, t); },
                       [n](double) -> VectorXd { return VectorXd::Zero(n); }),
              1e-10);
    EXPECT_LT(residual([&](double t) { return response.step(f, t); }, [&](double) { return f; }),
              1e-10);
    const double omega = random.log_uniform(0.1, 50);
    EXPECT_LT(residual([&](double t) { return response.harmonic(f, q, omega, t); },
                       [&](double t) -> VectorXd {
                         return f * std::cos(omega * t) + q * std::sin(omega * t);
                       }),
              1e-10);
  }
}

}  // namespace
}  // namespace dashpot::analysis
