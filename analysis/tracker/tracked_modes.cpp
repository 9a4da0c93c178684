#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/spectrum/enclosure.hpp>
#include <dashpot/analysis/spectrum/mode_numbers.hpp>
#include <dashpot/analysis/tracker/tracked_start.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

/// Times the squared frequency that separated zero modes from others: rounding errors may reach it.
constexpr double kWellAbove = 4;

using Roots = std::array<BlockRoot, 2 * kMaxDof>;

/// Two roots for each mode, in the order of the modes, then one for each zero mode; with the radius
/// of the disc of each.
void list_roots(const BlockEigenbasis& basis, const TrackedEnclosure& enclosure, Roots& roots) {
  for (int i = 0; i < basis.modes; ++i) {
    const Block2<double> L = basis.block(i);
    std::array<Complex, 2> values;
    eigenvalues_2x2(L.a, L.b, L.c, L.d, values[0], values[1]);
    const double norm = std::sqrt(L.squared_norm());
    const double radius = enclosure.radius[i] + 16 * kUnit * norm;
    const bool conjugate = values[0].imag() != 0;
    for (int e = 0; e < 2; ++e) {
      BlockRoot& root = roots[at(2 * i + e)];
      root.value = values[at(e)];
      root.block = i;
      root.radius = e == 1 && conjugate ? roots[at(2 * i)].radius
                                        : disc_radius(values.data(), 2, e, norm, radius);
    }
  }
  for (int k = 0; k < basis.zeros; ++k) {
    BlockRoot& root = roots[at(2 * basis.modes + k)];
    root.value = basis.rate[at(k)];
    root.block = basis.modes + k;
    root.radius = enclosure.radius[basis.modes + k];
  }
}

/// What a group of four modes needs for one eigenvector each: w, and the eigenvalues mu.
struct VectorGroup {
  std::array<Complex, 4> w0, w1, mu;
};

/// Lambda, and so w, belongs to the basis before the step E.
void set_vector(const BlockEigenbasis& basis, const PackedMatrix& E, int i, const Complex& mu,
                int lane, VectorGroup& group) {
  const int j = basis.modes + i;
  const auto [a, b, c, d] = basis.block(i);
  const std::array<Complex, 2> w = eigenvector_2x2(a, b, c, d, mu);
  group.mu[at(lane)] = mu;
  group.w0[at(lane)] = w[0] - (E(i, i) * w[0] + E(i, j) * w[1]);
  group.w1[at(lane)] = w[1] - (E(j, i) * w[0] + E(j, j) * w[1]);
}

/// Largest velocity times root of the energy, below which a vector of unit elastic energy does
/// not move.
constexpr double kNoMotion = 1e-290;

/// u = V w of unit kinetic energy u^H M u, its largest entry real and positive, for `lanes` modes
/// from `first` on.
void write_shapes(const BlockEigenbasis& basis, const PackedMatrix& momenta, int first, int lanes,
                  std::size_t which, const VectorGroup& group,
                  std::array<TrackedShapes, kMaxDof>& out) {
  const int n = basis.modes + basis.zeros;
  const auto gather = [](const std::array<Complex, 4>& from, bool imaginary) {
    Vec4d result;
    for (int l = 0; l < 4; ++l) result[l] = imaginary ? from[at(l)].imag() : from[at(l)].real();
    return result;
  };
  const Vec4d a = gather(group.w0, false), b = gather(group.w0, true);
  const Vec4d c = gather(group.w1, false), d = gather(group.w1, true);
  std::array<Vec4d, kMaxDof> x, y;
  Vec4d energy{}, largest{}, x_largest{}, y_largest{};
  for (int k = 0; k < n; ++k) {
    const Vec4d v = load(basis.Z.row(basis.modes + k) + first);
    const Vec4d w = load(basis.Z.row(basis.modes + k) + basis.modes + first);
    const Vec4d p = load(momenta.row(k) + first);
    const Vec4d q = load(momenta.row(k) + basis.modes + first);
    const Vec4d re = v * a + w * c, im = v * b + w * d;
    energy += re * (p * a + q * c) + im * (p * b + q * d);
    const Vec4d size = re * re + im * im;
    const auto larger = size > largest;
    largest = larger ? size : largest;
    x_largest = larger ? re : x_largest;
    y_largest = larger ? im : y_largest;
    x[at(k)] = re;
    y[at(k)] = im;
  }
  for (int lane = 0; lane < lanes; ++lane) {
    const double size = std::sqrt(largest[lane]) * std::sqrt(energy[lane]);
    const double factor = size > kNoMotion ? 1 / size : 0;
    const Complex f(x_largest[lane] * factor, -y_largest[lane] * factor);
    TrackedShapes& shapes = out[at(first + lane)];
    ComplexVector<kMaxDof>& u = shapes.u[which];
    u.resize(n);
    for (int k = 0; k < n; ++k) {
      u[k] = Complex(f.real() * x[at(k)][lane] - f.imag() * y[at(k)][lane],
                     f.real() * y[at(k)][lane] + f.imag() * x[at(k)][lane]);
    }
    // With the state x = (W u, mu u) = mu f Z w: u'(2 mu M + C) u = -x'Sx / mu (no conjugation).
    const Complex w0 = group.w0[at(lane)], w1 = group.w1[at(lane)];
    shapes.slope[which] =
        -product(product(group.mu[at(lane)], product(f, f)), product(w0 - w1, w0 + w1));
  }
}

