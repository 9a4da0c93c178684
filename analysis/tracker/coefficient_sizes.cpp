#include <dashpot/analysis/tracker/coefficient_sizes.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// For the rounding errors of the sizes themselves.
constexpr double kSlack = 1 + 1e-10;

std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

double square(double x) {
  return x * x;
}

/// The largest |A_ij| inverse_i inverse_j of a symmetric matrix, n x n: from its upper triangle,
/// read in fours where a column has them.
double largest_entry(const double* A, int n, const std::array<double, kMaxDof>& inverse) {
  Vec4d largest{};
  double rest = 0;
  for (int j = 0; j < n; ++j) {
    const double* const column = A + j * n;
    const double factor = inverse[at(j)];
    int i = 0;
    for (; i <= j && i + 4 <= n; i += 4) {
      const Vec4d entry = magnitude(load(column + i) * load(&inverse[at(i)])) * factor;
      largest = entry > largest ? entry : largest;
    }
    for (; i <= j; ++i) rest = std::max(rest, std::abs(column[i]) * inverse[at(i)] * factor);
  }
  return std::max({rest, largest[0], largest[1], largest[2], largest[3]});
}

}  // namespace

CoefficientSizes coefficient_sizes(const SymmetricPencil& pencil) noexcept {
  const int n = pencil.joints;
  CoefficientSizes sizes;
  std::array<double, kMaxDof> inverse{};
  double smallest = kInfinity, largest = 0;
  for (int k = 0; k < n; ++k) {
    const double diagonal = pencil.M[k + k * n];
    smallest = std::min(smallest, diagonal);
    largest = std::max(largest, diagonal);
    sizes.s[at(k)] = std::sqrt(diagonal);
    inverse[at(k)] = 1 / sizes.s[at(k)];
  }
  const double mass = largest_entry(pencil.M, n, inverse),
               damping = largest_entry(pencil.C, n, inverse);
  const double stiffness = pencil.factored ? 0 : largest_entry(pencil.W, n, inverse);
  for (int j = 0; pencil.factored && j < n; ++j) {
    double W = 0;
    for (int i = 0; i < pencil.rank; ++i) W += square(pencil.W[i + j * pencil.rank]);
    sizes.elastic[at(j)] = std::sqrt(W);
  }
  sizes.mass = kSlack * mass;
  sizes.damping = kSlack * damping;
  sizes.stiffness = kSlack * std::sqrt(stiffness);
  if (!pencil.factored) {
    for (int k = 0; k < n; ++k) sizes.elastic[at(k)] = sizes.stiffness * sizes.s[at(k)];
  }
  const double rate = sizes.damping + sizes.stiffness;
  sizes.in_range = smallest > 1e-120 && largest < 1e120 && rate < 1e60;
  return sizes;
}

double distance(const SymmetricPencil& pencil, const SymmetricPencil& other,
                const CoefficientSizes& sizes, double limit) noexcept {
  const int n = pencil.joints;
  for (int k = 0; k < n * n; k += n + 1) {  // mostly, a glance at the diagonal is enough
    if (std::abs(pencil.M[k] - other.M[k]) > 2 * limit * sizes.mass * pencil.M[k]) return kInfinity;
  }
  double mass = 0, damping = 0, stiffness = 0;
  std::array<double, kMaxDof> inverse{};
  for (int k = 0; k < n; ++k) inverse[at(k)] = 1 / sizes.s[at(k)];
  // Changes relative to the sizes; zero by zero is no change.
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i <= j; ++i) {
      const int k = i + j * n;
      const double unit = inverse[at(i)] * inverse[at(j)];
      mass = std::max(mass, std::abs(pencil.M[k] - other.M[k]) * unit);
      damping = std::max(damping, std::abs(pencil.C[k] - other.C[k]) * unit);
      if (!pencil.factored)
        stiffness = std::max(stiffness, std::abs(pencil.W[k] - other.W[k]) * unit);
    }
    double W = 0;
    for (int i = 0; pencil.factored && i < pencil.rank; ++i) {
      W += square(pencil.W[i + j * pencil.rank] - other.W[i + j * pencil.rank]);
    }
    if (!(W < kInfinity)) return kInfinity;  // a factor is not known to be finite
    if (W > 0) stiffness = std::max(stiffness, std::sqrt(W) / sizes.elastic[at(j)]);
  }
  if (!pencil.factored && stiffness > 0) stiffness /= square(sizes.stiffness);
  if (damping > 0) damping /= sizes.damping;
  return kSlack * std::max({mass / sizes.mass, damping, stiffness});
}

}  // namespace dashpot::analysis
