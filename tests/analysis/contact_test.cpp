// Stability of a sampled loop in contact: against closed forms, balls of Arb and random passive
// worlds.
#include <dashpot/analysis/contact_limit.hpp>
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/tests/support/proved_eigenvalues.hpp>
#include <dashpot/tests/support/refusal.hpp>
#include <dashpot/tests/support/sampled_loops.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::one_joint;
using testing::Random;

ContactLimit limit_of(const System<>& system, const SampledLoop& loop, const Touch& touch) {
  return contact_limit(system, analyze(system), loop, touch);
}

Touch touch_along(const VectorXd& a, double most = 1e9) {
  Touch touch;
  touch.direction = a;
  touch.most = most;
  return touch;
}

/// Without delay one joint on a spring w^2 M is at its limit where K tan(w T / 2) = C w, or where
/// C tan(w T / 2) = M w: there 1 or -1 is the determinant or an eigenvalue of the tick.
TEST(Contact, LimitIsThatOfOneJoint) {
  Random random(601);
  for (int i = 0; i < 40; ++i) {
    SampledLoop loop;
    const double T = loop.period = random.log_uniform(1e-4, 1e-2), M = random.log_uniform(0.1, 10);
    const double C = random.uniform(0.05, 1.9) * M / T, K = random.uniform(0.05, 1.9) * C / T;
    const auto calm = [&](double w) {
      const double tangent = std::tan(0.5 * w * T);
      return K * tangent < C * w && C * tangent < M * w;
    };
    double low = 1e-3 / T, high = std::numbers::pi / T;
    ASSERT_TRUE(calm(low));
    for (int k = 0; k < 60; ++k) (calm(0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
    const double mass = random.integer(0, 1) * random.uniform(0, 0.5) * M;
    const System<> system = one_joint(M - mass, C, K);
    const double reach = random.log_uniform(0.1, 10), expected = low * low * M / (reach * reach);
    Touch touch = touch_along(VectorXd::Constant(1, reach));
    touch.mass = mass / (reach * reach);
    touch.most = 10 * expected;
    const ContactLimit found = limit_of(system, loop, touch);
    EXPECT_NEAR(found.stiffness, expected, 1e-9 * expected);
    EXPECT_LE(found.lower, expected);
    EXPECT_GE(found.upper, expected);
    EXPECT_LT(found.upper - found.lower, 3e-5 * expected);
    const double turn = low * T;
    const bool alternates = C * std::tan(0.5 * turn) > (1 - 1e-9) * M * low;
    const double trace = 2 * std::cos(turn) - (1 - std::cos(turn)) * K / (M * low * low) -
                         std::sin(turn) * C / (M * low);
    const double angle = alternates ? std::numbers::pi : std::acos(0.5 * trace);
    EXPECT_NEAR(found.frequency * T, angle, 1e-5);  // measured 1e-6 beyond the limit
    EXPECT_TRUE(found.stable_if_rigid);             // nothing moves
  }
}

TEST(Contact, BeginsWhereTheLoopIsStableInTheAir) {
  const System<> ringing = one_joint(1, 0, 100);
  const ContactLimit none = limit_of(ringing, {}, touch_along(VectorXd::Ones(1)));
  EXPECT_EQ(none.stiffness, 0);
  SampledLoop passive;  // the friction is all there is
  passive.friction = MatrixXd::Constant(1, 1, 3);
  const ContactLimit all = limit_of(one_joint(1, 3, 0), passive, touch_along(VectorXd::Ones(1)));
  EXPECT_TRUE(std::isinf(all.stiffness) && std::isinf(all.lower));
}

/// A damper of the touch raises the limit, until there is none.
TEST(Contact, ADamperOfTheWorldLiftsTheLimit) {
  const System<> system = one_joint(2, 300, 4000);
  SampledLoop loop;
  loop.delay = 2;
  Touch touch = touch_along(VectorXd::Ones(1));
  double last = 0;
  for (const double damper : {0.0, 30.0, 100.0}) {
    touch.damping = damper;
    const double limit = limit_of(system, loop, touch).stiffness;
    EXPECT_GT(limit, 1.05 * last);
    last = limit;
  }
  touch.damping = 1000;
  EXPECT_TRUE(std::isinf(limit_of(system, loop, touch).stiffness));
}

/// The curve crosses zero at the limit, and begins with the loop in the air.
TEST(Contact, CurveIsThatOfTheSampledLoop) {
  for (std::uint64_t seed = 610; seed < 620; ++seed) {
    Random random(seed);
    const int n = random.integer(1, 4);
    System<> system = testing::random_system(random, n);
    SampledLoop loop = testing::random_loop(random);
    loop.friction = 0.1 * system.damping;
    const Touch touch = touch_along(random.vector(n));
    const double k = random.log_uniform(1, 1e6);
    const ContactPoint point = contact_curve(system, analyze(system), loop, touch, {k})[0];
    loop.passive_stiffness = k * touch.direction * touch.direction.transpose();
    system.stiffness += loop.passive_stiffness;
    system.stiffness_factor.resize(0, n);
    double least = 1;
    for (const Complex z : testing::all_multipliers(testing::sample(system, loop))) {
      if (z != 0.0) least = std::min(least, -std::log(z).real() / std::abs(std::log(z)));
    }
    EXPECT_NEAR(point.damping_ratio, least, 1e-7);
  }
}

#if defined(DASHPOT_HAVE_ARB)
/// Whether the loop is stable, as balls of 50 digits prove of its tick in joint coordinates;
/// nothing where they cannot tell.
std::optional<bool> proved_stable(const System<>& system, const SampledLoop& loop,
                                  const Touch& touch, double stiffness) {
  constexpr slong kBits = 170;
  const Eigen::Index n = system.dof(), r = loop.torque_cutoff > 0 ? n : 0, d = loop.delay * n;
  const Eigen::Index last = loop.difference_velocity ? n : 0, rows = 2 * n + last + d + r;
  const MatrixXd contact = stiffness * touch.direction * touch.direction.transpose();
  // (q, v, u) moves for a tick by an exponential; A = robot + [torque's columns] command.
  testing::BallMatrix mass(system.mass), pull(n, 3 * n), moved(n, 3 * n), flow(3 * n, 3 * n);
  const MatrixXd D = loop.friction;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      acb_set_d(pull.at(i, j), -contact(i, j));
      acb_set_d(pull.at(i, n + j), -D(i, j));
    }
    acb_set_d(pull.at(i, 2 * n + i), 1);
  }
  acb_mat_solve(moved.get(), mass.get(), pull.get(), kBits);
  const auto scaled = [&](acb_ptr out, acb_ptr in) {
    arb_t T;
    arb_init(T);
    arb_set_d(T, loop.period);
    acb_mul_arb(out, in, T, kBits);
    arb_clear(T);
  };
  for (Eigen::Index i = 0; i < n; ++i) {
    acb_set_d(flow.at(i, n + i), loop.period);
    for (Eigen::Index j = 0; j < 3 * n; ++j) scaled(flow.at(n + i, j), moved.at(i, j));
  }
  testing::BallMatrix tick(3 * n, 3 * n);
  acb_mat_exp(tick.get(), flow.get(), kBits);
  // The command from the state, and the torque that acts.
  testing::BallMatrix command(n, rows), torque(n, rows), A(rows, rows);
  const MatrixXd K = system.stiffness, C = system.damping - D;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      acb_set_d(command.at(i, j), -K(i, j));
      acb_set_d(command.at(i, (last > 0 ? 2 * n : n) + j), -C(i, j));
    }
  }
  const Eigen::Index queue = 2 * n + last, filter = queue + d;
  if (d > 0) {
    for (Eigen::Index i = 0; i < n; ++i) acb_one(torque.at(i, queue + i));
  } else {
    acb_mat_set(torque.get(), command.get());
  }
  if (r > 0) {
    arb_t share;
    arb_init(share);
    arb_const_pi(share, kBits);
    arb_mul_si(share, share, -2, kBits);
    acb_t factor;
    acb_init(factor);
    acb_set_arb(factor, share);
    for (const double part : {loop.torque_cutoff, loop.period}) {
      arb_set_d(share, part);
      acb_mul_arb(factor, factor, share, kBits);
    }
    acb_exp(factor, factor, kBits);  // 1 - share
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j < rows; ++j) {
        acb_submul(torque.at(i, j), torque.at(i, j), factor, kBits);
      }
      acb_add(torque.at(i, filter + i), torque.at(i, filter + i), factor, kBits);
    }
    acb_clear(factor);
    arb_clear(share);
  }
  for (Eigen::Index i = 0; i < 2 * n; ++i) {
    for (Eigen::Index j = 0; j < rows; ++j) {
      for (Eigen::Index k = 0; k < n; ++k) {
        acb_addmul(A.at(i, j), tick.at(i, 2 * n + k), torque.at(k, j), kBits);
      }
      if (j < 2 * n) acb_add(A.at(i, j), A.at(i, j), tick.at(i, j), kBits);
    }
  }
  for (Eigen::Index i = 0; i < last; ++i) {  // (q_k+1 - q_k) / T
    for (Eigen::Index j = 0; j < rows; ++j) {
      acb_set(A.at(2 * n + i, j), A.at(i, j));
      if (i == j) acb_sub_ui(A.at(2 * n + i, j), A.at(2 * n + i, j), 1, kBits);
      acb_t T;
      acb_init(T);
      acb_set_d(T, loop.period);
      acb_div(A.at(2 * n + i, j), A.at(2 * n + i, j), T, kBits);
      acb_clear(T);
    }
  }
  for (Eigen::Index i = 0; i < d; ++i) {
    for (Eigen::Index j = 0; j < rows; ++j) {
      if (i + n < d) {
        if (j == queue + i + n) acb_one(A.at(queue + i, j));
      } else {
        acb_set(A.at(queue + i, j), command.at(i + n - d, j));
      }
    }
  }
  for (Eigen::Index i = 0; i < r; ++i) {
    for (Eigen::Index j = 0; j < rows; ++j) acb_set(A.at(filter + i, j), torque.at(i, j));
  }
  testing::BallMatrix vectors(rows, rows), about(1, rows), proved(1, rows);
  acb_mat_approx_eig_qr(about.at(0, 0), nullptr, vectors.get(), A.get(), nullptr, 0, kBits);
  if (acb_mat_eig_multiple(proved.at(0, 0), A.get(), about.at(0, 0), vectors.get(), kBits) == 0) {
    return std::nullopt;
  }
  bool all_inside = true, any_outside = false;
  arb_t modulus;
  arb_init(modulus);
  for (Eigen::Index i = 0; i < rows; ++i) {
    acb_abs(modulus, proved.at(0, i), kBits);
    arb_sub_ui(modulus, modulus, 1, kBits);
    all_inside = all_inside && arb_is_negative(modulus);
    any_outside = any_outside || arb_is_positive(modulus);
  }
  arb_clear(modulus);
  if (!all_inside && !any_outside) return std::nullopt;
  return all_inside;
}

