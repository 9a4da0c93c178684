// The bounds include the rounding of `dashpot analyze` when it forms the coefficients of a file.
#include <dashpot/tests/apps/json_result.hpp>
#include <dashpot/tests/support/quad_matrix.hpp>
#include <dashpot/tests/support/random.hpp>

#include <cmath>
#include <sstream>

namespace dashpot::tests {
namespace {

using dashpot::testing::Quad;
using dashpot::testing::Random;

/// The root of the larger x with det(K - x M) = 0, for K = diag(k0, k1).
double higher_frequency(Quad m00, Quad m01, Quad m11, Quad k0, Quad k1) {
  const Quad det = m00 * m11 - m01 * m01, sum = k0 * m11 + k1 * m00;
  const Quad discriminant = sum * sum - 4 * det * k0 * k1;
  auto root = static_cast<Quad>(std::sqrt(static_cast<double>(discriminant)));
  root = (root + discriminant / root) / 2;  // Newton's method: 30 digits
  return std::sqrt(static_cast<double>((sum + root) / (2 * det)));
}

/// A file of systems, and their highest frequencies.
struct Systems {
  std::ostringstream file;
  std::vector<double> frequencies;

  Systems() { file.precision(17); }
};

/// Expects the frequencies within their bounds, and bounds not far above the errors.
void expect_counted(const Systems& systems) {
  const Json results = analyze_json(systems.file.str());
  ASSERT_EQ(results.size(), systems.frequencies.size());
  double largest = 0;
  for (std::size_t i = 0; i < results.size(); ++i) {
    const Json& mode = results[i]["modes"][0];
    const double truth = systems.frequencies[i], bound = mode["natural_frequency_bound"];
    const double error = std::abs(mode["natural_frequency"].get<double>() - truth);
    EXPECT_LE(error, bound) << "system " << i;
    EXPECT_LE(bound, 1e-4 * truth) << "system " << i;
    largest = std::max(largest, error / bound);
  }
  EXPECT_GT(largest, 0.01);
}

// In both the mass is all but singular: a rounding error of 1e-16 in it is one of 1e-7 in the
// higher frequency.

TEST(AnalyzeRounding, OfReflectedInertiaIsCounted) {
  Random random(2301);
  Systems systems;
  for (int trial = 0; trial < 40; ++trial) {
    const double first = random.log_uniform(1e-9, 4e-9), second = random.log_uniform(1e-9, 4e-9);
    systems.file << "- {mass: [[1, 1], [1, 1]], reflected_inertia: [" << first << ", " << second
                 << "], stiffness: [[3, 0], [0, 5]]}\n";
    systems.frequencies.push_back(higher_frequency(1 + Quad(first), 1, 1 + Quad(second), 3, 5));
  }
  expect_counted(systems);
}

TEST(AnalyzeRounding, OfAPayloadIsCounted) {
  Random random(2302);
  Systems systems;
  for (int trial = 0; trial < 40; ++trial) {
    const double first = random.log_uniform(1e-9, 4e-9), second = random.log_uniform(1e-9, 4e-9);
    const double payload = random.uniform(0.5, 1);
    Quad inertia = 0;
    systems.file << "- {mass: [[" << first << ", 0], [0, " << second << "]], payload: " << payload
                 << ", jacobian: [";
    for (int row = 0; row < 3; ++row) {
      const double entry = random.uniform(0.5, 1);
      systems.file << "[" << entry << ", " << entry << "], ";
      inertia += Quad(payload) * Quad(entry) * Quad(entry);
    }
    systems.file << "[0, 0], [0, 0], [0, 0]], task_damping: [";
    for (int row = 0; row < 6; ++row) {
      systems.file << (row == 0 ? "" : ", ") << "[0, 0, 0, 0, 0, 0]";
    }
    systems.file << "], stiffness: [[3, 0], [0, 5]]}\n";
    systems.frequencies.push_back(
        higher_frequency(inertia + Quad(first), inertia, inertia + Quad(second), 3, 5));
  }
  expect_counted(systems);
}

}  // namespace
}  // namespace dashpot::tests
