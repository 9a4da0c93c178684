// Responses against references of 50 digits, from t = 0 to long after all has died away.
#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/task_space.hpp>
#if defined(DASHPOT_HAVE_ARB)
#include <dashpot/tests/support/certified_spectrum.hpp>
#endif
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/oracle.hpp>
#include <dashpot/tests/support/sanitized.hpp>

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

#if defined(DASHPOT_HAVE_ARB)
using Eigen::MatrixXd;
using testing::BallMatrix;

/// The references from exponentials of state matrices, in balls that hold the truth.
class BallResponse {
 public:
  explicit BallResponse(const ResponseCase& given)
      : n_(given.n), M_(given.mass), C_(given.damping), K_(given.stiffness) {
    if (!given.jacobian) return;
    BallMatrix J(*given.jacobian), Jt(MatrixXd(given.jacobian->transpose()));
    for (auto [gain, product] :
         {std::pair(&given.task_damping, &C_), {&given.task_stiffness, &K_}}) {
      BallMatrix inner(**gain), half(inner.get()->r, n_);
      acb_mat_mul(half.get(), inner.get(), J.get(), kBits);
      acb_mat_mul(product->get(), Jt.get(), half.get(), kBits);
    }
  }

  /// Puts z = [q; q'; u] a time t later, where u' = G u and the forces are F u.
  void advance(const MatrixXd& F, const MatrixXd& G, double t, BallMatrix& z) {
    const Eigen::Index inputs = F.cols(), size = 2 * n_ + inputs;
    BallMatrix right(n_, size), solution(n_, size), A(size, size), power(size, size), next(size, 1);
    for (Eigen::Index i = 0; i < n_; ++i) {
      for (Eigen::Index j = 0; j < n_; ++j) {
        acb_neg(right.at(i, j), K_.at(i, j));
        acb_neg(right.at(i, n_ + j), C_.at(i, j));
      }
      for (Eigen::Index j = 0; j < inputs; ++j) acb_set_d(right.at(i, 2 * n_ + j), F(i, j));
    }
    acb_mat_solve(solution.get(), M_.get(), right.get(), kBits);
    for (Eigen::Index i = 0; i < n_; ++i) {
      acb_one(A.at(i, n_ + i));
      for (Eigen::Index j = 0; j < size; ++j) acb_set(A.at(n_ + i, j), solution.at(i, j));
    }
    for (Eigen::Index i = 0; i < inputs; ++i) {
      for (Eigen::Index j = 0; j < inputs; ++j) acb_set_d(A.at(2 * n_ + i, 2 * n_ + j), G(i, j));
    }
    BallMatrix time{MatrixXd::Constant(1, 1, t)};
    acb_mat_scalar_mul_acb(A.get(), A.get(), time.at(0, 0), kBits);
    acb_mat_exp(power.get(), A.get(), kBits);
    acb_mat_mul(next.get(), power.get(), z.get(), kBits);
    acb_mat_set(z.get(), next.get());
  }
  /// [0; M^-1 p]
  void strike(const VectorXd& p, BallMatrix& z) {
    BallMatrix given{MatrixXd(p)}, velocity(n_, 1);
    acb_mat_solve(velocity.get(), M_.get(), given.get(), kBits);
    for (Eigen::Index i = 0; i < n_; ++i) acb_set(z.at(n_ + i, 0), velocity.at(i, 0));
  }
  /// (K + i w C - w^2 M)^-1
  void receptance(double w, BallMatrix& H) {
    BallMatrix dynamic(n_, n_), one{MatrixXd::Identity(n_, n_)}, iw(1, 1);
    acb_set_d_d(iw.at(0, 0), 0, w);
    acb_mat_scalar_addmul_acb(dynamic.get(), M_.get(), iw.at(0, 0), kBits);
    acb_mat_add(dynamic.get(), dynamic.get(), C_.get(), kBits);
    acb_mat_scalar_mul_acb(dynamic.get(), dynamic.get(), iw.at(0, 0), kBits);
    acb_mat_add(dynamic.get(), dynamic.get(), K_.get(), kBits);
    acb_mat_solve(H.get(), dynamic.get(), one.get(), kBits);
  }