/// Both ends of the bracket, and ten stiffnesses below it, have the verdict at 50 digits.
TEST(Contact, BracketsHoldAtFiftyDigits) {
  int brackets = 0, unknown = 0;
  for (std::uint64_t seed = 700; seed < 760; ++seed) {
    Random random(seed);
    const int n = random.integer(1, 3);
    System<> system = testing::random_system(random, n);
    SampledLoop loop = testing::random_loop(random);
    loop.friction = random.integer(0, 1) * 0.1 * system.damping;
    if (loop.friction.isZero(0)) loop.friction = MatrixXd::Zero(n, n);
    const Touch touch = touch_along(random.vector(n), 1e8);
    const ContactLimit found = limit_of(system, loop, touch);
    if (!(found.stiffness > 0) || std::isinf(found.stiffness)) continue;
    ASSERT_LT(found.lower, found.stiffness) << "no proof";
    ASSERT_GT(found.upper, found.stiffness) << "no proof";
    EXPECT_LT(found.upper - found.lower, 0.03 * found.stiffness);
    const auto check = [&](double k, bool stable) {
      const std::optional<bool> proved = proved_stable(system, loop, touch, k);
      unknown += proved ? 0 : 1;
      if (proved) EXPECT_EQ(*proved, stable) << k << " of " << found.stiffness;
    };
    check(found.lower, true);
    check(found.upper, false);
    for (int i = 0; i < 4; ++i) check(found.lower * random.log_uniform(1e-3, 1), true);
    ++brackets;
  }
  std::printf("%d brackets, %d verdicts not known\n", brackets, unknown);
  EXPECT_GT(brackets, 25);
  EXPECT_LT(unknown, 5);
}
#endif

