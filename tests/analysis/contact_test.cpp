// Stability of a sampled loop in contact: against closed forms, balls of Arb and random passive
// worlds.
#include <dashpot/analysis/contact_limit.hpp>
#include <dashpot/analysis/sampled_loop.hpp>
#if defined(DASHPOT_HAVE_ARB)
#include <dashpot/tests/support/proved_contact.hpp>
#endif
#include <dashpot/tests/support/refusal.hpp>
#include <dashpot/tests/support/sampled_loops.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>
#include <Eigen/QR>

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

/// Factors of the gains, and the rigid world, against loops with such matrices.
TEST(Contact, SharesAndTheRigidWorldAreOtherLoops) {
  int unstable = 0;
  for (std::uint64_t seed = 640; seed < 700; ++seed) {
    Random random(seed);
    const int n = random.integer(2, 4);
    const System<> system = testing::random_system(random, n);
    SampledLoop loop = testing::random_loop(random);
    loop.friction = 0.1 * system.damping;
    Touch touch = touch_along(random.vector(n));
    System<> other = system;
    other.stiffness *= 0.5;
    other.damping = 1.45 * system.damping;
    const ContactLimit expected = limit_of(other, loop, touch);
    touch.stiffness_share = 0.5;
    touch.damping_share = 1.5;
    const ContactLimit found = limit_of(system, loop, touch);
    EXPECT_EQ(std::isinf(found.stiffness), std::isinf(expected.stiffness));
    if (std::isfinite(found.stiffness)) {
      EXPECT_NEAR(found.stiffness, expected.stiffness, 1e-6 * expected.stiffness);
    }
    const Eigen::HouseholderQR<MatrixXd> qr(touch.direction);
    const MatrixXd Q = MatrixXd(qr.householderQ()).rightCols(n - 1);
    System<> held(n - 1);
    held.mass = Q.transpose() * system.mass * Q;
    held.damping = Q.transpose() * other.damping * Q;
    held.stiffness = Q.transpose() * other.stiffness * Q;
    loop.friction = (Q.transpose() * loop.friction * Q).eval();
    const bool stable = testing::sample(held, loop).stable();
    EXPECT_EQ(found.stable_if_rigid, stable);
    unstable += stable ? 0 : 1;
  }
  EXPECT_GT(unstable, 3);
}

#if defined(DASHPOT_HAVE_ARB)
/// Both ends of the bracket, and four stiffnesses below it, have the verdict at 50 digits;
/// `./run stress contact` does this with 1,000 loops.
TEST(Contact, BracketsHoldAtFiftyDigits) {
  int brackets = 0, unknown = 0;
  for (std::uint64_t seed = 700; seed < 760; ++seed) {
    Random random(seed);
    const testing::RandomTouch touched(random, seed >= 730);
    const ContactLimit found = touched.limit();
    if (!(found.stiffness > 0) || std::isinf(found.stiffness)) continue;
    ASSERT_LT(found.lower, found.stiffness) << "no proof";
    ASSERT_GT(found.upper, found.stiffness) << "no proof";
    EXPECT_LT(found.upper - found.lower, 0.03 * found.stiffness);
    const auto check = [&](double k, bool stable) {
      const std::optional<bool> proved = testing::proved_stable(touched, k);
      unknown += proved ? 0 : 1;
      if (!proved) return;
      EXPECT_EQ(*proved, stable) << k << " of " << found.stiffness;
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

/// With a difference of positions: D >= K T / 2 + |B| (Colgate and Schenkel 1997).
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

/// The missing friction is 2 sin(theta / 2)^2 K T / theta^2 - (C - D) sin(theta) / theta at most.
TEST(PortPassivity, OfVelocitiesMeasuredAtAnInstant) {
  constexpr double kStiffness = 1000, kCrossing = 2.7864;  // tan(theta / 2) = 2 theta
  const SampledLoop loop;
  const double T = loop.period, nyquist = std::numbers::pi / T;
  const PortPassivity found = port_passivity(one_joint(1, 2 * kStiffness * T, kStiffness), loop);
  EXPECT_TRUE(found.instants);
  EXPECT_NEAR(found.missing_friction, 2 * kStiffness * T / std::pow(std::numbers::pi, 2), 1e-9);
  EXPECT_NEAR(found.frequency, nyquist, 1e-9 * nyquist);
  EXPECT_NEAR(found.from, kCrossing / T, 0.01 * nyquist);
  EXPECT_NEAR(found.to, nyquist, 1e-9 * nyquist);
}

/// Springs in a memory are late springs; the world's springs and gravity are not the controller's.
TEST(PortPassivity, SeparatesTheController) {
  const MatrixXd K = MatrixXd::Constant(1, 1, 1000), one = MatrixXd::Ones(1, 1);
  SampledLoop plain, late, memory;
  late.delay = 1;
  memory.memory = {0 * one, one, K};
  const double missing = port_passivity(one_joint(1, 0, 1000), plain).missing_friction;
  EXPECT_NEAR(missing, 0.5, 1e-9);  // K T / 2
  const double later = port_passivity(one_joint(1, 0, 1000), late).missing_friction;
  EXPECT_GT(later, 2 * missing);
  EXPECT_NEAR(port_passivity(one_joint(1, 0, 0), memory).missing_friction, later, 1e-9);
  SampledLoop world;
  world.passive_stiffness = 3 * K;
  EXPECT_NEAR(port_passivity(one_joint(1, 0, 4000), world).missing_friction, missing, 1e-9);
  SampledLoop heavy;
  heavy.compensation = -K;
  heavy.friction = 5 * one;
  const PortPassivity held = port_passivity(one_joint(1, 5, 1000), heavy);
  EXPECT_NEAR(held.missing_friction, 2 * missing - 5, 1e-9);
  EXPECT_TRUE(held.passive);
  heavy.gravity_gradient = -2.1 * K;  // it falls over
  EXPECT_FALSE(port_passivity(one_joint(1, 5, 1000), heavy).passive);
  heavy.gravity_gradient = -1.9 * K;
  EXPECT_TRUE(port_passivity(one_joint(1, 5, 1000), heavy).passive);
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
    EXPECT_TRUE(stable || !found.passive);
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
