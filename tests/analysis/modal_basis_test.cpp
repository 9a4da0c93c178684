// Coordinates and drive of a modal basis, from bases that are exact by construction and from the
// solver's.
#include <dashpot/analysis/spectrum/modal_basis.hpp>
#include <dashpot/tests/support/made_to_measure.hpp>
#include <dashpot/tests/support/matrices.hpp>

#include <gtest/gtest.h>

#include <Eigen/LU>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::near;

/// [U; U Lambda]
MatrixXd states_of(const ModalBasis<>& basis) {
  MatrixXd Z(2 * basis.U.rows(), basis.U.cols());
  Z << basis.U, basis.U * basis.Lambda;
  return Z;
}

TEST(Coordinates, AreThoseOfTheStateInTheBasis) {
  testing::Random random(51);
  for (const auto& make : {&testing::make_system_of_every_kind, &testing::make_defective_system}) {
    const auto [system, spectrum] = make(random);
    const VectorXd xi = random.vector(8);
    const VectorXd state = states_of(spectrum.basis) * xi;
    const VectorXd found = coordinates<kDynamic>(spectrum.basis, system.mass, system.damping,
                                                 state.head(4), state.tail(4));
    EXPECT_TRUE(near(found, xi, 1e-11));
  }
}

TEST(Coordinates, AreRefinedWhereTheLeftBasisIsInexact) {
  testing::Random random(52);
  auto [system, spectrum] = testing::make_system_of_every_kind(random);
  spectrum.basis.weight *= 1 + 1e-7;
  const VectorXd xi = random.vector(8);
  const VectorXd state = states_of(spectrum.basis) * xi;
  const VectorXd found = coordinates<kDynamic>(spectrum.basis, system.mass, system.damping,
                                               state.head(4), state.tail(4));
  EXPECT_TRUE(near(found, xi, 1e-11));
}

TEST(Drive, IsTheChangeOfCoordinatesByAnImpulse) {
  testing::Random random(53);
  const auto [system, spectrum] = testing::make_system_of_every_kind(random);
  const VectorXd f = random.vector(4);
  const VectorXd jump = coordinates<kDynamic>(spectrum.basis, system.mass, system.damping,
                                              VectorXd::Zero(4), system.mass.lu().solve(f));
  EXPECT_TRUE(near(drive<kDynamic>(spectrum.basis, f), jump, 1e-11));
}

/// A system with r zero modes, which the damping couples with each other and with all others.
System<> coupled_system(testing::Random& random, Eigen::Index n, Eigen::Index r) {
  System<> system(n);
  const MatrixXd W = 5 * random.matrix(n - r, n);
  system.mass = random.spd(n);
  system.damping = random.spd(n);
  system.stiffness = W.transpose() * W;
  system.stiffness = (0.5 * (system.stiffness + system.stiffness.transpose())).eval();
  system.stiffness_factor = W;
  return system;
}

TEST(ModalBasis, OfTheSolverIsDualToItsLeftBasis) {
  testing::Random random(55);
  for (int i = 0; i < 60; ++i) {
    const Eigen::Index n = random.integer(1, 8);
    const Eigen::Index r = random.integer(0, static_cast<int>(std::min<Eigen::Index>(3, n)));
    const System<> system = coupled_system(random, n, r);
    const ModalBasis<> basis = analyze(system).basis;
    MatrixXd left(2 * n, 2 * n);
    left << basis.Y, basis.Y * basis.Gamma;
    MatrixXd B(2 * n, 2 * n);
    B << system.damping, system.mass, system.mass, MatrixXd::Zero(n, n);
    const MatrixXd product = basis.weight * left.transpose() * B * states_of(basis);
    EXPECT_TRUE(near(product, MatrixXd::Identity(2 * n, 2 * n), 1e-10)) << n << " " << r;
  }
}

}  // namespace
}  // namespace dashpot::analysis