/// With a difference of positions: D >= K T / 2 + |B| (Colgate and Schenkel 1997).
/// Where the touch turns by a multiple of pi in a tick, a loop may be unstable in a narrow band.
TEST(Contact, MissesNoNarrowBand) {
  constexpr int kLoops = 1000;
  constexpr double kStep = 1.004;
  int limits = 0;
  for (int seed = 5001; seed <= 5000 + kLoops; ++seed) {
    Random random(static_cast<std::uint64_t>(seed));
    const int n = random.integer(1, 4);
    const System<> system = testing::random_system(random, n);
    SampledLoop loop = testing::random_loop(random);
    loop.friction = random.integer(0, 1) * 0.1 * system.damping;
    const Touch touch = touch_along(random.vector(n), 1e8);
    if (loop.delay > 0) continue;  // whose limits come before half a turn
    const Spectrum<> spectrum = analyze(system);
    const double found = contact_limit(system, spectrum, loop, touch, false).stiffness;
    limits += found > 0 ? 1 : 0;
    std::vector<double> below;
    for (double k = 1e3; k < std::min(found, touch.most) * (1 - 1e-4); k *= kStep) {
      below.push_back(k);
    }
    for (const ContactPoint& point : contact_curve(system, spectrum, loop, touch, below)) {
      ASSERT_GT(point.damping_ratio, -1e-9) << point.stiffness << " of " << found;
    }
  }
  std::printf("%d limits\n", limits);
  EXPECT_GT(limits, kLoops / 10);
}

