#include <dashpot/analysis/linalg/assignment.hpp>
#include <dashpot/analysis/tracker/tracked_start.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace dashpot::analysis {
namespace {

/// Squared lengths in the metric below this, relative to those in the energy metric, belong to
/// vectors of no sign type: a pair at critical damping that is not in one block.
constexpr double kNeutral = 1e-6;
/// Squared sine of the angle up to which two columns count as parallel, relative.
constexpr double kParallel = 1e-10;
/// Entries this small, relative to their column, are left out of a proportional basis.
constexpr double kPure = 1e-7;

std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

using Column = std::array<double, kMaxWidth>;

/// The two inner products of states: elastic coordinates' plus or minus velocities'.
struct Products {
  double elastic = 0, velocities = 0;
  double indefinite() const { return elastic - velocities; }
  double energy() const { return elastic + velocities; }
};

double weighted(const double* matrix, int n, const double* x, const double* y) {
  double sum = 0;
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) sum += x[i] * matrix[i + j * n] * y[j];
  }
  return sum;
}

Products products(const SymmetricPencil& pencil, const Column& x, const Column& y) {
  const int p = pencil.rank;
  Products result;
  if (pencil.factored) {
    for (int k = 0; k < p; ++k) result.elastic += x[at(k)] * y[at(k)];
  } else {
    result.elastic = weighted(pencil.W, p, x.data(), y.data());
  }
  result.velocities = weighted(pencil.M, pencil.joints, x.data() + p, y.data() + p);
  return result;
}

/// The state with position u and velocity v.
template <typename Position, typename Velocity>
Column state(const SymmetricPencil& pencil, const Position& u, const Velocity& v) {
  const int n = pencil.joints, p = pencil.rank;
  Column x{};
  for (int k = 0; k < n; ++k) {
    x[at(p + k)] = v[k];
    if (!pencil.factored) x[at(k)] = u[k];
    for (int i = 0; pencil.factored && i < p; ++i) x[at(i)] += pencil.W[i + k * p] * u[k];
  }
  return x;
}

Column combination(double a, const Column& x, double b, const Column& y) {
  Column z{};
  for (std::size_t k = 0; k < z.size(); ++k) z[k] = a * x[k] + b * y[k];
  return z;
}

/// A mode's two columns, of sign types + and -.
struct Plane {
  Column first{}, second{};
};
using Planes = std::array<Plane, kMaxDof>;

/// Orthonormal columns of the plane that x and y span; false unless it has both sign types.
bool make_plane(const SymmetricPencil& pencil, const Column& x, const Column& y, Plane& plane) {
  const Products xx = products(pencil, x, x), xy = products(pencil, x, y),
                 yy = products(pencil, y, y);
  const double a = xx.indefinite() / xx.energy(), c = yy.indefinite() / yy.energy();
  const double x_scale = 1 / std::sqrt(xx.energy()), y_scale = 1 / std::sqrt(yy.energy());
  const double b = xy.indefinite() * x_scale * y_scale;
  // Eigenvectors of the Gram matrix [a b; b c].
  const double angle = 0.5 * std::atan2(2 * b, a - c), cosine = std::cos(angle),
               sine = std::sin(angle);
  const double root = std::sqrt(0.25 * (a - c) * (a - c) + b * b), mean = 0.5 * (a + c);
  if (!(mean + root > kNeutral) || !(mean - root < -kNeutral)) return false;
  const double plus = 1 / std::sqrt(mean + root), minus = 1 / std::sqrt(root - mean);
  plane.first = combination(plus * cosine * x_scale, x, plus * sine * y_scale, y);
  plane.second = combination(-minus * sine * x_scale, x, minus * cosine * y_scale, y);
  return true;
}

/// Collects the columns of a basis by what they are.
class BasisFromSpectrum {
 public:
  BasisFromSpectrum(const SymmetricPencil& pencil, const ModalBasis<kMaxDof>& source)
      : form_(pencil), source_(source) {}

  bool run(BlockEigenbasis& basis) {
    for (const Block& block : source_.blocks) {
      if (!take(block)) return false;
    }
    if (!pair_reals() || !add_elastic_coordinates()) return false;
    if (plane_count_ != form_.rank || zero_count_ != form_.zeros()) return false;
    write(basis);
    return true;
  }

 private:
  Column column(int j) const {
    const auto n = form_.joints;
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxDof, 1> v(n);
    v = source_.U.lazyProduct(source_.Lambda.col(j));
    return state(form_, source_.U.col(j), v);
  }
  bool take(const Block& block);
  bool pair_reals();
  bool add_elastic_coordinates();
  void write(BlockEigenbasis& basis) const;

