// Damping matrices of a structure, near a given one, and for many configurations.
#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/analysis/damping_region.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random_arms.hpp>
#include <dashpot/tests/support/refusal.hpp>
#include <dashpot/tests/support/sanitized.hpp>
#include <dashpot/tests/support/special_values.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::kInfinity;
using testing::near;
using testing::path_of_configurations;
using testing::Random;
using testing::random_arm;

double sum_of_squares(const Spectrum<>& spectrum, double zeta) {
  double sum = 0;
  for (const Mode<>& mode : spectrum.modes) {
    sum += (mode.damping_ratio - zeta) * (mode.damping_ratio - zeta);
  }
  return sum;
}

double sum_with(const TaskImpedance& arm, const MatrixXd& damping, double zeta) {
  return sum_of_squares(analyze(to_joint_space(with_damping(arm, damping))), zeta);
}

/// With zeros where the structure has them.
MatrixXd within(MatrixXd A, DampingStructure structure) {
  for (Index j = 0; j < A.cols(); ++j) {
    for (Index i = 0; i < A.rows(); ++i) {
      const bool free = i == j || structure == DampingStructure::kFull ||
                        (structure == DampingStructure::kBlock && (i < 3) == (j < 3));
      if (!free) A(i, j) = 0;
    }
  }
  return A;
}

MatrixXd symmetric(const MatrixXd& A) {
  return 0.5 * (A + A.transpose());
}

double smallest_ratio(const Spectrum<>& spectrum) {
  double smallest = kInfinity;
  for (const Mode<>& mode : spectrum.modes) smallest = std::min(smallest, mode.damping_ratio);
  return smallest;
}

std::string name_of(const ::testing::TestParamInfo<DampingStructure>& info) {
  return info.param == DampingStructure::kBlock ? "Block" : "Diagonal";
}

class Structure : public ::testing::TestWithParam<DampingStructure> {};
INSTANTIATE_TEST_SUITE_P(Designs, Structure,
                         ::testing::Values(DampingStructure::kBlock, DampingStructure::kDiagonal),
                         name_of);

TEST_P(Structure, GivesALargerSmallestRatioThanLeastSquaresAndThanEntriesLeftOut) {
  const DampingStructure structure = GetParam();
  const DampingTarget target = DampingTarget::constant(0.7);
  Random random(7313);
  int better = 0;
  for (int i = 0; i < 12; ++i) {
    const TaskImpedance arm = random_arm(random, 7, 6, 10, 30);
    const MatrixXd exact = design_damping(arm, target).damping;
    const double least_squares =
        smallest_ratio(design_damping(arm, target, structure, exact).spectrum);
    const double left_out =
        smallest_ratio(analyze(to_joint_space(with_damping(arm, within(exact, structure)))));
    const double found = smallest_ratio(design_damping(arm, target, structure).spectrum);
    EXPECT_GE(found, std::max(least_squares, left_out) - 1e-9) << "system " << i;
    if (found > std::max(least_squares, left_out) + 0.01) ++better;
  }
  EXPECT_GE(better, 3);
}

TEST_P(Structure, IsKeptAndNoSmallChangeNearAStartDoesBetter) {
  const DampingStructure structure = GetParam();
  Random random(7301);
  for (int i = 0; i < 12; ++i) {
    const TaskImpedance arm = random_arm(random, 7, 6, 10, 30);
    const DampingTarget target = DampingTarget::constant(0.3);
    const DampingDesign design =
        design_damping(arm, target, structure, design_damping(arm, target).damping);
    SCOPED_TRACE("system " + std::to_string(i));
    const MatrixXd& C = design.damping;
    EXPECT_EQ(C, within(C, structure));
    EXPECT_EQ(negative_eigenvalues(C).size(), 0);
    if (design.misses.empty()) continue;
    const double sum = sum_of_squares(design.spectrum, 0.3);
    for (const DampingMiss& miss : design.misses) {
      EXPECT_EQ(miss.reason, DampingMiss::Reason::kStructure);
      EXPECT_EQ(miss.obtained, design.spectrum.modes[miss.mode].damping_ratio);
    }
    for (int k = 0; k < 40; ++k) {  // S (1 + E)(1 + E)' S, the structure's congruences
      const MatrixXd T = MatrixXd::Identity(6, 6) + within(1e-3 * random.matrix(6, 6), structure);
      EXPECT_GE(sum_with(arm, symmetric(T * C * T.transpose()), 0.3), sum * (1 - 2e-3));
    }
  }
}

