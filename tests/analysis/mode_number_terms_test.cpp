// Each term of the bounds of eigenvalues, frequencies and ratios, in a case that is not enclosed
// without it.
#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/spectrum/enclosure.hpp>
#include <dashpot/analysis/spectrum/mode_numbers.hpp>
#include <dashpot/analysis/spectrum/modes.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <numbers>

namespace dashpot::analysis {
namespace {

using Eigen::Matrix2d;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::LongComplex;
using testing::LongMatrix;
using testing::Random;

// ------------------------------------------------------------------- from a block to eigenvalues

/// Modes of a basis of one block for each list of columns, with given radii and groups.
Spectrum<> modes_of(const System<>& system, const MatrixXd& Lambda, const MatrixXd& U,
                    const std::vector<int>& sizes, const BlockEnclosure<>& enclosure) {
  Spectrum<> spectrum;
  spectrum.basis.U = U;
  spectrum.basis.Lambda = Lambda;
  int first = 0;
  for (const int size : sizes) {
    spectrum.basis.blocks.push_back({first, size, false});
    first += size;
  }
  BasisResidual<> residual;
  evaluate_residual<kDynamic>(system, false, false, spectrum.basis, residual);
  read_modes<kDynamic>(system, residual, enclosure, 0, spectrum);
  return spectrum;
}

TEST(ModeNumberTerms, DiscsThatMeetCountAsOne) {
  // Discs of 0.1 around -1 and -1.19, one group: both eigenvalues may be at -1.29.
  const System<> system = testing::system_from(
      MatrixXd::Identity(1, 1), MatrixXd::Constant(1, 1, 2.19), MatrixXd::Constant(1, 1, 1.19));
  for (const bool grouped : {true, false}) {
    BlockEnclosure<> enclosure;
    enclosure.radius = VectorXd::Constant(2, 0.1);
    enclosure.group = Eigen::Vector2i(0, grouped ? 0 : 1);
    const Spectrum<> spectrum = modes_of(system, Eigen::Vector2d(-1, -1.19).asDiagonal(),
                                         MatrixXd::Ones(1, 2), {1, 1}, enclosure);
    ASSERT_EQ(spectrum.modes.size(), 1);
    if (grouped) {
      EXPECT_GE(spectrum.modes[0].error_bound, 0.29 - 1e-12);
    } else {
      EXPECT_NEAR(spectrum.modes[0].error_bound, 0.1, 1e-12);
    }
  }
}

TEST(ModeNumberTerms, OfABlockInAGroupOnlyTheDiscsAreKnown) {
  // Two equal oscillators. diag(L, L) + [0 e; e 0] is within e, in the spectral norm, and has the
  // eigenvalues of L + e and of L - e: their sums move by 2 e, not by the sqrt(2) e of one block.
  const double c = 0.02, e = 1e-3;
  const System<> system = testing::system_from(
      MatrixXd::Identity(2, 2), c * MatrixXd::Identity(2, 2), MatrixXd::Identity(2, 2));
  MatrixXd Lambda = MatrixXd::Zero(4, 4), U = MatrixXd::Zero(2, 4);
  for (const int i : {0, 1}) {
    Lambda.block<2, 2>(2 * i, 2 * i) << 0, 1, -1, -c;
    U(i, 2 * i) = 1;
  }
  BlockEnclosure<> enclosure;
  enclosure.radius = VectorXd::Constant(2, e);
  enclosure.group = Eigen::Vector2i(0, 0);
  const Spectrum<> spectrum = modes_of(system, Lambda, U, {2, 2}, enclosure);
  ASSERT_EQ(spectrum.modes.size(), 2);
  for (const Mode<>& mode : spectrum.modes) {
    for (const double moved : {-e, e}) {
      const Complex value = mode.eigenvalues[0] + moved;
      EXPECT_LE(std::abs(-value.real() / std::abs(value) - mode.damping_ratio),
                mode.damping_ratio_bound);
      EXPECT_LE(std::abs(std::abs(value) - mode.natural_frequency), mode.natural_frequency_bound);
    }
  }
}

TEST(ModeNumberTerms, RatesOfZeroModesMayMeetOtherEigenvalues) {
  // 0 and the rate in one block, or in two of one group, with discs that meet.
  const double a = 0.1, radius = 0.08;
  for (const bool one_block : {true, false}) {
    Spectrum<> spectrum;
    spectrum.zero_modes.count = 1;
    spectrum.zero_modes.basis = MatrixXd::Ones(1, 1);
    ModalBasis<>& basis = spectrum.basis;
    basis.U = Eigen::RowVector2d(1, one_block ? 0 : 1);
    basis.Lambda = Eigen::Vector2d(0, -a).asDiagonal();
    basis.Lambda(0, 1) = one_block ? 1 : 0;
    basis.blocks.push_back({0, one_block ? 2 : 1, true});
    if (!one_block) basis.blocks.push_back({1, 1, false});
    BlockEnclosure<> enclosure;
    enclosure.radius = VectorXd::Constant(basis.blocks.size(), radius);
    enclosure.group = Eigen::VectorXi::Zero(basis.blocks.size());
    const System<> system = testing::one_joint(1, a, 0);
    BasisResidual<> residual;
    evaluate_residual<kDynamic>(system, false, false, basis, residual);
    read_modes<kDynamic>(system, residual, enclosure, 0, spectrum);
    ASSERT_EQ(spectrum.zero_mode_rates.size(), 1);
    EXPECT_EQ(spectrum.zero_mode_rates[0], -a);
    const std::array<Complex, 2> values{0, -a};
    const double disc =
        one_block ? disc_radius(values.data(), 2, 0, basis.Lambda.norm(), radius) : radius;
    EXPECT_GE(spectrum.zero_mode_rates_bound[0], a + disc);
  }
}

TEST(ModeNumberTerms, RoundingErrorsOfEigenvaluesOfABlock) {
  Random random(2405);
  std::array<double, 2> largest{};
  for (int trial = 0; trial < 300; ++trial) {
    const int n = trial % 2 == 0 ? 1 : random.integer(2, 4);
    System<> system =
        testing::system_from(MatrixXd::Identity(n, n), random.matrix(n, n), random.spd(n) * 4);
    if (trial % 4 == 0) {  // nearly critical: the discriminant cancels
      const double away = random.log_uniform(1e-12, 1e-3);
      system.damping(0, 0) = 2 * std::sqrt(system.stiffness(0, 0)) * (1 + away);
    }
    MatrixXd A(2 * n, 2 * n);
    A << MatrixXd::Zero(n, n), MatrixXd::Identity(n, n), -system.stiffness, -system.damping;
    MatrixXd U(n, 2 * n);
    U << MatrixXd::Identity(n, n), MatrixXd::Zero(n, n);
    BlockEnclosure<> enclosure;
    enclosure.radius = VectorXd::Zero(1);
    enclosure.group = Eigen::VectorXi::Zero(1);
    const Spectrum<> spectrum = modes_of(system, A, U, {2 * n}, enclosure);
    const std::vector<LongComplex> truth = testing::true_eigenvalues(system);
    for (const Mode<>& mode : spectrum.modes) {
      for (const Complex& value : mode.eigenvalues) {
        const long double error = testing::distance_to_nearest(value, truth);
        EXPECT_LE(error, mode.error_bound) << "trial " << trial;
        double& worst = largest[n == 1 ? 0 : 1];
        worst = std::max(worst, static_cast<double>(error) / mode.error_bound);
      }
    }
  }
  EXPECT_GT(largest[0], 0.005);
  EXPECT_GT(largest[1], 1e-6);
}

// ------------------------------------------------------------------------ from eigenvalues to
// modes

/// Largest shares of the errors of sum, product and discriminant that any truth has taken.
struct InvariantShares {
  std::array<double, 3> worst{};

