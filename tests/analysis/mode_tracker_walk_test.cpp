// Random walks through the systems of 1 to 16 coordinates: every bound encloses the truth,
// iterations stay within their cap, and the direct solver agrees.
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/true_spectrum.hpp>

#include <gtest/gtest.h>

#include <memory>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::expect_enclosed;
using testing::Random;

/// A system that wanders: factors of mass, damping and stiffness drift smoothly at random.
class Walk {
 public:
  /// `rows` of the stiffness factor; 0 for a full stiffness without one.
  Walk(Random& random, int n, int rows, double damping, double step)
      : random_(random), n_(n), rows_(rows), damping_size_(damping), step_(step) {
    mass_ = start(n, n);
    damping_ = start(n, n);
    stiffness_ = start(rows > 0 ? rows : n, n);
  }

  System<kMaxDof> next() {
    for (Part* part : {&mass_, &damping_, &stiffness_}) {
      part->velocity = 0.95 * part->velocity +
                       0.05 * step_ * random_.matrix(part->value.rows(), part->value.cols());
      part->value += part->velocity - 1e-3 * step_ * part->value;
    }
    System<kMaxDof> system(n_);
    system.mass = gram(mass_.value, 0.3);
    system.damping = damping_size_ * gram(damping_.value, 0.02);
    if (rows_ > 0) {
      system.stiffness_factor = 20 * stiffness_.value;
    } else {
      system.stiffness = 400 * gram(stiffness_.value, 0.1);
    }
    return system;
  }

 private:
  struct Part {
    MatrixXd value, velocity;
  };
  Part start(int rows, int cols) {
    return {random_.matrix(rows, cols) / std::sqrt(static_cast<double>(cols)),
            MatrixXd::Zero(rows, cols)};
  }
  static MatrixXd gram(const MatrixXd& F, double floor) {
    const MatrixXd product = F.transpose() * F;
    return 0.5 * (product + product.transpose()) + floor * MatrixXd::Identity(F.cols(), F.cols());
  }

  Random& random_;
  int n_, rows_;
  double damping_size_, step_;
  Part mass_, damping_, stiffness_;
};

struct Size {
  int joints, rows;
};
void PrintTo(const Size& size, std::ostream* out) {
  *out << size.joints << " joints, " << size.rows << " rows";
}

class RandomWalk : public ::testing::TestWithParam<Size> {};
INSTANTIATE_TEST_SUITE_P(Sizes, RandomWalk,
                         ::testing::Values(Size{1, 1}, Size{1, 0}, Size{2, 2}, Size{2, 1},
                                           Size{3, 0}, Size{3, 2}, Size{4, 3}, Size{5, 5},
                                           Size{5, 0}, Size{6, 6}, Size{7, 6}, Size{7, 5},
                                           Size{7, 0}, Size{7, 3}, Size{8, 6}, Size{9, 6},
                                           Size{10, 10}, Size{11, 0}, Size{12, 6}, Size{13, 6},
                                           Size{14, 3}, Size{15, 12}, Size{16, 6}, Size{16, 0},
                                           Size{16, 16}),
                         [](const auto& size) {
                           return "Joints" + std::to_string(size.param.joints) + "Rows" +
                                  std::to_string(size.param.rows);
                         });

TEST_P(RandomWalk, IsFollowedWithinItsBounds) {
  const auto [n, rows] = GetParam();
  Random random(2000 + 100U * static_cast<unsigned>(n) + static_cast<unsigned>(rows));
  const auto tracker = std::make_unique<ModeTracker>();
  const auto spectrum = std::make_unique<TrackedSpectrum>();
  const int steps = n <= 7 ? 500 : 200, apart = n <= 7 ? 10 : 25;
  double tightest = 0, widest = 0;
  for (const double damping : {0.02, 1.0, 12.0}) {
    Walk walk(random, n, rows, damping, 0.02);
    for (int step = 0; step < steps; ++step) {
      const System<kMaxDof> system = walk.next();
      ASSERT_EQ(tracker->update(system, *spectrum), Status::kOk) << "step " << step;
      ASSERT_EQ(spectrum->mode_count, rows > 0 ? rows : n);
      if (step % apart != 0) continue;
      SCOPED_TRACE("damping " + std::to_string(damping) + ", step " + std::to_string(step));
      const auto seen = expect_enclosed(system, *spectrum);
      tightest = std::max(tightest, seen.tightest);
      widest = std::max(widest, seen.widest);
    }
  }
  const TrackerCounters& counters = tracker->counters();
  // Followed, not solved directly; and the bounds are worth something.
  EXPECT_GE(counters.tracked, 0.97 * 3 * steps);
  EXPECT_LE(tightest, 1);
  EXPECT_LE(widest, 1e-3);
}

/// All eigenvalues of modes, each with its bound.
struct Bounded {
  Complex value;
  double bound;
};

TEST(RandomWalkAgainstDirect, AgreesWithinBothBounds) {
  Random random(77);
  const auto tracker = std::make_unique<ModeTracker>();
  const auto spectrum = std::make_unique<TrackedSpectrum>();
  SpectrumOptions options;
  options.residual = SpectrumOptions::Residual::kExtended;
  const auto solver = std::make_unique<SpectrumSolver<kMaxDof>>(options);
  const auto direct = std::make_unique<Spectrum<kMaxDof>>();
  int compared = 0;
  for (const int n : {2, 4, 6, 7}) {
    for (const double damping : {0.1, 3.0}) {
      Walk walk(random, n, 0, damping, 0.02);
      for (int step = 0; step < 700; ++step) {
        const System<kMaxDof> system = walk.next();
        ASSERT_EQ(tracker->update(system, *spectrum), Status::kOk);
        ASSERT_EQ(solver->solve(system, *direct), Status::kOk);
        std::vector<Bounded> expected;
        for (const auto& mode : direct->modes) {
          for (const Complex& value : mode.eigenvalues) {
            expected.push_back({value, mode.error_bound});
          }
        }
        for (int i = 0; i < spectrum->mode_count; ++i) {
          const ModeNumbers& mode = spectrum->modes[static_cast<std::size_t>(i)];
          for (const Complex& value : mode.eigenvalues) {
            const auto nearest = std::min_element(
                expected.begin(), expected.end(), [&](const Bounded& a, const Bounded& b) {
                  return std::abs(a.value - value) < std::abs(b.value - value);
                });
            ASSERT_NE(nearest, expected.end());
            ASSERT_LE(std::abs(nearest->value - value), nearest->bound + mode.error_bound)
                << "n " << n << ", step " << step;
            expected.erase(nearest);
            ++compared;
          }
        }
      }
    }
  }
  EXPECT_GE(compared, 50000);
}

}  // namespace
}  // namespace dashpot::analysis
