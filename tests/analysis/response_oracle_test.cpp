// Responses of hard systems against what Arb proves, from t = 0 to long after all has died away.
#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/task_space.hpp>
#if defined(DASHPOT_HAVE_ARB)
#include <dashpot/tests/support/certified_spectrum.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/oracle.hpp>
#endif

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace dashpot::analysis {
namespace {

#if !defined(DASHPOT_HAVE_ARB)
TEST(ResponseOracle, NeedsArb) {
  GTEST_SKIP() << "FLINT/Arb is not installed (libflint-arb-dev, libflint-dev)";
}
#else
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::BallMatrix;
using testing::Json;
using testing::near;
using testing::to_matrix;
using testing::to_vector;

constexpr double kTolerance = 1e-12;

const testing::SystemFile& responses() {
  static const testing::SystemFile file("responses.json");
  return file;
}

System<> system_of(const Json& given) {
  if (!given.contains("jacobian")) return testing::to_system(given);
  TaskImpedance impedance;
  impedance.mass = to_matrix(given["mass"]);
  impedance.jacobian = to_matrix(given["jacobian"]);
  impedance.task_stiffness = to_matrix(given["task_stiffness"]);
  impedance.task_damping = to_matrix(given["task_damping"]);
  return to_joint_space(impedance);
}

/// Motions from exponentials of state matrices, in balls that hold the truth.
class BallResponse {
 public:
  BallResponse(const System<>& system, const Json& given)
      : n_(system.dof()), M_(system.mass), C_(system.damping), K_(system.stiffness) {
    if (!given.contains("jacobian")) return;
    const MatrixXd jacobian = to_matrix(given["jacobian"]);
    BallMatrix J(jacobian), Jt(MatrixXd(jacobian.transpose()));
    for (auto [gain, product] : {std::pair("task_damping", &C_), {"task_stiffness", &K_}}) {
      BallMatrix inner(to_matrix(given[gain])), half(inner.get()->r, n_);
      acb_mat_mul(half.get(), inner.get(), J.get(), kBits);
      acb_mat_mul(product->get(), Jt.get(), half.get(), kBits);
    }
  }

  /// Puts z = [q; q'; u] a time t later, where the forces are F u and u is constant.
  void advance(const MatrixXd& F, double t, BallMatrix& z) {
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
  Eigen::MatrixXcd receptance(double w) {
    BallMatrix dynamic(n_, n_), one{MatrixXd::Identity(n_, n_)}, iw(1, 1), H(n_, n_);
    acb_set_d_d(iw.at(0, 0), 0, w);
    acb_mat_scalar_addmul_acb(dynamic.get(), M_.get(), iw.at(0, 0), kBits);
    acb_mat_add(dynamic.get(), dynamic.get(), C_.get(), kBits);
    acb_mat_scalar_mul_acb(dynamic.get(), dynamic.get(), iw.at(0, 0), kBits);
    acb_mat_add(dynamic.get(), dynamic.get(), K_.get(), kBits);
    acb_mat_solve(H.get(), dynamic.get(), one.get(), kBits);
    return H.rounded();
  }

 private:
  static constexpr slong kBits = 900;
  Eigen::Index n_;
  BallMatrix M_, C_, K_;
};

class ResponseOracle : public ::testing::TestWithParam<std::string> {
 protected:
  /// The motion that begins at z = [q; q'; u] and is driven as in BallResponse::advance.
  template <class Ask>
  void expect_motion(const char* kind, const MatrixXd& F, const VectorXd& start, const Ask& ask) {
    SCOPED_TRACE(kind);
    const auto times = given[kind]["times"].get<std::vector<double>>();
    MatrixXd states(2 * n, 0);
    for (const double t : times) {
      BallMatrix z{MatrixXd(start)};
      if (kind == std::string("impulse")) balls.strike(to_vector(given[kind][kind]), z);
      balls.advance(F, t, z);
      states.conservativeResize(Eigen::NoChange, states.cols() + 1);
      states.rightCols<1>() = VectorXd(z.rounded().real()).head(2 * n);
    }
    const double size[] = {states.topRows(n).cwiseAbs().maxCoeff(),
                           states.bottomRows(n).cwiseAbs().maxCoeff()};
    for (std::size_t i = 0; i < times.size(); ++i) {
      const Motion motion = ask(times[i]);
      const VectorXd state = states.col(static_cast<Eigen::Index>(i));
      EXPECT_TRUE(near(motion.position, state.head(n), kTolerance * size[0])) << times[i] << " s";
      EXPECT_TRUE(near(motion.velocity, state.tail(n), kTolerance * size[1])) << times[i] << " s";
    }
  }

  Json given = responses().read(GetParam());
  System<> system = system_of(given);
  Eigen::Index n = system.dof();
  BallResponse balls{testing::to_system(given), given};
  Response response{system, analyze(system)};
};
INSTANTIATE_TEST_SUITE_P(Systems, ResponseOracle, ::testing::ValuesIn(responses().names),
                         [](const auto& instance) {
                           return testing::alphanumeric(instance.param);
                         });

TEST_P(ResponseOracle, Agrees) {
  const auto stacked = [](const VectorXd& a, const VectorXd& b) {
    return (VectorXd(a.size() + b.size()) << a, b).finished();
  };
  const VectorXd rest = VectorXd::Zero(2 * n);
  const MatrixXd none(n, 0);
  const VectorXd q0 = to_vector(given["free"]["initial_position"]),
                 v0 = to_vector(given["free"]["initial_velocity"]);
  expect_motion("free", none, stacked(q0, v0), [&](double t) { return response.free(q0, v0, t); });
  const VectorXd impulse = to_vector(given["impulse"]["impulse"]);
  expect_motion("impulse", none, rest, [&](double t) { return response.impulse(impulse, t); });
  const VectorXd force = to_vector(given["constant_force"]["force"]);
  expect_motion("constant_force", force, stacked(rest, VectorXd::Ones(1)),
                [&](double t) { return response.step(force, t); });
  for (const double frequency : given["receptance"].get<std::vector<double>>()) {
    const Eigen::MatrixXcd truth = balls.receptance(frequency);
    EXPECT_TRUE(
        near(response.receptance(frequency), truth, kTolerance * truth.cwiseAbs().maxCoeff()))
        << frequency;
  }
}
#endif

}  // namespace
}  // namespace dashpot::analysis