  bool add_plane(const Plane& plane) {
    if (plane_count_ == form_.rank) return false;
    planes_[at(plane_count_++)] = plane;
    return true;
  }

  const SymmetricPencil& form_;
  const ModalBasis<kMaxDof>& source_;
  Planes planes_;
  std::array<Column, kMaxWidth> plus_, minus_, zeros_;  ///< of unit length
  int plane_count_ = 0, plus_count_ = 0, minus_count_ = 0, zero_count_ = 0;
};

bool BasisFromSpectrum::take(const Block& block) {
  if (block.zero_mode) {
    if (block.size == 2) minus_[at(minus_count_++)] = column(block.first + 1);
  } else if (block.size == 2) {
    Plane plane;
    return make_plane(form_, column(block.first), column(block.first + 1), plane) &&
           add_plane(plane);
  } else if (block.size == 1) {
    const Column x = column(block.first);
    const Products xx = products(form_, x, x);
    const double relative = xx.indefinite() / xx.energy();
    if (!(std::abs(relative) > kNeutral)) return false;
    (relative > 0 ? plus_[at(plus_count_++)] : minus_[at(minus_count_++)]) = x;
    return true;
  }
  return block.size <= 2;
}

/// Each real eigenvalue of type + goes with one of type - whose shape is like its own, the likest
/// two first, as in the direct solution (modes.cpp); those of type - that are left over are
/// velocities of zero modes.
bool BasisFromSpectrum::pair_reals() {
  if (plus_count_ > minus_count_) return false;
  while (plus_count_ > 0) {
    double best = -1;
    int first = -1, second = -1;
    for (int i = 0; i < plus_count_; ++i) {
      const Column& x = plus_[at(i)];
      const double x_size = products(form_, x, x).velocities;
      for (int j = 0; j < minus_count_; ++j) {
        const Column& y = minus_[at(j)];
        const double overlap = products(form_, x, y).velocities;
        const double likeness = overlap * overlap / (x_size * products(form_, y, y).velocities);
        if (!(likeness <= best)) best = likeness, first = i, second = j;
      }
    }
    Plane plane;
    if (!make_plane(form_, plus_[at(first)], minus_[at(second)], plane)) return false;
    if (!add_plane(plane)) return false;
    plus_[at(first)] = plus_[at(--plus_count_)];
    minus_[at(second)] = minus_[at(--minus_count_)];
  }
  for (int j = 0; j < minus_count_; ++j) {
    Column& y = minus_[at(j)];
    const double size = -products(form_, y, y).indefinite();
    if (!(size > 0)) return false;
    zeros_[at(zero_count_++)] = combination(1 / std::sqrt(size), y, 0, y);
  }
  return true;
}

/// Elastic coordinates that no mode moves any more become modes again, of frequency zero.
bool BasisFromSpectrum::add_elastic_coordinates() {
  while (plane_count_ < form_.rank) {
    if (!form_.factored || zero_count_ == 0) return false;
    Column best{};
    double largest = 0;
    for (int k = 0; k < form_.rank; ++k) {
      Column x{};
      x[at(k)] = 1;
      for (int i = 0; i < plane_count_; ++i) {
        const Plane& plane = planes_[at(i)];
        x = combination(1, x, -products(form_, plane.first, x).indefinite(), plane.first);
        x = combination(1, x, products(form_, plane.second, x).indefinite(), plane.second);
      }
      const double size = products(form_, x, x).indefinite();
      if (size > largest) largest = size, best = x;
    }
    if (!(largest > kNeutral)) return false;
    const Plane plane{combination(1 / std::sqrt(largest), best, 0, best),
                      zeros_[at(--zero_count_)]};
    add_plane(plane);
  }
  return true;
}

/// A basis of the planes of `count` modes, with room for `zeros` columns of zero modes.
void write_planes(const SymmetricPencil& pencil, const Planes& planes, int count, int zeros,
                  BlockEigenbasis& basis) {
  basis = BlockEigenbasis{};
  basis.modes = count;
  basis.zeros = zeros;
  basis.Z.width = packed_width(basis.modes, basis.zeros);
  for (int row = 0; row < pencil.states(); ++row) {
    for (int i = 0; i < count; ++i) {
      basis.Z(row, i) = planes[at(i)].first[at(row)];
      basis.Z(row, count + i) = planes[at(i)].second[at(row)];
    }
  }
}