TEST(PortPassivity, OfOneJointIsThatOfColgateAndSchenkel) {
  Random random(620);
  for (int i = 0; i < 30; ++i) {
    SampledLoop loop;
    loop.period = random.log_uniform(1e-4, 1e-2);
    loop.difference_velocity = true;
    const double K = random.log_uniform(1, 1e5), B = random.uniform(-0.4, 1) * K * loop.period;
    const double least = 0.5 * K * loop.period + std::abs(B);
    for (const double share : {0.0, 0.999999, 1.000001}) {
      loop.friction = MatrixXd::Constant(1, 1, share * least);
      const PortPassivity found = port_passivity(one_joint(1, share * least + B, K), loop);
      EXPECT_EQ(found.passive, share > 1);
      EXPECT_NEAR(found.missing_friction, (1 - share) * least, 1e-9 * least);
      EXPECT_FALSE(found.instants);
    }
    loop.friction = MatrixXd::Constant(1, 1, 100 * least);
    loop.difference_velocity = false;
    EXPECT_FALSE(port_passivity(one_joint(1, 100 * least + B, K), loop).passive);
    EXPECT_TRUE(port_passivity(one_joint(1, 100 * least, K), loop).passive);  // no dampers
  }
}

/// A chain of masses on springs and dampers behind springs that touch some joints.
System<> behind(const System<>& system, SampledLoop& loop, Random& random) {
  const Eigen::Index n = system.dof(), m = random.integer(1, 3), all = n + m;
  System<> joined(all);
  joined.mass.topLeftCorner(n, n) = system.mass;
  joined.stiffness = joined.damping = MatrixXd::Zero(all, all);
  joined.stiffness.topLeftCorner(n, n) = system.stiffness;
  joined.damping.topLeftCorner(n, n) = system.damping;
  MatrixXd springs = MatrixXd::Zero(all, all), dampers = springs;
  VectorXd before = VectorXd::Zero(all);
  before.head(n) = random.vector(n);
  for (Eigen::Index i = 0; i <= m; ++i) {
    VectorXd stretch = before;
    before = VectorXd::Unit(all, std::min(n + i, all - 1));
    if (i < m) {
      stretch -= before;
      joined.mass(n + i, n + i) = random.log_uniform(1e-3, 10);
    }
    const double w = random.log_uniform(0.1, 5) / loop.period;  // about the Nyquist frequency
    springs += w * w * random.log_uniform(1e-2, 10) * stretch * stretch.transpose();
    dampers += random.integer(0, 1) * random.log_uniform(1e-3, 10) * stretch * stretch.transpose();
  }
  joined.stiffness += springs;
  joined.damping += dampers;
  loop.passive_stiffness = springs;
  dampers.topLeftCorner(n, n) += loop.friction;
  loop.friction = dampers;
  return joined;
}

