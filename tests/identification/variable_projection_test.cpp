// The least-squares problem of decays against differences of its cost.
#include <dashpot/identification/model/decay_columns.hpp>
#include <dashpot/identification/model/decay_fit.hpp>
#include <dashpot/identification/model/variable_projection.hpp>
#include <dashpot/tests/support/released_springs.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

namespace dashpot::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Dice;

/// Two records of three channels, of which one has samples of its own, moved by an input or not.
class Decays : public ::testing::TestWithParam<bool> {
 protected:
  static constexpr Index kSamples = 60;

  static VectorXd noise() { return (VectorXd(3) << 1, 2, 0.5).finished(); }
  static VectorXd record_noise() { return (VectorXd(2) << 1.2, 0.7).finished(); }

  static DecayData data_of(Dice& draw, bool driven) {
    std::vector<MotionRecord> records;
    auto grids = std::make_shared<std::vector<DrivenGrid>>();
    for (int r = 0; r < 2; ++r) {
      MotionRecord record{VectorXd::LinSpaced(kSamples, 0, 0.01 * (kSamples - 1)),
                          MatrixXd(3, kSamples)};
      if (r == 1 && !driven) record.time *= 1.1;
      for (double& y : record.output.reshaped()) y = draw.normal();
      record.output = record_noise()[r] * noise().asDiagonal() * record.output;
      record.output(2, 7 + r) = std::numeric_limits<double>::quiet_NaN();
      records.push_back(record);
      DrivenGrid& grid = grids->emplace_back(DrivenGrid{MatrixXd(1, kSamples), 0.01, 1});
      for (double& u : grid.input.reshaped()) u = draw.normal();
    }
    if (driven) return DecayData(records, grids);
    return DecayData(records);
  }

  /// `x`: the parameters less the values of three factors.
  VariableProjection at(const VectorXd& x) const {
    std::vector<DecayFactor> factors(3);
    factors[0] = {.first = std::log(9.0), .second = 0.12, .reference = 1};
    factors[1] = {.first = std::log(14.0), .second = 1.3};
    factors[2] = {.pair = false, .first = -3};
    Index i = 0;
    for (std::size_t k = 0; k < factors.size(); ++k) {
      DecayFactor& factor = factors[k];
      factor.first += x[i++];
      if (factor.pair) factor.second += x[i++];
      factor.scale.assign(data_.sources(), {1, 0});
      for (std::size_t s = 0; s < factor.scale.size(); ++s) {
        if (s == factor.reference) continue;
        factor.scale[s][0] = 0.8 + 0.3 * static_cast<double>(k) + x[i++];
        if (factor.pair) factor.scale[s][1] = 0.4 - static_cast<double>(s) + x[i++];
      }
    }
    factors_ = factors;
    return {data_, factors, noise(), record_noise()};
  }
  Index size() const { return 5 * static_cast<Index>(data_.sources()); }
  VectorXd zero() const { return VectorXd::Zero(size()); }
  VectorXd step(Index i, double h) const { return h * VectorXd::Unit(size(), i); }

  Dice draw_{41};
  DecayData data_ = data_of(draw_, GetParam());
  mutable std::vector<DecayFactor> factors_;  ///< of the last call of `at`
};

TEST_P(Decays, HaveTheGradientOfTheirCost) {
  VariableProjection there = at(zero());
  there.differentiate();
  for (Index i = 0; i < size(); ++i) {
    const double h = 1e-5, slope = (at(step(i, h)).cost - at(step(i, -h)).cost) / (2 * h);
    EXPECT_NEAR(-2 * there.gradient[i], slope, 1e-6 * there.gradient.norm()) << i;
  }
}