void BasisFromSpectrum::write(BlockEigenbasis& basis) const {
  write_planes(form_, planes_, plane_count_, form_.zeros(), basis);
  for (int row = 0; row < form_.states(); ++row) {
    for (int k = 0; k < basis.zeros; ++k) {
      basis.Z(row, 2 * basis.modes + k) = zeros_[at(k)][at(row)];
    }
  }
}

/// The plane of a mode, orthonormal in the energy metric.
Plane energy_plane(const SymmetricPencil& pencil, const Column& x, const Column& y) {
  const double x_size = std::sqrt(products(pencil, x, x).energy());
  Plane plane;
  plane.first = combination(1 / x_size, x, 0, x);
  plane.second = combination(1, y, -products(pencil, plane.first, y).energy(), plane.first);
  const double y_size = std::sqrt(products(pencil, plane.second, plane.second).energy());
  plane.second = combination(y_size > 0 ? 1 / y_size : 0, plane.second, 0, y);
  return plane;
}

Plane plane_of(const SymmetricPencil& pencil, const BlockEigenbasis& basis, int i) {
  Column x{}, y{};
  for (int row = 0; row < pencil.states(); ++row) {
    x[at(row)] = basis.Z(row, i);
    y[at(row)] = basis.Z(row, basis.modes + i);
  }
  return energy_plane(pencil, x, y);
}

Plane plane_of(const SymmetricPencil& pencil, const Mode<kMaxDof>& mode) {
  const auto& u = mode.shapes[0];
  const Complex lambda = mode.eigenvalues[0];
  const ComplexVector<kMaxDof> v = lambda * u;
  if (lambda.imag() != 0) {
    return energy_plane(pencil, state(pencil, u.real(), v.real()),
                        state(pencil, u.imag(), v.imag()));
  }
  const auto zero = ComplexVector<kMaxDof>::Zero(u.size()).real().eval();
  return energy_plane(pencil, state(pencil, u.real(), zero), state(pencil, zero, u.real()));
}

/// The energy metric times x.
Column energy_image(const SymmetricPencil& pencil, const Column& x) {
  const int n = pencil.joints, p = pencil.rank;
  Column image{};
  const auto multiply = [](const double* matrix, int size, const double* v, double* out) {
    for (int j = 0; j < size; ++j) {
      for (int i = 0; i < size; ++i) out[i] += matrix[i + j * size] * v[j];
    }
  };
  multiply(pencil.M, n, x.data() + p, image.data() + p);
  if (pencil.factored) {
    std::copy_n(x.begin(), p, image.begin());
  } else {
    multiply(pencil.W, p, x.data(), image.data());
  }
  return image;
}

/// Of plane a, and of the energy metric times plane b.
double overlap(const SymmetricPencil& pencil, const Plane& a, const Plane& image) {
  double sum = 0;
  for (const Column* x : {&a.first, &a.second}) {
    for (const Column* y : {&image.first, &image.second}) {
      double product = 0;
      for (int k = 0; k < pencil.states(); ++k) product += (*x)[at(k)] * (*y)[at(k)];
      sum += product * product;
    }
  }
  return std::isfinite(sum) ? sum : 0;
}

template <typename NewPlane>
std::array<int, kMaxDof> best_places(const SymmetricPencil& pencil, const BlockEigenbasis& before,
                                     int count, const NewPlane& new_plane) {
  Scores scores{};
  Planes images;  // once, as each is compared with every new plane
  for (int j = 0; j < count; ++j) {
    const Plane old = plane_of(pencil, before, j);
    images[at(j)] = {energy_image(pencil, old.first), energy_image(pencil, old.second)};
  }
  for (int i = 0; i < count; ++i) {
    const Plane plane = new_plane(i);
    for (int j = 0; j < count; ++j) scores[at(i)][at(j)] = overlap(pencil, plane, images[at(j)]);
  }
  return assign(scores, count);
}

/// v' M v of the columns of block i, and between the two; elastic energies differ from
/// these by Z' S Z = Sigma.
struct Kinetic {
  double first = 0, second = 0, mixed = 0;
};

Kinetic kinetic_energies(const BlockEigenbasis& basis, const TrackedResidual& residual, int i) {
  const int m = basis.modes;
  Kinetic sum;
  for (int k = m; k < basis.columns(); ++k) {
    sum.first -= basis.Z(k, i) * residual.MV(k, i);
    sum.second -= basis.Z(k, m + i) * residual.MV(k, m + i);
    sum.mixed -= basis.Z(k, i) * residual.MV(k, m + i);
  }
  return sum;
}