TEST(DiagonalDesign, FindsTheExactOneWhereThereIsOne) {
  Random random(7302);
  for (int i = 0; i < 20; ++i) {
    TaskImpedance arm;
    arm.mass = VectorXd(random.vector(6).cwiseAbs().array() + 0.2).asDiagonal();
    arm.jacobian = MatrixXd::Identity(6, 6);
    arm.task_stiffness = VectorXd((random.vector(6).array() + 5).exp()).asDiagonal();
    const VectorXd expected =
        1.4 * arm.mass.diagonal().cwiseProduct(arm.task_stiffness->diagonal()).cwiseSqrt();
    // From far away, too.
    const MatrixXd start = 10 * MatrixXd::Identity(6, 6);
    for (const auto& from : {std::optional<MatrixXd>(), std::optional<MatrixXd>(start)}) {
      const DampingDesign design =
          design_damping(arm, DampingTarget::constant(0.7), DampingStructure::kDiagonal, from);
      EXPECT_TRUE(design.misses.empty());
      EXPECT_TRUE(near(design.damping.diagonal(), expected, 1e-7 * expected.maxCoeff()));
    }
  }
}

TEST(DesignNearAStart, ReachesTheTargetAndStaysThere) {
  Random random(7303);
  for (int i = 0; i < 20; ++i) {
    const TaskImpedance arm = random_arm(random, 7, 6, 10, 30);
    const DampingTarget target = DampingTarget::constant(0.5);
    const MatrixXd exact = design_damping(arm, target).damping;
    const MatrixXd T = MatrixXd::Identity(6, 6) + 0.05 * random.matrix(6, 6);
    const MatrixXd start = symmetric(T * exact * T.transpose());
    const DampingDesign design = design_damping(arm, target, DampingStructure::kFull, start);
    EXPECT_TRUE(design.misses.empty());
    EXPECT_EQ(negative_eigenvalues(design.damping).size(), 0);
    const VectorXd unit = start.diagonal().cwiseSqrt().cwiseInverse();
    const auto size = [&unit](const MatrixXd& A) {
      return MatrixXd(unit.asDiagonal() * A * unit.asDiagonal()).norm();
    };
    // No further from the start than the closed form is.
    EXPECT_LE(size(design.damping - start), size(exact - start));
    const DampingDesign same = design_damping(arm, target, DampingStructure::kFull, exact);
    EXPECT_TRUE(near(same.damping, exact, 1e-8 * exact.norm()));
  }
}

TEST(DesignNearAStart, GoesAsFarAsTheTargetIs) {
  // A search from the start gets stuck where two modes coincide on the way.
  Random random(7305);
  for (int i = 0; i < 60; ++i) {
    const TaskImpedance arm = random_arm(random, 5, 3, 10, 30);
    const MatrixXd exact = design_damping(arm, DampingTarget::constant(0.7)).damping;
    const MatrixXd other = random.spd(3);
    const MatrixXd start = symmetric(exact.trace() / other.trace() * other);
    const DampingDesign design =
        design_damping(arm, DampingTarget::constant(0.7), DampingStructure::kFull, start);
    EXPECT_TRUE(design.misses.empty());
    for (const DampingMiss& miss : design.misses) EXPECT_EQ(miss.obtained, 0.7);
  }
}

TEST(DesignNearAStart, RefusesOneThatIsNoDamping) {
  Random random(7304);
  const TaskImpedance arm = random_arm(random, 7, 6);
  MatrixXd start = MatrixXd::Identity(6, 6);
  start(0, 1) = start(1, 0) = 2;
  EXPECT_THROW(design_damping(arm, {}, DampingStructure::kFull, start), InvalidSystem);
  start(0, 1) = 0;
  EXPECT_THROW(design_damping(arm, {}, DampingStructure::kFull, start), InvalidSystem);
  EXPECT_EQ(testing::refusal<InvalidSystem>([&] {
              design_damping(arm, {}, DampingStructure::kFull, MatrixXd::Identity(5, 5));
            }),
            "task_damping: is 5 x 5, expected 6 x 6");
}

/// Two joints, two directions: small enough to try all diagonal matrices.
TEST(LargestSmallestRatio, IsThatOfAnExhaustiveSearch) {
  DASHPOT_SKIP_IF_QUICK();
  Random random(7306);
  for (int i = 0; i < 4; ++i) {
    const std::vector<TaskImpedance> region = {random_arm(random, 2, 2, 5, 5),
                                               random_arm(random, 2, 2, 5, 5)};
    RegionOptions options;
    options.target = DampingTarget::constant(0.7);
    options.structure = DampingStructure::kDiagonal;
    options.ceiling = 0.8;
    const RegionDesign design = design_region(region, options);
    EXPECT_LE(design.violation, 2e-7);
    double best = 0;
    const double scale = design.damping.diagonal().maxCoeff();
    for (double a = 1e-3 * scale; a < 4 * scale; a *= 1.08) {
      for (double b = 1e-3 * scale; b < 4 * scale; b *= 1.08) {
        double least = 1, largest = 0;
        for (const TaskImpedance& arm : region) {
          const MatrixXd C = Eigen::Vector2d(a, b).asDiagonal();
          for (const Mode<>& mode : analyze(to_joint_space(with_damping(arm, C))).modes) {
            least = std::min(least, mode.damping_ratio / 0.7);
            largest = std::max(largest, mode.damping_ratio);
          }
        }
        if (largest <= 0.8) best = std::max(best, least);
      }
    }
    EXPECT_GE(design.level, best - 2e-3) << "system " << i;
    EXPECT_LE(design.level, best + 0.05);  // of the grid
  }
}

