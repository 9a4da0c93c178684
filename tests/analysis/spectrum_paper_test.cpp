// The two printed examples of the source paper: to 1e-12 and 1e-10 of values computed with 50
// digits, and to the printed digits.
#include <dashpot/analysis/rigid_body_elimination.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/paper_examples.hpp>

#include <gtest/gtest.h>

#include <Eigen/LU>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using testing::as_printed;
using testing::near;

struct PrintedMode {
  Complex eigenvalue;
  double natural_frequency, damping_ratio;
};

const std::vector<PrintedMode> kChain = {
    {{-10.28839504266887, 38.88333579555115}, 40.22144794936655, 0.25579375102608415},
    {{-3.0241049573311303, 30.830377361579263}, 30.97833725444821, 0.09761998949433272}};

const std::vector<PrintedMode> kBaxter = {
    {{-1.4504229555768369, 14.54827018363473}, 14.620393020917717, 0.09920546961368856},
    {{-0.3116062954421416, 3.7008083761945434}, 3.7139037575940046, 0.08390263070360522},
    {{-0.18331924177375827, 3.066373457099634}, 3.071848323535794, 0.05967717884024693},
    {{-0.36608493594318725, 2.046069041097339}, 2.078561209409411, 0.17612420278313784},
    {{-0.04169565244480933, 0.8158846993645491}, 0.8169494293345084, 0.051038229476180474}};

void expect_modes(const Spectrum<>& spectrum, const std::vector<PrintedMode>& expected,
                  double tolerance) {
  ASSERT_EQ(spectrum.status, Status::kOk);
  ASSERT_EQ(spectrum.modes.size(), static_cast<int>(expected.size()));
  for (int i = 0; i < spectrum.modes.size(); ++i) {
    SCOPED_TRACE("mode " + std::to_string(i + 1));
    const Mode<>& mode = spectrum.modes[i];
    const PrintedMode& truth = expected[static_cast<std::size_t>(i)];
    const double size = std::abs(truth.eigenvalue);
    EXPECT_LE(std::abs(mode.eigenvalues[0] - truth.eigenvalue), tolerance * size);
    EXPECT_EQ(mode.eigenvalues[1], std::conj(mode.eigenvalues[0]));
    EXPECT_EQ(mode.damped_frequency, mode.eigenvalues[0].imag());
    EXPECT_NEAR(mode.natural_frequency, truth.natural_frequency, tolerance * size);
    EXPECT_NEAR(mode.damping_ratio, truth.damping_ratio, tolerance * truth.damping_ratio);
    EXPECT_EQ(mode.kind, ModeKind::kUnderdamped);
  }
}

/// [0 I; -M^-1 K  -M^-1 C]
MatrixXd state_matrix(const System<>& system) {
  const Eigen::Index n = system.dof();
  const auto lu = system.mass.lu();
  MatrixXd A(2 * n, 2 * n);
  A << MatrixXd::Zero(n, n), MatrixXd::Identity(n, n), -lu.solve(system.stiffness),
      -lu.solve(system.damping);
  return A;
}

System<> reduced(const System<>& system, const Spectrum<>& spectrum) {
  const RigidBodyElimination elimination =
      eliminate_zero_modes(system, spectrum.zero_modes, Pivot::kLast);
  System<> result(elimination.mass.rows());
  result.mass = elimination.mass;
  result.damping = elimination.damping;
  result.stiffness = elimination.stiffness;
  return result;
}

/// The first eigenvector [u; lambda u] of a mode, of length 1; its largest entry real and positive,
/// as printed.
Eigen::VectorXcd printed_eigenvector(const Mode<>& mode) {
  const Eigen::VectorXcd& u = mode.shapes[0];
  Eigen::VectorXcd x(2 * u.size());
  x << u, mode.eigenvalues[0] * u;
  Eigen::Index largest = 0;
  x.cwiseAbs().maxCoeff(&largest);
  return x * (std::abs(x(largest)) / (x(largest) * x.norm()));
}

TEST(SpectrumOfPaperChain, HasTheModesOfTable2) {
  const Spectrum<> spectrum = analyze(testing::paper_chain());
  expect_modes(spectrum, kChain, 1e-12);
  // 30.97 and 0.255 are cut, not rounded.
  Eigen::Matrix2d table;
  table << spectrum.modes[1].natural_frequency, spectrum.modes[0].natural_frequency,
      spectrum.modes[1].damping_ratio, spectrum.modes[0].damping_ratio;
  EXPECT_TRUE(as_printed(table, {{"30.97", "40.22"}, {"0.0976", "0.255"}}, 1));
}