 private:
  static constexpr slong kBits = 900;
  Eigen::Index n_;
  BallMatrix M_, C_, K_;
};

/// Rounded to a double, or to nothing below 1e-100.
void expect_rounded(double stored, const arb_t ball) {
  const double truth = arf_get_d(arb_midref(ball), ARF_RND_NEAR);
  EXPECT_LE(mag_get_d(arb_radref(ball)), 1e-18 * std::abs(truth) + 1e-101);
  EXPECT_NEAR(stored, truth, 2.3e-16 * std::abs(truth) + 1e-100);
}

void expect_state(const Trajectory& stored, std::size_t i, BallMatrix& z) {
  const auto column = static_cast<Eigen::Index>(i), n = stored.position.rows();
  SCOPED_TRACE(stored.times[i]);
  for (Eigen::Index k = 0; k < n; ++k) {
    expect_rounded(stored.position(k, column), acb_realref(z.at(k, 0)));
    expect_rounded(stored.velocity(k, column), acb_realref(z.at(n + k, 0)));
  }
}
#endif

TEST_P(ResponseOracle, IsWhatArbProves) {
  DASHPOT_SKIP_IF_QUICK();
#if defined(DASHPOT_HAVE_ARB)
  BallResponse balls(reference);
  const Eigen::Index n = reference.n;
  const auto stacked = [](const VectorXd& a, const VectorXd& b) {
    return (MatrixXd(a.size() + b.size(), 1) << a, b).finished();
  };
  const VectorXd rest = VectorXd::Zero(2 * n);
  const auto expect_driven = [&](const char* kind, const Trajectory& stored, const MatrixXd& F,
                                 const MatrixXd& G, const MatrixXd& start) {
    SCOPED_TRACE(kind);
    for (std::size_t i = 0; i < stored.times.size(); ++i) {
      BallMatrix z(start);
      if (kind == std::string("impulse")) balls.strike(reference.impulse, z);
      balls.advance(F, G, stored.times[i], z);
      expect_state(stored, i, z);
    }
  };
  const MatrixXd none(n, 0), nothing(0, 0), one = MatrixXd::Zero(1, 1);
  expect_driven("free", reference.free, none, nothing,
                stacked(reference.initial_position, reference.initial_velocity));
  expect_driven("impulse", reference.impulse_response, none, nothing, rest);
  expect_driven("step", reference.step_response, reference.constant_force, one,
                stacked(rest, VectorXd::Ones(1)));
  const double w = reference.harmonic_frequency;
  MatrixXd F(n, 2);
  F << reference.harmonic_cosine, reference.harmonic_sine;
  expect_driven("harmonic", reference.harmonic_response, F,
                (MatrixXd(2, 2) << 0, -w, w, 0).finished(), stacked(rest, VectorXd::Unit(2, 0)));
  const double h = reference.sample_step;
  const Trajectory& sampled = reference.sampled_response;
  for (std::size_t i = 0; i < sampled.times.size(); ++i) {
    SCOPED_TRACE("sampled");
    BallMatrix z(stacked(rest, VectorXd::Unit(2, 0)));
    for (int k = 0; k * h < sampled.times[i]; ++k) {
      const VectorXd now = reference.samples.col(k);
      F << now, (reference.samples.col(k + 1) - now) / h;
      balls.advance(F, MatrixXd{{0, 0}, {1, 0}}, std::min(h, sampled.times[i] - k * h), z);
      acb_zero(z.at(2 * n + 1, 0));  // the time since the sample
    }
    expect_state(sampled, i, z);
  }
  for (const auto& [frequency, value] : reference.receptance) {
    SCOPED_TRACE(frequency);
    BallMatrix H(n, n);
    balls.receptance(frequency, H);
    for (Eigen::Index i = 0; i < n * n; ++i) {
      expect_rounded(value(i).real(), acb_realref(H.at(i % n, i / n)));
      expect_rounded(value(i).imag(), acb_imagref(H.at(i % n, i / n)));
    }
  }
#else
  GTEST_SKIP() << "FLINT/Arb is not installed (libflint-arb-dev, libflint-dev)";
#endif
}

}  // namespace
}  // namespace dashpot::analysis