TEST(PortPassivity, NoLoopThatIsCalledPassiveIsUnstable) {
  int passive = 0, unstable = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    Random random(seed);
    const int n = random.integer(1, 3);
    System<> system = testing::random_system(random, n);
    SampledLoop loop = testing::random_loop(random);
    loop.difference_velocity = true;
    loop.friction = MatrixXd::Zero(n, n);
    const double missing = port_passivity(system, loop).missing_friction;
    const double share = random.integer(0, 1) == 1 ? 1.001 : random.uniform(0.01, 0.9);
    loop.friction.diagonal().setConstant(share * missing);
    system.damping += loop.friction;
    const PortPassivity found = port_passivity(system, loop);
    EXPECT_EQ(found.passive, share > 1);
    EXPECT_NEAR(found.missing_friction, (1 - share) * missing, 1e-9 * missing);
    const System<> joined = behind(system, loop, random);
    const bool stable = testing::sample(joined, loop).spectral_radius < 1 + 1e-9;
    if (found.passive) EXPECT_TRUE(stable);
    passive += found.passive ? 1 : 0;
    unstable += stable ? 0 : 1;
  }
  EXPECT_GT(passive, 50);
  EXPECT_GT(unstable, 20);  // of the others
}

TEST(Contact, RefusesWhatIsNoTouch) {
  const System<> system = one_joint(1, 3, 10);
  const auto refusal = [&](const auto& change) {
    Touch touch = touch_along(VectorXd::Ones(1));
    change(touch);
    return testing::refusal<std::invalid_argument>([&] { limit_of(system, {}, touch); });
  };
  EXPECT_EQ(refusal([](Touch& touch) { touch.direction.setZero(2); }),
            "contact: direction has to have n finite entries");
  EXPECT_EQ(refusal([](Touch& touch) { touch.direction.setZero(); }),
            "contact: direction must not be zero");
  EXPECT_EQ(refusal([](Touch& touch) { touch.damping = -1; }),
            "contact: damping must be finite and not negative");
  EXPECT_EQ(refusal([](Touch& touch) { touch.mass = -1; }),
            "contact: mass must be finite and not negative");
}

}  // namespace
}  // namespace dashpot::analysis