TEST(SpectrumOfPaperChain, DriftsAlongU0OfEquation39) {
  const Spectrum<> spectrum = analyze(testing::paper_chain());
  ASSERT_EQ(spectrum.zero_modes.count, 1);
  const MatrixXd u0 = spectrum.zero_modes.basis * (spectrum.zero_modes.basis(0, 0) < 0 ? -1 : 1);
  EXPECT_TRUE(as_printed(u0, {{"0.2582"}, {"0.2582"}, {"0.2582"}}, 0.5));
  EXPECT_TRUE(near(u0, MatrixXd::Constant(3, 1, 1 / std::sqrt(15.0)), 1e-15));
  EXPECT_FALSE(spectrum.coupled);
  EXPECT_TRUE(near(spectrum.zero_mode_rates, MatrixXd::Zero(1, 1), 0));
}

TEST(SpectrumOfPaperChain, HasTheEigenvectorsOfEquation45) {
  const System<> full = testing::paper_chain();
  const System<> system = reduced(full, analyze(full));
  EXPECT_TRUE(as_printed(state_matrix(system),
                         {{"0.0", "0.0", "1.0", "0.0"},
                          {"0.0", "0.0", "0.0", "1.0"},
                          {"-930.000000", "30.000000", "-5.125000", "1.375000"},
                          {"-600.000000", "-1650.000000", "-8.500000", "-21.500000"}},
                         0.5));
  const Spectrum<> spectrum = analyze(system);
  expect_modes(spectrum, kChain, 1e-12);
  // The paper prints -3.024 + 30.83i first, then its conjugate, then the other pair; ours come by
  // falling frequency. Misprints: X[1,1] = -0.002473 - 0.02522i (printed 0.2522), and
  // Re X[3,3] = -0.06306 (printed -0.6306).
  MatrixXcd X(4, 2);
  X << printed_eigenvector(spectrum.modes[1]), printed_eigenvector(spectrum.modes[0]);
  EXPECT_TRUE(as_printed(X.real(),
                         {{"-0.002473", "-0.0003004"},
                          {"0.006034", "-0.006342"},
                          {"0.7849", "-0.06306"},
                          {"-0.6053", "0.9973"}},
                         1));
  EXPECT_TRUE(as_printed(X.imag(),
                         {{"-0.02522", "0.001701"},
                          {"0.01904", "-0.02397"},
                          {"0.0000", "-0.02918"},
                          {"0.1284", "0.0000"}},
                         1));
}

TEST(PaperBaxter, HasTheModesOfTable4) {
  const Spectrum<> spectrum = analyze(to_joint_space(testing::paper_baxter()));
  EXPECT_EQ(spectrum.zero_modes.count, 2);
  expect_modes(spectrum, kBaxter, 1e-10);
  MatrixXd table(2, 5);
  for (int i = 0; i < 5; ++i) {
    table(0, i) = spectrum.modes[i].natural_frequency;
    table(1, i) = spectrum.modes[i].damping_ratio;
  }
  // The fifth ratio is printed as 0.510, but -0.04169 + 0.8158i has 0.0510.
  EXPECT_TRUE(as_printed(table,
                         {{"14.6", "3.71", "3.07", "2.08", "0.817"},
                          {"0.0992", "0.0839", "0.0597", "0.176", "0.0510"}},
                         1));
}

TEST(PaperBaxter, StaysTheSameWithoutFactorAndTails) {
  System<> system = to_joint_space(testing::paper_baxter());
  system.stiffness_factor.resize(0, 7);
  system.has_low_words = false;
  const Spectrum<> spectrum = analyze(system);
  EXPECT_EQ(spectrum.zero_modes.count, 2);
  expect_modes(spectrum, kBaxter, 1e-10);
}

TEST(PaperBaxter, HasItsModesWithoutZeroModes) {
  const System<> full = to_joint_space(testing::paper_baxter());
  expect_modes(analyze(reduced(full, analyze(full))), kBaxter, 1e-10);
}

}  // namespace
}  // namespace dashpot::analysis