/// Makes zero modes of the still blocks; false if the zero modes have to be decided again.
bool part_zero_modes(const BlockEigenbasis& basis, TrackedSpectrum& out) {
  const double floor2 = basis.still_floor * basis.still_floor;
  for (int i = 0; basis.zeros == 0 && i < basis.modes; ++i) {
    const double rate2 = std::abs(basis.block(i).determinant());
    if (i < basis.vibrations() ? !(rate2 > floor2) : !(rate2 <= kWellAbove * floor2)) return false;
  }
  if (basis.still == 0) return true;
  out.mode_count = basis.vibrations();
  out.zero_mode_count = basis.still;
  for (int k = 0; k < basis.still; ++k) {
    out.zero_mode_rates[at(k)] = basis.block(out.mode_count + k).trace();  // and zero
  }
  const bool proved =
      std::all_of(out.modes.begin(), out.modes.begin() + out.mode_count,
                  [](const ModeNumbers& mode) { return std::isfinite(mode.error_bound); });
  out.status = proved ? Status::kOk : Status::kUncertified;
  return true;
}

}  // namespace

void sort_by_frequency(TrackedSpectrum& out) noexcept {
  std::array<double, kMaxDof> key{};
  for (int i = 0; i < out.mode_count; ++i) {
    const auto& values = out.modes[at(i)].eigenvalues;
    key[at(i)] = modulus(values[0]) * modulus(values[1]);
    int position = i;
    for (; position > 0 && key[at(out.order[at(position - 1)])] < key[at(i)]; --position) {
      out.order[at(position)] = out.order[at(position - 1)];
    }
    out.order[at(position)] = i;
  }
}

bool read_numbers(const BlockEigenbasis& basis, const TrackedEnclosure& enclosure,
                  double soft_frequency, std::array<bool, kMaxDof>& soft,
                  TrackedSpectrum& out) noexcept {
  Roots roots;
  list_roots(basis, enclosure, roots);
  bound_roots(roots.data(), basis.columns(), enclosure.group);
  out.mode_count = basis.modes;
  out.status = Status::kOk;
  for (int i = 0; i < basis.modes; ++i) {
    const BlockRoot &first = roots[at(2 * i)], &second = roots[at(2 * i + 1)];
    const auto [a, b, c, d] = basis.block(i);
    Invariants invariants = block_invariants(a, b, c, d, enclosure.radius[i]);
    if (!enclosure.alone(i)) {
      const Invariants of_roots = root_invariants(first, second);
      invariants.sum_error = of_roots.sum_error;
      invariants.product_error = of_roots.product_error;
      invariants.discriminant_error = of_roots.discriminant_error;
    }
    ModeNumbers& mode = out.modes[at(i)];
    mode = mode_numbers(first, second, invariants, soft_frequency * (soft[at(i)] ? 2 : 1));
    soft[at(i)] = mode.kind == ModeKind::kSoft;
    if (!std::isfinite(mode.error_bound)) out.status = Status::kUncertified;
  }
  out.zero_mode_count = basis.zeros;
  for (int k = 0; k < basis.zeros; ++k) out.zero_mode_rates[at(k)] = basis.rate[at(k)];
  if (basis.two_sided && !part_zero_modes(basis, out)) return false;
  sort_by_frequency(out);
  return true;
}

void read_slopes(const SymmetricPencil& pencil, bool symmetric, TrackedSpectrum& out) noexcept {
  const Eigen::Map<const Eigen::MatrixXd> M(pencil.M, pencil.joints, pencil.joints),
      C(pencil.C, pencil.joints, pencil.joints);
  for (int i = 0; i < out.mode_count; ++i) {
    TrackedShapes& shapes = out.shapes[at(i)];
    shapes.slope = {};
    for (std::size_t k = 0; symmetric && k < 2; ++k) {
      const ComplexVector<kMaxDof>& u = shapes.u[k];
      const ComplexVector<kMaxDof> Mu = M.lazyProduct(u), Cu = C.lazyProduct(u);
      shapes.slope[k] = (u.transpose() * (2.0 * out.modes[at(i)].eigenvalues[k] * Mu + Cu)).value();
    }
  }
}

void read_shapes(const SymmetricPencil& pencil, bool symmetric, const BlockEigenbasis& basis,
                 const PackedMatrix& E, PackedMatrix& momenta, TrackedSpectrum& out) noexcept {
  momenta.width = basis.Z.width;
  padded_multiply(momenta.width)({pencil.M, 1, pencil.joints}, pencil.joints, pencil.joints,
                                 basis.Z.row(pencil.rank), nullptr, 1, momenta.row(0),
                                 momenta.width);
  for (int first = 0; first < basis.modes; first += 4) {
    const int lanes = std::min(4, basis.modes - first);
    VectorGroup group{};
    bool any_real = false;
    const auto vectors = [&](std::size_t which) {
      for (int lane = 0; lane < lanes; ++lane) {
        const auto& values = out.modes[at(first + lane)].eigenvalues;
        set_vector(basis, E, first + lane, values[which], lane, group);
        any_real |= values[0].imag() == 0;
      }
      write_shapes(basis, momenta, first, lanes, which, group, out.shapes);
    };
    vectors(0);
    if (any_real) vectors(1);
    for (int i = first; i < first + lanes; ++i) {
      if (out.modes[at(i)].eigenvalues[0].imag() == 0) continue;
      TrackedShapes& shapes = out.shapes[at(i)];
      shapes.u[1] = shapes.u[0].conjugate();
      shapes.slope[1] = std::conj(shapes.slope[0]);
    }
  }
  if (basis.two_sided) read_slopes(pencil, symmetric, out);
}

}  // namespace dashpot::analysis
