#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/tracker/mode_labels.hpp>
#include <dashpot/analysis/tracker/state_column.hpp>

#include <cmath>

namespace dashpot::analysis {
namespace {

/// The plane of mode i, orthonormal in the energy metric.
Plane energy_plane(const SymmetricPencil& pencil, const BlockEigenbasis& basis, int i) {
  Plane plane = plane_of(pencil, basis, i);
  plane.first /= std::sqrt(products(pencil, plane.first, plane.first).energy());
  plane.second -= products(pencil, plane.first, plane.second).energy() * plane.first;
  const double size = std::sqrt(products(pencil, plane.second, plane.second).energy());
  plane.second *= size > 0 ? 1 / size : 0;
  return plane;
}

/// Products of plane a and of the energy metric times plane b.
double overlap(const Plane& a, const Plane& image) {
  double sum = 0;
  for (const Column* x : {&a.first, &a.second}) {
    for (const Column* y : {&image.first, &image.second}) sum += x->dot(*y) * x->dot(*y);
  }
  return std::isfinite(sum) ? sum : 0;
}

/// Matches the modes of `basis` to the modes of `before` that they resemble, the most alike first:
/// in the overlap of the planes that two modes span (modal assurance criterion in the energy
/// metric). Mode i of `basis` becomes mode index[i].
std::array<int, kMaxDof> match_modes(const SymmetricPencil& pencil, const BlockEigenbasis& before,
                                     BlockEigenbasis& basis) {
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

}  // namespace

std::array<int, kMaxDof> ModeLabels::match(const System<kMaxDof>& system, bool symmetric,
                                           bool any_before, const BlockEigenbasis& before,
                                           BlockEigenbasis& basis) noexcept {
  if (!any_before || before.vibrations() != basis.vibrations()) {
    ++epoch;
    soft = {};
    std::array<int, kMaxDof> index{};
    for (int i = 0; i < kMaxDof; ++i) index[at(i)] = i;
    return index;
  }
  SymmetricPencil metric = symmetric_pencil(system);
  Square<kMaxDof> positions;
  if (!metric.factored && (basis.two_sided || !symmetric)) {  // K is not a metric then
    const double rate2 = system.stiffness.cwiseAbs().maxCoeff() / system.mass.cwiseAbs().maxCoeff();
    positions = rate2 * system.mass;
    metric.W = positions.data();
  }
  return match_modes(metric, before, basis);
}

void set_planes(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                BlockEigenbasis& basis) noexcept {
  // Nonsymmetric damping and rounding errors can make modes of zero modes: there are more of them
  // than rows of W then, and no room for zero modes as well.
  basis = BlockEigenbasis{};
  basis.modes = spectrum.modes.size();
  basis.Z.width = packed_width(basis.modes, 0);
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

namespace {

/// Squared error of an extrapolation, relative to a simpler one, that makes it worth using.
constexpr double kForeseen = 0.25;

}  // namespace

void BasisExtrapolation::Side::apply(int rows, PackedMatrix& Z) noexcept {
  if (!begun_) {
    for (PackedMatrix* known : {&step_, &change_, &curve_}) set_zero(Z.width, rows, *known);
    copy(Z, rows, last_);
    begun_ = true;
    return;
  }
  const int size = rows * Z.width;
  Vec4d by_last{}, by_step{}, by_change{}, by_curve{};  // squared errors of each degree
  for (int k = 0; k < size; k += 4) {
    const Vec4d now = load(&Z.items[at(k)]);
    const Vec4d step = now - load(&last_.items[at(k)]);
    const Vec4d change = step - load(&step_.items[at(k)]);
    const Vec4d curve = change - load(&change_.items[at(k)]);
    const Vec4d rest = curve - load(&curve_.items[at(k)]);
    by_last += step * step;
    by_step += change * change;
    by_change += curve * curve;
    by_curve += rest * rest;
    store(&last_.items[at(k)], now);
    store(&step_.items[at(k)], step);
    store(&change_.items[at(k)], change);
    store(&curve_.items[at(k)], curve);
  }
  const double last = sum(by_last), first = sum(by_step), second = sum(by_change),
               third = sum(by_curve);
  const double least = second < third ? second : third;
  if (!(first < kForeseen * last || least < kForeseen * last)) return;
  const double change = least < kForeseen * first ? 1 : 0;
  const double curve = change != 0 && third < kForeseen * second ? 1 : 0;
  for (int k = 0; k < size; k += 4) {
    store(&Z.items[at(k)], load(&last_.items[at(k)]) + load(&step_.items[at(k)]) +
                               change * load(&change_.items[at(k)]) +
                               curve * load(&curve_.items[at(k)]));
  }
}

void BasisExtrapolation::apply(BlockEigenbasis& basis) noexcept {
  right_.apply(basis.columns(), basis.Z);
  if (basis.two_sided) left_.apply(basis.columns(), basis.Y);
}

void BasisExtrapolation::go_back(BlockEigenbasis& basis) noexcept {
  copy(right_.last(), basis.columns(), basis.Z);
  if (basis.two_sided) copy(left_.last(), basis.columns(), basis.Y);
  forget();
}

}  // namespace dashpot::analysis