/// Hyperbolic rotation of the two columns of mode i.
void rotate_block(double angle, int i, BlockEigenbasis& basis) {
  const double c = std::cosh(angle), s = std::sinh(angle);
  for (int row = 0; row < basis.columns(); ++row) {
    const double x = basis.Z(row, i), y = basis.Z(row, basis.modes + i);
    basis.Z(row, i) = c * x + s * y;
    basis.Z(row, basis.modes + i) = s * x + c * y;
  }
}

}  // namespace

bool start_basis(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                 BlockEigenbasis& basis) noexcept {
  return BasisFromSpectrum(pencil, spectrum.basis).run(basis);
}

void match_modes(const SymmetricPencil& pencil, const BlockEigenbasis& before,
                 BlockEigenbasis& basis) noexcept {
  const auto index =
      best_places(pencil, before, basis.modes, [&](int i) { return plane_of(pencil, basis, i); });
  permute_modes(index, basis);
}

void permute_modes(const std::array<int, kMaxDof>& index, BlockEigenbasis& basis) noexcept {
  const PackedMatrix Z = basis.Z;
  for (int row = 0; row < basis.columns(); ++row) {
    for (int i = 0; i < basis.modes; ++i) {
      basis.Z(row, index[at(i)]) = Z(row, i);
      basis.Z(row, basis.modes + index[at(i)]) = Z(row, basis.modes + i);
    }
  }
}

bool match_shapes(const SymmetricPencil& pencil, const BlockEigenbasis& before,
                  const Spectrum<kMaxDof>& spectrum, std::array<int, kMaxDof>& index) noexcept {
  const int count = spectrum.modes.size();
  for (int i = 0; i < count; ++i) index[at(i)] = i;
  if (count != before.modes) return false;
  index = best_places(pencil, before, count,
                      [&](int i) { return plane_of(pencil, spectrum.modes[i]); });
  return true;
}

void set_planes(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                const std::array<int, kMaxDof>& index, BlockEigenbasis& basis) noexcept {
  const int count = spectrum.modes.size();
  Planes planes;
  for (int k = 0; k < count; ++k) planes[at(index[at(k)])] = plane_of(pencil, spectrum.modes[k]);
  // Nonsymmetric damping and rounding errors can make modes of zero modes: there are more of them
  // than rows of W then, and no room for zero modes as well.
  write_planes(pencil, planes, count, 0, basis);
}

bool rotate_hyperbolically(const TrackedResidual& residual, double tolerance,
                           BlockEigenbasis& basis) noexcept {
  bool any = false;
  for (int i = 0; i < basis.modes; ++i) {
    const Kinetic kinetic = kinetic_energies(basis, residual, i);
    // In the energy metric: 2 first + 1, 2 second - 1, 2 mixed.
    const double tangent = -2 * kinetic.mixed / (kinetic.first + kinetic.second);
    if (!(std::abs(tangent) > tolerance) || !(std::abs(tangent) < 1)) continue;
    any = true;
    rotate_block(0.5 * std::atanh(tangent), i, basis);
  }
  return any;
}

bool decouples_damping(const TrackedResidual& residual, const BlockEigenbasis& basis,
                       HyperbolicAngles& angles) noexcept {
  for (int i = 0; i < basis.modes; ++i) {
    const auto [first, second, mixed] = kinetic_energies(basis, residual, i);
    // Kinetic energies of parallel velocities, elastic energies of parallel elastic
    // coordinates.
    const double squared = mixed * mixed, limit = kParallel * (1 + first) * second;
    if (!(std::abs(first * second - squared) <= limit)) return false;
    if (!(std::abs((1 + first) * (second - 1) - squared) <= limit)) return false;
    angles[at(i)] = 0.5 * std::atanh(-2 * mixed / (first + second));
  }
  return true;
}

bool make_proportional(const HyperbolicAngles& angles, BlockEigenbasis& basis) noexcept {
  const int m = basis.modes, columns = basis.columns();
  BlockEigenbasis pure = basis;
  for (int i = 0; i < m; ++i) rotate_block(angles[at(i)], i, pure);
  for (int column = 0; column < columns; ++column) {
    const bool elastic = column < m;
    double stays = 0, goes = 0;
    for (int row = 0; row < columns; ++row) {
      double& entry = pure.Z(row, column);
      const bool kept = (row < m) == elastic;
      double& largest = kept ? stays : goes;
      if (!(std::abs(entry) <= largest)) largest = std::abs(entry);
      if (!kept) entry = 0;
    }
    if (!(goes <= kPure * stays)) return false;
  }
  pure.proportional = true;
  basis = pure;
  return true;
}

}  // namespace dashpot::analysis
