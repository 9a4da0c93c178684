#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/double_double.hpp>
#include <dashpot/analysis/tracker/tracked_start.hpp>

#include <cmath>

namespace dashpot::analysis {
namespace {

/// Squared lengths in the metric below this, relative to those in the energy metric, belong to
/// vectors of no sign type: a pair at critical damping that is not in one block.
constexpr double kNeutral = 1e-6;

/// p + n: elastic coordinates, then velocities.
using Column = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxWidth, 1>;
using Coefficients = Eigen::Map<const Eigen::MatrixXd>;

/// The energy metric times x.
Column energy_image(const SymmetricPencil& pencil, const Column& x) {
  const int n = pencil.joints, p = pencil.rank;
  Column image = x;
  image.tail(n) = Coefficients(pencil.M, n, n).lazyProduct(x.tail(n));
  if (!pencil.factored) image.head(p) = Coefficients(pencil.W, p, p).lazyProduct(x.head(p));
  return image;
}

/// The two inner products of states: elastic coordinates' plus or minus velocities'.
struct Products {
  double elastic = 0, velocities = 0;
  double indefinite() const { return elastic - velocities; }
  double energy() const { return elastic + velocities; }
};

Products products(const SymmetricPencil& pencil, const Column& x, const Column& y) {
  const Column image = energy_image(pencil, y);
  return {x.head(pencil.rank).dot(image.head(pencil.rank)),
          x.tail(pencil.joints).dot(image.tail(pencil.joints))};
}

/// The state with position u and velocity v.
template <typename Position, typename Velocity>
Column state(const SymmetricPencil& pencil, const Position& u, const Velocity& v) {
  const int n = pencil.joints, p = pencil.rank;
  Column x(pencil.states());
  x.tail(n) = v;
  if (pencil.factored) {
    x.head(p) = Coefficients(pencil.W, p, n).lazyProduct(u);
  } else {
    x.head(p) = u;
  }
  return x;
}

/// A mode's two columns.
struct Plane {
  Column first, second;
};

/// Orthonormal columns, of sign types + and -, of the plane that x and y span; false unless it has
/// both sign types.
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
  plane.first = plus * (cosine * x_scale * x + sine * y_scale * y);
  plane.second = minus * (cosine * y_scale * y - sine * x_scale * x);
  return true;
}

/// Collects the columns of a basis by what they are.
class BasisFromSpectrum {
 public:
  BasisFromSpectrum(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum)
      : pencil_(pencil), spectrum_(spectrum) {}

  bool run(BlockEigenbasis& basis) {
    if (spectrum_.modes.size() > pencil_.rank) return false;
    if (!take_modes() || !take_zero_modes() || !add_elastic_coordinates()) return false;
    if (zero_count_ != pencil_.zeros()) return false;
    write(basis);
    return true;
  }

 private:
  Column column(int j) const {
    const ModalBasis<kMaxDof>& basis = spectrum_.basis;
    const Vector<kMaxDof> v = basis.U.lazyProduct(basis.Lambda.col(j));
    return state(pencil_, basis.U.col(j), v);
  }
  bool take_modes();
  bool take_zero_modes();
  bool add_elastic_coordinates();
  void write(BlockEigenbasis& basis) const;