  void take(const Invariants& v, const std::array<long double, 3>& exact) {
    const std::array<double, 3> found = {v.sum, v.product, v.discriminant};
    const std::array<double, 3> bounds = {v.sum_error, v.product_error, v.discriminant_error};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto error =
          static_cast<double>(std::abs(exact[k] - static_cast<long double>(found[k])));
      EXPECT_LE(error, bounds[k] * (1 + 1e-12)) << k;
      if (error > 0) worst[k] = std::max(worst[k], error / bounds[k]);
    }
  }
  /// The matrix at the distance rho from L in this direction.
  void take(const Matrix2d& L, const Matrix2d& direction, double rho) {
    const LongMatrix A = L.cast<long double>() + static_cast<long double>(rho) *
                                                     direction.cast<long double>() /
                                                     direction.cast<long double>().norm();
    const long double half = (A(0, 0) - A(1, 1)) / 2, product = A(0, 1) * A(1, 0);
    take(block_invariants(L(0, 0), L(0, 1), L(1, 0), L(1, 1), rho),
         {A(0, 0) + A(1, 1), A(0, 0) * A(1, 1) - product, half * half + product});
  }
  void expect_above(double share) const {
    for (const double of_one : worst) EXPECT_GT(of_one, share);
  }
};

TEST(ModeNumberTerms, InvariantsOfABlockAreWithinTheirErrors) {
  Random random(2406);
  InvariantShares attained, quadratic, rounding;
  const Matrix2d identity = Matrix2d::Identity();
  for (int trial = 0; trial < 500; ++trial) {
    const Matrix2d L = random.matrix(2, 2);
    Matrix2d adjugate;  // transposed: the gradient of the determinant
    adjugate << L(1, 1), -L(1, 0), -L(0, 1), L(0, 0);
    const Matrix2d traceless = L.transpose() - 0.5 * L.trace() * identity;
    const double rho = random.log_uniform(1e-6, 1e-3);
    for (const Matrix2d& direction : {identity, adjugate, traceless}) {
      attained.take(L, direction, rho);
    }
    rounding.take(L, L, 0);
    rounding.take(1e3 * identity + L, L, 0);
  }
  attained.expect_above(0.99);
  rounding.expect_above(0.02);  // some of the four or eight that are allowed
  quadratic.take(Matrix2d::Zero(), identity, 0.1);
  quadratic.take(Matrix2d::Zero(), Matrix2d(identity.rowwise().reverse()), 0.1);
  quadratic.expect_above(0.99);
}

TEST(ModeNumberTerms, InvariantsOfTwoRootsAreWithinTheirErrors) {
  Random random(2407);
  InvariantShares attained, rounding;
  for (int trial = 0; trial < 2000; ++trial) {
    const bool exact = trial % 2 == 0;
    // Real ones, or a pair whose second root is the conjugate.
    const bool real = random.integer(0, 1) == 0;
    Root a, b;
    a.value = Complex(random.uniform(-2, 2), real ? 0 : random.uniform(0.1, 2));
    b.value = real ? Complex(random.uniform(-2, 2)) : std::conj(a.value);
    a.bound = exact ? 0 : random.log_uniform(1e-6, 0.5);
    b.bound = exact ? 0 : real ? random.log_uniform(1e-6, 0.5) : a.bound;
    for (int turn = 0; turn < 16; ++turn) {
      const auto moved = [](const Root& root, long double by) {
        return LongComplex(root.value) + static_cast<long double>(root.bound) *
                                             std::polar(1.0L, by * std::numbers::pi_v<long double>);
      };
      const LongComplex p = moved(a, real ? turn % 2 : turn / 8.0L);
      const LongComplex q = real ? moved(b, turn / 2 % 2) : std::conj(p), half = (p - q) / 2.0L;
      (exact ? rounding : attained)
          .take(root_invariants(a, b), {(p + q).real(), (p * q).real(), (half * half).real()});
    }
  }
  attained.expect_above(0.99);
  rounding.expect_above(0.05);
}

TEST(ModeNumberTerms, FrequencyAndRatioAreWithinTheirBounds) {
  Random random(2408);
  std::array<double, 2> omega_share{}, zeta_share{};  // of errors, and of rounding alone
  for (int trial = 0; trial < 4000; ++trial) {
    const bool exact = trial % 2 == 0;
    Invariants v;
    v.product = random.log_uniform(1e-3, 1e3);
    v.sum = random.uniform(-2, 2) * std::sqrt(v.product);
    v.discriminant = v.sum * v.sum / 4 - v.product;
    v.sum_error = exact ? 0 : random.uniform(0, 0.5) * std::abs(v.sum);
    v.product_error = exact ? 0 : random.uniform(0, 0.99) * v.product;
    v.discriminant_error = 0;
    const ModeNumbers mode = mode_numbers({{-1, 1}, 0}, {{-1, -1}, 0}, v, 0);
    // What the frequency may err by, and the rounding error of the division by it.
    EXPECT_GE(mode.damping_ratio_bound, 5 * kUnit * std::abs(mode.damping_ratio));
    const auto take = [&](long double error, double bound, std::array<double, 2>& share) {
      EXPECT_LE(error, static_cast<long double>(bound));
      double& worst = share[exact ? 1 : 0];
      worst = std::max(worst, static_cast<double>(error) / bound);
    };
    const auto wide = [](double x) { return static_cast<long double>(x); };
    for (const int signs : {0, 1, 2, 3}) {
      const long double product =
          wide(v.product) + (signs % 2 == 0 ? 1 : -1) * wide(v.product_error);
      const long double sum = wide(v.sum) + (signs / 2 == 0 ? 1 : -1) * wide(v.sum_error);
      const long double omega = std::sqrt(product), zeta = -sum / (2 * omega);
      take(std::abs(omega - wide(mode.natural_frequency)), mode.natural_frequency_bound,
           omega_share);
      take(std::abs(zeta - wide(mode.damping_ratio)), mode.damping_ratio_bound, zeta_share);
    }
  }
  EXPECT_GT(omega_share[0], 0.999);
  EXPECT_GT(zeta_share[0], 0.999);
  EXPECT_GT(omega_share[1], 0.1);
  EXPECT_GT(zeta_share[1], 0.05);
}

}  // namespace
}  // namespace dashpot::analysis