/// Without a residual, J'J is half of the second derivative.
TEST_P(Decays, HaveTheCurvatureOfTheirCost) {
  const VariableProjection any = at(zero());
  for (DecayPart& part : data_.parts) {
    MatrixXd exact = MatrixXd::Zero(part.output.rows(), part.output.cols());
    for (const DecayFactor& factor : factors_) {
      const MatrixXd columns = columns_of(factor, part, false).value;
      exact += columns * MatrixXd::NullaryExpr(columns.cols(), exact.cols(),
                                               [&](Index, Index) { return draw_.normal(); });
    }
    part.output = exact;
  }
  VariableProjection there = at(zero());
  ASSERT_LT(there.cost, 1e-20 * any.cost);
  there.differentiate();
  EXPECT_LT((there.normal - there.normal.transpose()).norm(), 1e-14 * there.normal.norm());
  const double h = 1e-4;
  for (Index i = 0; i < size(); ++i) {
    for (Index j = 0; j <= i; ++j) {
      const VectorXd both = step(i, h) + step(j, h), apart = step(i, h) - step(j, h);
      const double curvature =
          (at(both).cost + at(-both).cost - at(apart).cost - at(-apart).cost) / (8 * h * h);
      EXPECT_NEAR(there.normal(i, j), curvature,
                  1e-4 * std::sqrt(there.normal(i, i) * there.normal(j, j)))
          << i << ", " << j;
    }
  }
}

/// In white noise alone each parameter has a square of one on average; the stretches are
/// single samples here.
TEST_P(Decays, HaveScoresOfTheSizeOfTheNoise) {
  constexpr int kDraws = 40;
  double sum = 0;
  for (int k = 0; k < kDraws; ++k) {
    data_ = data_of(draw_, GetParam());
    VariableProjection there = at(zero());
    there.differentiate();
    const Eigen::LLT<MatrixXd> factor(there.normal);
    ASSERT_EQ(factor.info(), Eigen::Success);
    sum += there.squared_scores(factor) / kDraws;
  }
  EXPECT_NEAR(sum / static_cast<double>(size()), 1, 0.15);
}

TEST(DecayColumns, AreOfTheTimesOfEachRecord) {
  std::vector<MotionRecord> records;
  for (const double step : {0.01, 0.02}) {
    records.push_back({VectorXd::LinSpaced(5, 0, 4 * step), MatrixXd::Ones(1, 5)});
  }
  const DecayFactor factor{.pair = false, .first = -3, .scale = {{1, 0}, {0.5, 0}}};
  const FactorColumns columns = columns_of(factor, DecayData(records).parts.front(), false);
  for (Index i = 0; i < 5; ++i) {
    const auto t = 0.01 * static_cast<double>(i);
    EXPECT_DOUBLE_EQ(columns.value(i, 0), std::exp(-3 * t));
    EXPECT_DOUBLE_EQ(columns.value(5 + i, 0), 0.5 * std::exp(-6 * t));
  }
}

/// A channel whose samples begin when the fast decay of a pair is over: its two columns are
/// parallel there, and large amplitudes cancel.
TEST(DecayFit, KeepsItsDigitsWhereAFastDecayIsOver) {
  constexpr Index kMissing = 12;
  const double fast = 200, slow = 2;  // 1/s
  Dice draw(43);
  std::vector<MotionRecord> records;
  for (const double strength : {1.0, 0.6}) {
    MotionRecord record{VectorXd::LinSpaced(150, 0, 1.49), MatrixXd(3, 150)};
    for (Index i = 0; i < 150; ++i) {
      const double t = record.time[i];
      for (int c = 0; c < 3; ++c) {
        record.output(c, i) = strength * (1 + c) * std::exp(-t) * std::cos(9 * t + strength) +
                              (0.5 + 0.3 * c) * std::exp(-slow * t) / strength +
                              (0.4 - 0.2 * c) * std::exp(-fast * t) + 1e-3 * draw.normal();
      }
    }
    record.output.row(0).head(kMissing).setConstant(std::numeric_limits<double>::quiet_NaN());
    records.push_back(record);
  }
  const double w = std::sqrt(fast * slow), zeta = (fast + slow) / (2 * w);
  const DecayFit fit = fit_decays(DecayData(records),
                                  {{.first = std::log(9.05), .second = 0.11},
                                   {.first = std::log(1.05 * w), .second = 1.03 * zeta}},
                                  VectorXd::Constant(3, 1e-3), 30);
  EXPECT_TRUE(fit.converged);
  EXPECT_LT(fit.whiteness, 1.5);
  const double deviation = std::sqrt(fit.covariance(3, 3));
  EXPECT_LT(deviation, 0.1);
  EXPECT_NEAR(fit.factors[1].second, zeta, 4 * deviation);
}

INSTANTIATE_TEST_SUITE_P(Sources, Decays, ::testing::Bool(),
                         [](const auto& given) { return given.param ? "WithAnInput" : "Free"; });

}  // namespace
}  // namespace dashpot::identification