  const SymmetricPencil& pencil_;
  const Spectrum<kMaxDof>& spectrum_;
  std::array<Plane, kMaxDof> planes_;
  std::array<Column, kMaxDof> zeros_;  ///< of unit length
  int plane_count_ = 0, zero_count_ = 0;
  std::array<bool, kMaxWidth> taken_{};  ///< columns of the spectrum's basis
};

bool BasisFromSpectrum::take_modes() {
  for (const Mode<kMaxDof>& mode : spectrum_.modes) {
    const auto [i, j] = mode.columns;
    if (!make_plane(pencil_, column(i), column(j), planes_[at(plane_count_++)])) return false;
    taken_[at(i)] = taken_[at(j)] = true;
  }
  return true;
}

/// Velocities of zero modes are what the modes left over.
bool BasisFromSpectrum::take_zero_modes() {
  for (const Block& block : spectrum_.basis.blocks) {
    const int last = block.first + block.size - 1;
    if (block.size > 2 || zero_count_ == kMaxDof) return false;
    if (taken_[at(last)] || (block.zero_mode && block.size == 1)) continue;
    const Column x = column(last);
    const double size = -products(pencil_, x, x).indefinite();
    if (!(size > 0)) return false;
    zeros_[at(zero_count_++)] = x / std::sqrt(size);
  }
  return true;
}

/// Elastic coordinates that no mode moves any more become modes again, of frequency zero.
bool BasisFromSpectrum::add_elastic_coordinates() {
  while (plane_count_ < pencil_.rank) {
    if (!pencil_.factored || zero_count_ == 0) return false;
    Column best;
    double largest = 0;
    for (int k = 0; k < pencil_.rank; ++k) {
      Column x = Column::Unit(pencil_.states(), k);
      for (int i = 0; i < plane_count_; ++i) {
        const auto& [first, second] = planes_[at(i)];
        x -= products(pencil_, first, x).indefinite() * first;
        x += products(pencil_, second, x).indefinite() * second;
      }
      const double size = products(pencil_, x, x).indefinite();
      if (size > largest) largest = size, best = x;
    }
    if (!(largest > kNeutral)) return false;
    planes_[at(plane_count_++)] = {best / std::sqrt(largest), zeros_[at(--zero_count_)]};
  }
  return true;
}

void resize(int modes, int zeros, BlockEigenbasis& basis) {
  basis = BlockEigenbasis{};
  basis.modes = modes;
  basis.zeros = zeros;
  basis.Z.width = packed_width(modes, zeros);
}

void set_column(int j, const Column& x, BlockEigenbasis& basis) {
  for (int row = 0; row < x.size(); ++row) basis.Z(row, j) = x[row];
}

void BasisFromSpectrum::write(BlockEigenbasis& basis) const {
  resize(plane_count_, zero_count_, basis);
  for (int i = 0; i < basis.modes; ++i) {
    set_column(basis.first(i), planes_[at(i)].first, basis);
    set_column(basis.second(i), planes_[at(i)].second, basis);
  }
  for (int k = 0; k < basis.zeros; ++k) set_column(2 * basis.modes + k, zeros_[at(k)], basis);
}

/// The plane of mode i, orthonormal in the energy metric.
Plane energy_plane(const SymmetricPencil& pencil, const BlockEigenbasis& basis, int i) {
  Plane plane{Column(pencil.states()), Column(pencil.states())};
  for (int row = 0; row < pencil.states(); ++row) {
    plane.first[row] = basis.Z(row, basis.first(i));
    plane.second[row] = basis.Z(row, basis.second(i));
  }
  plane.first /= std::sqrt(products(pencil, plane.first, plane.first).energy());
  plane.second -= products(pencil, plane.first, plane.second).energy() * plane.first;
  const double size = std::sqrt(products(pencil, plane.second, plane.second).energy());
  plane.second *= size > 0 ? 1 / size : 0;
  return plane;
}

/// Returns the overlap of plane a with the energy metric times plane b.
double overlap(const Plane& a, const Plane& image) {
  double sum = 0;
  for (const Column* x : {&a.first, &a.second}) {
    for (const Column* y : {&image.first, &image.second}) sum += x->dot(*y) * x->dot(*y);
  }
  return std::isfinite(sum) ? sum : 0;
}

}  // namespace