TEST(RegionDesign, RaisesTheWorstRatioAndMapsIt) {
  DASHPOT_SKIP_IF_QUICK();
  Random random(7307);
  const std::vector<TaskImpedance> region = path_of_configurations(random, 8);
  RegionOptions options;
  options.target = DampingTarget::constant(0.7);
  options.threads = 1;
  const MatrixXd alone = design_region(region, options).damping;
  options.threads = 3;
  std::vector<double> told;
  options.progress = [&told](double done) { told.push_back(done); };
  const RegionDesign design = design_region(region, options);
  EXPECT_EQ(design.damping, alone);
  EXPECT_LE(design.violation, 2e-7);
  EXPECT_EQ(negative_eigenvalues(design.damping).size(), 0);
  EXPECT_TRUE(std::is_sorted(told.begin(), told.end()));
  EXPECT_EQ(told.front(), 0);
  EXPECT_EQ(told.back(), 1);
  ASSERT_EQ(design.samples.size(), region.size());
  double least = kInfinity;
  for (std::size_t i = 0; i < region.size(); ++i) {
    const RegionSample& sample = design.samples[i];
    const Spectrum<> spectrum = analyze(to_joint_space(with_damping(region[i], design.damping)));
    for (const Mode<>& mode : spectrum.modes) {
      EXPECT_GE(mode.damping_ratio, sample.damping_ratio - 1e-12);
      EXPECT_LE(mode.damping_ratio, 1.05 + 1e-6);
    }
    EXPECT_NEAR(spectrum.modes[sample.worst_mode].damping_ratio, sample.damping_ratio, 1e-10);
    least = std::min(least, sample.damping_ratio);
  }
  EXPECT_NEAR(design.level, std::min(1.0, least / 0.7), 1e-12);
  // Better than what suits any one configuration, scaled down to the same ceiling.
  double others = 0;
  for (const TaskImpedance& arm : region) {
    MatrixXd C = design_damping(arm, options.target).damping;
    RegionDesign one = evaluate_region(region, C, options);
    for (; one.violation > 0; one = evaluate_region(region, C, options)) C *= 0.98;
    others = std::max(others, one.level);
  }
  EXPECT_GT(design.level, others);
}

TEST(RegionDesign, FindsTheFewOfManyThatBind) {
  DASHPOT_SKIP_IF_QUICK();
  Random random(7312);
  std::vector<TaskImpedance> region = path_of_configurations(random, 40);
  region[33].mass *= 2.5;  // a payload, not among those that the search begins with
  region[17].mass *= 0.4;
  RegionOptions options;
  options.target = DampingTarget::constant(0.7);
  const RegionDesign design = design_region(region, options);
  EXPECT_LE(design.violation, 2e-7);
  const RegionDesign again = evaluate_region(region, design.damping, options);
  EXPECT_EQ(again.level, design.level);
  EXPECT_EQ(again.violation, design.violation);
  // No lower than of the worst alone, which is as high as the level of all can be.
  std::vector<TaskImpedance> worst = {region[33], region[17]};
  for (std::size_t i = 0; i < region.size(); ++i) {
    const RegionSample& sample = design.samples[i];
    const bool low = sample.damping_ratio < (design.level + 0.05) * 0.7;
    if (low || sample.largest_ratio > 1) worst.push_back(region[i]);  // of 1.05 at most
  }
  EXPECT_LT(worst.size(), region.size());
  EXPECT_GE(design.level, design_region(worst, options).level - 1e-2);
}

TEST(RegionDesign, SaysWhereFrictionAloneIsTooMuch) {
  Random random(7310);
  TaskImpedance arm = random_arm(random, 7, 6, 10, 30);
  arm.damping = 1000 * MatrixXd::Identity(7, 7);
  RegionOptions options;
  options.target = DampingTarget::constant(0.2);
  EXPECT_GT(design_region({arm}, options).violation, 0.1);
}

TEST(RegionDesign, RefusesWhatDoesNotFit) {
  Random random(7311);
  RegionOptions options;
  options.ceiling = 0.5;  // below the target
  EXPECT_THROW(design_region({random_arm(random, 3, 3)}, options), std::invalid_argument);
  options.ceiling.reset();
  EXPECT_THROW(design_region(std::vector<TaskImpedance>(), options), std::invalid_argument);
  EXPECT_THROW(design_region({random_arm(random, 3, 3), random_arm(random, 3, 2)}, options),
               std::invalid_argument);
}

}  // namespace
}  // namespace dashpot::analysis
