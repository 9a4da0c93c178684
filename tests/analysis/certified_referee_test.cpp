// Our enclosures beside FLINT/Arb's: for each of some thousand systems the discs of the direct
// solver and of the tracker meet Arb's balls, one to one, with as many left over as there are zero
// modes.
#if defined(DASHPOT_HAVE_ARB)
#include <dashpot/analysis/tracker/tracked_start.hpp>
#include <dashpot/tests/support/arm_path.hpp>
#include <dashpot/tests/support/certified_spectrum.hpp>
#include <dashpot/tests/support/enclosure.hpp>
#include <dashpot/tests/support/made_to_measure.hpp>
#include <dashpot/tests/support/sanitized.hpp>
#include <dashpot/tests/support/tracker_paths.hpp>
#endif

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

namespace dashpot::analysis {
namespace {

#if !defined(DASHPOT_HAVE_ARB)
TEST(CertifiedReferee, NeedsArb) {
  GTEST_SKIP() << "FLINT/Arb is not installed (libflint-arb-dev, libflint-dev)";
}
#else
const int kSystemsOfAFamily = testing::quick() ? 66 : 180;  // of 19 families
constexpr int kStepsOfAPath = 10;

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::CertifiedEigenvalues;
using testing::Dice;
using testing::PathFamily;
using testing::SystemPath;

/// 1 to 10, small ones more often.
int any_size(Dice& dice) {
  return static_cast<int>(dice.log_uniform(1, 11));
}

/// Ratios from 0 to 1000, some of them 1 or as near as a double can be.
SystemPath damping_ratios(Dice& dice) {
  const int n = any_size(dice);
  const MatrixXd T = dice.congruence(n, 3);
  const VectorXd w = dice.log_vector(n, 100);
  const VectorXd zeta = VectorXd::NullaryExpr(n, [&]() -> double {
    const int kind = dice.integer(0, 5);
    if (kind == 0) return 0;
    if (kind == 1) return 1;
    if (kind == 2) return 1 + dice.log_uniform(1e-15, 1e-3) * (dice.integer(0, 1) == 0 ? -1 : 1);
    return dice.log_uniform(1e-12, 1e3);
  });
  return [=](double t) { return testing::classical_system(T, (1 + t) * w, zeta); };
}

/// Circulatory stiffness and gyroscopic damping, from next to nothing to as much as the rest.
SystemPath not_symmetric(Dice& dice) {
  const int n = any_size(dice);
  std::array<MatrixXd, 5> part;
  for (MatrixXd& matrix : part) matrix = dice.matrix(n, n) / std::sqrt(n);
  const double skew = dice.log_uniform(1e-14, 3), damping = dice.log_uniform(1e-3, 30);
  return [=](double t) {
    const MatrixXd I = MatrixXd::Identity(n, n);
    testing::TrackedSystem system(n);
    system.mass = part[0].transpose() * part[0] + 0.3 * I;
    system.mass = (0.5 * (system.mass + system.mass.transpose())).eval();
    system.damping = damping * (part[1].transpose() * part[1] + (0.1 + t) * I + skew * part[3]);
    system.stiffness = 100 * (part[2].transpose() * part[2] + (0.1 + t) * I + skew * part[4]);
    return system;
  };
}

SystemPath near_critical_cluster(Dice& dice) {
  const int n = any_size(dice);
  const double coupling = dice.log_uniform(1e-13, 1e-2);
  const MatrixXd C = dice.matrix(n, n), K = dice.matrix(n, n), I = MatrixXd::Identity(n, n);
  return [=](double t) {
    return testing::symmetric_system(I, 2 * I + coupling * (1 + t) * C, I + coupling * K);
  };
}

/// Masses of condition numbers up to 1e12, with damping that couples the modes.
SystemPath ill_conditioned(Dice& dice) {
  const int n = any_size(dice);
  const MatrixXd T = dice.congruence(n, dice.log_uniform(1, 1e6)), F = dice.matrix(n, n);
  const VectorXd w = dice.log_vector(n, 1e3);
  const double damping = dice.log_uniform(1e-3, 1e2);
  return [=](double t) {
    return testing::mixed_system(T, damping * (1 + t) * F.transpose() * F,
                                 w.cwiseAbs2().asDiagonal());
  };
}

/// Springs of whole numbers in some directions only: the stiffness is exactly singular, and is
/// given to the direct solver without its factor.
SystemPath free_directions(Dice& dice) {
  const int n = std::max(2, any_size(dice)), rows = dice.integer(1, n - 1);
  const MatrixXd W = MatrixXd::NullaryExpr(rows, n, [&] { return dice.integer(-4, 4); });
  const MatrixXd T = dice.congruence(n, 3), F = dice.matrix(n, n);
  const double damping = dice.log_uniform(1e-2, 10);
  return [=](double t) {
    testing::TrackedSystem system = testing::symmetric_system(
        T.transpose() * T, damping * (1 + t) * F.transpose() * F, W.transpose() * W);
    system.stiffness_factor = W;
    return system;
  };
}

/// A block of every kind that a solver hands out, some of them defective.
SystemPath every_kind(Dice& dice) {
  testing::Random random(dice.engine()());
  const System<> made = (dice.integer(0, 1) == 0 ? testing::make_system_of_every_kind(random)
                                                 : testing::make_defective_system(random))
                            .system;
  return [=](double t) {
    testing::TrackedSystem system(made.dof());
    system.mass = 0.5 * (made.mass + made.mass.transpose());
    system.damping = (1 + t) * made.damping;
    system.stiffness = made.stiffness;
    return system;
  };
}

/// An arm of sim/models on a piece of its way, at times stretched; with and without null space.
SystemPath arm_postures(Dice& dice) {
  const auto& arms = testing::arms();
  const testing::Arm arm = arms[static_cast<std::size_t>(dice.integer(0, 3))];
  const testing::GainScales scales{dice.log_uniform(0.01, 30),
                                   static_cast<double>(dice.integer(0, 1))};
  const auto loop = std::make_shared<testing::ArmLoop>(testing::arm_model(arm), scales);
  const double from = dice.integer(0, 2) == 0 ? 0.25 : dice.uniform(0, 1);
  const double reach = dice.log_uniform(1e-6, 0.3);
  return [=](double t) { return loop->at(testing::arm_way(arm.file, from + reach * t)); };
}

std::vector<PathFamily> families() {
  std::vector<PathFamily> all = testing::path_families();
  all.insert(all.end(), {{"damping ratios", damping_ratios},
                         {"not symmetric", not_symmetric},
                         {"near-critical cluster", near_critical_cluster},
                         {"ill-conditioned", ill_conditioned},
                         {"free directions", free_directions},
                         {"every kind", every_kind},
                         {"arm postures", arm_postures}});
  return all;
}

/// The published discs of eigenvalues, and the number of eigenvalues without one.
struct Published {
  std::vector<testing::LongComplex> center;
  std::vector<long double> radius;
  int unproved = 0;  ///< eigenvalues without a finite radius