void form_stiffness(System<kMaxDof>& system) noexcept {
  const auto& W = system.stiffness_factor;
  const Eigen::Index n = system.dof();
  // Products are exact, sums within 3 u^2 of partial sums no longer than those of absolute values.
  const double loss = 4 * static_cast<double>(W.rows()) * kUnit * kUnit;
  if (system.stiffness_error.size() == 0) system.stiffness_error.setZero(n, n);
  system.stiffness.resize(n, n);
  system.stiffness_low.resize(n, n);
  system.damping_low.setZero(n, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i <= j; ++i) {
      DotAccumulator sum;
      double size = 0;
      for (Eigen::Index k = 0; k < W.rows(); ++k) {
        sum.add(W(k, i), W(k, j));
        size += std::abs(W(k, i) * W(k, j));
      }
      system.stiffness(i, j) = system.stiffness(j, i) = sum.value().high;
      system.stiffness_low(i, j) = system.stiffness_low(j, i) = sum.value().low;
      system.stiffness_error(i, j) += loss * size;
      if (i != j) system.stiffness_error(j, i) += loss * size;
    }
  }
  system.has_low_words = true;
}

bool start_basis(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                 BlockEigenbasis& basis) noexcept {
  return BasisFromSpectrum(pencil, spectrum).run(basis);
}

void set_planes(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                BlockEigenbasis& basis) noexcept {
  // Nonsymmetric damping and rounding errors can make modes of zero modes: there are more of them
  // than rows of W then, and no room for zero modes as well.
  resize(spectrum.modes.size(), 0, basis);
  for (int i = 0; i < basis.modes; ++i) {
    const Mode<kMaxDof>& mode = spectrum.modes[i];
    const ComplexVector<kMaxDof>& u = mode.shapes[0];
    const ComplexVector<kMaxDof> v = mode.eigenvalues[0] * u;
    const bool real = mode.eigenvalues[0].imag() == 0;
    const Vector<kMaxDof> none = Vector<kMaxDof>::Zero(u.size()), re = u.real(), im = u.imag();
    set_column(basis.first(i), state(pencil, re, real ? none : Vector<kMaxDof>(v.real())), basis);
    set_column(basis.second(i),
               real ? state(pencil, none, re) : state(pencil, im, Vector<kMaxDof>(v.imag())),
               basis);
  }
}

std::array<int, kMaxDof> match_modes(const SymmetricPencil& pencil, const BlockEigenbasis& before,
                                     BlockEigenbasis& basis) noexcept {
  const int count = basis.vibrations();
  std::array<std::array<double, kMaxDof>, kMaxDof> overlaps{};
  std::array<Plane, kMaxDof> planes;
  for (int i = 0; i < count; ++i) planes[at(i)] = energy_plane(pencil, basis, i);
  for (int j = 0; j < count; ++j) {
    const Plane old = energy_plane(pencil, before, j);
    const Plane image{energy_image(pencil, old.first), energy_image(pencil, old.second)};
    for (int i = 0; i < count; ++i) overlaps[at(i)][at(j)] = overlap(planes[at(i)], image);
  }
  std::array<int, kMaxDof> index{};
  const PackedMatrix Z = basis.Z, Y = basis.Y;
  for (int pair = 0; pair < count; ++pair) {
    std::size_t mode = 0, place = 0;
    double most = -1;
    for (std::size_t i = 0; i < at(count); ++i) {
      for (std::size_t j = 0; j < at(count); ++j) {
        if (overlaps[i][j] > most) most = overlaps[i][j], mode = i, place = j;
      }
    }
    for (std::size_t k = 0; k < at(count); ++k) overlaps[mode][k] = overlaps[k][place] = -1;
    const auto from = static_cast<int>(mode), to = static_cast<int>(place);
    index[mode] = to;
    for (int row = 0; row < pencil.states(); ++row) {
      basis.Z(row, basis.first(to)) = Z(row, basis.first(from));
      basis.Z(row, basis.second(to)) = Z(row, basis.second(from));
      if (!basis.two_sided) continue;
      basis.Y(basis.first(to), row) = Y(basis.first(from), row);
      basis.Y(basis.second(to), row) = Y(basis.second(from), row);
    }
  }
  return index;
}

}  // namespace dashpot::analysis