  void add(Complex value, double bound) {
    if (!std::isfinite(bound)) {
      ++unproved;
      return;
    }
    center.emplace_back(value);
    radius.push_back(static_cast<long double>(bound));
  }
  int claimed() const { return static_cast<int>(center.size()) + unproved; }
};

Published published(const TrackedSpectrum& spectrum) {
  Published result;
  for (int i = 0; i < spectrum.mode_count; ++i) {
    const ModeNumbers& mode = spectrum.modes[static_cast<std::size_t>(i)];
    for (const Complex& value : mode.eigenvalues) result.add(value, mode.error_bound);
  }
  return result;
}

/// Zero modes' rates included, but those that are listed as modes.
Published published(const Spectrum<kMaxDof>& spectrum) {
  Published result;
  for (const Mode<kMaxDof>& mode : spectrum.modes) {
    for (const Complex& value : mode.eigenvalues) result.add(value, mode.error_bound);
  }
  for (Eigen::Index i = 0; i < spectrum.zero_mode_rates.size(); ++i) {
    const double rate = spectrum.zero_mode_rates[i];
    if (!std::isnan(rate)) result.add(rate, spectrum.zero_mode_rates_bound[i]);
  }
  return result;
}

/// A thousandth of the least radius: what the truth has to be known to.
long double wanted_radius(const std::vector<const Published*>& all) {
  long double least = std::numeric_limits<long double>::infinity();
  for (const Published* each : all) {
    for (std::size_t i = 0; i < each->center.size(); ++i) {
      const long double size = std::abs(each->center[i]);
      const long double radius = std::max(each->radius[i], 1e-25L * size);
      if (radius > 0) least = std::min(least, radius);
    }
  }
  return 1e-3L * least;
}

/// `expected`: how many eigenvalues there are but those at zero. Status kUncertified may claim
/// fewer.
void expect_met(const Published& ours, Status status, const CertifiedEigenvalues& truth,
                int expected) {
  ASSERT_TRUE(status == Status::kOk || status == Status::kUncertified) << to_text(status);
  EXPECT_LE(ours.claimed(), expected);
  EXPECT_TRUE(status == Status::kUncertified || (ours.claimed() == expected && ours.unproved == 0));
  const testing::Matching matching(ours.center, truth.center, ours.radius, truth.slack());
  EXPECT_TRUE(matching.complete()) << "some disc meets no ball of its own";
}

/// Listed by falling frequency, each once.
void expect_ordered(const TrackedSpectrum& spectrum) {
  const auto first = spectrum.order.begin();
  const int count = spectrum.mode_count;
  const auto size = [&](int i) {
    const auto& values = spectrum.modes[static_cast<std::size_t>(i)].eigenvalues;
    return std::sqrt(std::abs(values[0]) * std::abs(values[1]));
  };
  for (int k = 1; k < count; ++k) EXPECT_LE(size(first[k]), size(first[k - 1]) * (1 + 1e-6));
  for (int k = 0; k < count; ++k) EXPECT_EQ(std::count(first, first + count, k), 1);
}

class CertifiedReferee : public ::testing::TestWithParam<PathFamily> {};
INSTANTIATE_TEST_SUITE_P(Systems, CertifiedReferee, ::testing::ValuesIn(families()),
                         [](const auto& family) {
                           std::string name = family.param.name;
                           std::erase_if(name, [](char c) { return c == ' ' || c == '-'; });
                           return name;
                         });

TEST_P(CertifiedReferee, EveryDiscMeetsABallOfItsOwn) {
  int systems = 0;
  bool symmetric = true;
  std::vector<double> radii;  // over the largest eigenvalue
  const auto tracker = std::make_unique<ModeTracker>();
  const auto tracked = std::make_unique<TrackedSpectrum>();
  for (std::uint64_t seed = 1; systems < kSystemsOfAFamily; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Dice dice(seed);
    const SystemPath path = GetParam().make(dice);
    const double from = dice.uniform(0, 0.95);
    tracker->forget();
    for (int step = 0; step < kStepsOfAPath && systems < kSystemsOfAFamily; ++step) {
      SCOPED_TRACE("step " + std::to_string(step));
      const System<kMaxDof> system = path(from + 0.005 * step);
      const int n = static_cast<int>(system.dof());
      if (n > 10) break;
      symmetric = symmetric && system.symmetric();
      ++systems;
      System<kMaxDof> plain = system;
      if (system.stiffness_factor.rows() > 0) form_stiffness(plain);
      if (plain.stiffness_low.isZero(0)) plain.stiffness_factor.resize(0, n);
      Spectrum<kMaxDof> direct;
      const Status solved = SpectrumSolver<kMaxDof>().solve(plain, direct);
      const Status followed = tracker->update(system, *tracked);
      const Published of_direct = published(direct), of_tracked = published(*tracked);
      const CertifiedEigenvalues truth =
          testing::certify_within(system, wanted_radius({&of_direct, &of_tracked}));
      ASSERT_GT(truth.bits, 0) << "Arb proves nothing";
      {
        SCOPED_TRACE("direct");
        expect_met(of_direct, solved, truth, 2 * n - direct.zero_modes.count);
      }
      {
        SCOPED_TRACE("tracked");
        // Without the zero modes' positions, and their rates but for those that are listed as
        // modes.
        const int zeros = tracked->zero_mode_count;
        const auto listed = std::count_if(tracked->zero_mode_rates.begin(),
                                          tracked->zero_mode_rates.begin() + zeros,
                                          [](double rate) { return std::isnan(rate); });
        expect_met(of_tracked, followed, truth, 2 * (n - zeros) + static_cast<int>(listed));
        expect_ordered(*tracked);
      }
      if (HasFailure()) return;
      long double size = 0;
      for (const auto& z : truth.center) size = std::max(size, std::abs(z));
      for (const Published* each : {&of_direct, &of_tracked}) {
        for (const long double radius : each->radius) {
          radii.push_back(static_cast<double>(radius / size));
        }
      }
    }
  }
  const TrackerCounters& counters = tracker->counters();
  EXPECT_TRUE(!symmetric || counters.tracked > systems / 10);
  EXPECT_EQ(counters.tracked + counters.reused + counters.direct, systems);
  // Enclosures that are worth something: half of the radii are far below what anyone measures.
  std::sort(radii.begin(), radii.end());
  EXPECT_LE(radii[radii.size() / 2], 1e-9);
}
#endif

}  // namespace
}  // namespace dashpot::analysis
