#include <dashpot/analysis/tracked_certificate.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace dashpot::analysis {
namespace {

constexpr double kUnit = std::numeric_limits<double>::epsilon() / 2;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// For the rounding errors of the bounds themselves.
constexpr double kSlack = 1 + 1e-10;
/// Largest distance of the Gram matrix from Sigma that is looked at as a perturbation.
constexpr double kNearlyOrthonormal = 0.1;

std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

double square(double x) {
  return x * x;
}

Lanes magnitude(const Lanes& x) {
  return x < Lanes{} ? -x : x;
}

/// Errors of N and G, entrywise, with the vectors a, b, m (one entry a column of Z) and a factor
/// gamma:   |N error| <= gamma (a a' + m m'),   |Z' B Z error| <= gamma (a b' + b a' + c m m').
/// a is the size of a column's strains, b of what its velocities strain, m of its momenta.
struct ErrorSizes {
  using Columns = std::array<double, kMaxWidth>;
  Columns a{}, b{}, m{};
  double c = 0, gamma = 0;
  double a_norm = 0, b_norm = 0, m_norm = 0;
  double a_rate = 0, m_rate = 0;  ///< norms with the columns of block j times |Lambda_j|
};

/// A block's part of these, and |Lambda_i|.
struct BlockSizes {
  double a, b, m, rate;
};

BlockSizes block_sizes(const TrackedBasis& basis, const ErrorSizes& sizes, int i) {
  const std::size_t first = at(basis.first(i)), second = at(basis.second(i));
  if (i >= basis.modes) {
    return {sizes.a[first], sizes.b[first], sizes.m[first],
            std::abs(basis.rate[at(i - basis.modes)])};
  }
  const std::size_t k = at(i);
  return {std::sqrt(square(sizes.a[first]) + square(sizes.a[second])),
          std::sqrt(square(sizes.b[first]) + square(sizes.b[second])),
          std::sqrt(square(sizes.m[first]) + square(sizes.m[second])),
          std::sqrt(square(basis.l00[k]) + square(basis.l01[k]) + square(basis.l10[k]) +
                    square(basis.l11[k]))};
}

ErrorSizes error_sizes(const StateForm& form, const CoefficientSizes& sizes, double distance,
                       const TrackedBasis& basis) {
  const int columns = basis.columns(), p = form.strains, width = basis.Z.width;
  ErrorSizes e;
  // Two nested sums of p + n terms each, and the subtraction of N Lambda.
  e.gamma = (2 * form.states() + 16) * kUnit + distance;
  e.c = sizes.damping;
  const double mass = std::sqrt(sizes.mass);
  for (int j = 0; j < width; j += 4) {
    Lanes a{}, b{}, m{};
    const auto entries = [&](int row) { return magnitude(load(basis.Z.row(row) + j)); };
    if (form.factored) {
      for (int k = 0; k < p; ++k) {
        const Lanes z = load(basis.Z.row(k) + j);
        a += z * z;
      }
    } else {
      for (int k = 0; k < p; ++k) a += (sizes.stiffness * sizes.s[at(k)]) * entries(k);
      a *= a;
    }
    for (int k = 0; k < form.joints; ++k) {
      const Lanes v = entries(p + k);
      b += sizes.strain[at(k)] * v;
      m += (mass * sizes.s[at(k)]) * v;
    }
    for (int lane = 0; lane < 4; ++lane) {
      e.a[at(j + lane)] = std::sqrt(a[lane]);
      e.b[at(j + lane)] = b[lane];
      e.m[at(j + lane)] = m[lane];
    }
  }
  e.c /= sizes.mass;
  for (int j = 0; j < columns; ++j) {
    e.a_norm += square(e.a[at(j)]);
    e.b_norm += square(e.b[at(j)]);
    e.m_norm += square(e.m[at(j)]);
  }
  for (int i = 0; i < basis.blocks(); ++i) {
    const BlockSizes block = block_sizes(basis, e, i);
    e.a_rate += square(block.a * block.rate);
    e.m_rate += square(block.m * block.rate);
  }
  for (double* sum : {&e.a_norm, &e.b_norm, &e.m_norm, &e.a_rate, &e.m_rate}) {
    *sum = std::sqrt(*sum);
  }
  return e;
}

/// Lower bounds of sep(Lambda_i, Lambda_j), the smallest singular value of X -> Lambda_i X - X
/// Lambda_j, for all pairs of blocks. With p the characteristic polynomial of B, and A X - X B = Q,
/// p(A) X = (A - t/2) Q + Q (B - t/2), t = tr B, so that sep >= s_min(p(A)) / (|A - t/2| + |B -
/// t/2|).
class Separations {
 public:
  explicit Separations(const TrackedBasis& basis) : basis_(basis) {
    for (std::size_t i = 0; i < at(basis.modes); ++i) {
      const double half = 0.5 * (basis.l00[i] - basis.l11[i]);
      const double cross = square(basis.l01[i]) + square(basis.l10[i]);
      trace_[i] = basis.l00[i] + basis.l11[i];
      determinant_[i] = basis.l00[i] * basis.l11[i] - basis.l01[i] * basis.l10[i];
      traceless_[i] = std::sqrt(2 * square(half) + cross);
      size2_[i] = square(basis.l00[i]) + square(basis.l11[i]) + cross;
    }
  }

  /// Of mode i from every mode; what it is from itself means nothing.
  std::array<double, kMaxDof> from_mode(int i) const {
    std::array<double, kMaxDof> result;
    const double a = basis_.l00[at(i)], b = basis_.l01[at(i)], c = basis_.l10[at(i)],
                 d = basis_.l11[at(i)];
    for (int j = 0; j < basis_.modes; j += 4) {
      const Lanes trace = load(&trace_[at(j)]);
      const Lanes across = trace_[at(i)] - trace, product = b * c + load(&determinant_[at(j)]);
      const Lanes p00 = a * (a - trace) + product, p11 = d * (d - trace) + product;
      const Lanes p01 = b * across, p10 = c * across;
      // s_min = |det p| / s_max, s_max at most the sum of all entries, less p's rounding errors.
      const Lanes sum = magnitude(p00) + magnitude(p01) + magnitude(p10) + magnitude(p11);
      const Lanes rounding = 64 * kUnit * (size2_[at(i)] + trace * trace + load(&size2_[at(j)]));
      const Lanes halves =
          traceless_[at(i)] + load(&traceless_[at(j)]) + 0.7072 * magnitude(across);
      const Lanes least = magnitude(p00 * p11 - p01 * p10) - rounding * sum;
      store(&result[at(j)], least / (kSlack * sum * halves));
    }
    return result;
  }

  double between(int i, int j) const {
    if (i >= basis_.modes && j >= basis_.modes) {
      return std::abs(basis_.rate[at(i - basis_.modes)] - basis_.rate[at(j - basis_.modes)]);
    }
    if (i < basis_.modes && j < basis_.modes) return from_mode(i)[at(j)];
    if (i >= basis_.modes) std::swap(i, j);
    const double x = basis_.rate[at(j - basis_.modes)], trace = trace_[at(i)];
    const double least = std::abs(x * x - trace * x + determinant_[at(i)]) -
                         64 * kUnit * (x * x + square(trace) + size2_[at(i)]);
    return least / (kSlack * (std::abs(x - 0.5 * trace) + traceless_[at(i)]));
  }

  /// Of mode i from all other blocks.
  double from_rest(int i) const {
    const std::array<double, kMaxDof> modes = from_mode(i);
    double least = kInfinity;
    for (int j = 0; j < basis_.modes; ++j) {
      if (j != i && !(modes[at(j)] >= least)) least = modes[at(j)];
    }
    for (int j = basis_.modes; j < basis_.blocks(); ++j) {
      const double apart = between(i, j);
      if (!(apart >= least)) least = apart;
    }
    return least;
  }

 private:
  const TrackedBasis& basis_;
  TrackedBasis::Entries trace_{}, determinant_{}, traceless_{}, size2_{};
};

/// Norms of F for one set of blocks and the rest.
struct SetNorms {
  double inner = 0, right = 0, left = 0;
};

class Prover {
 public:
  Prover(const StateForm& form, const CoefficientSizes& sizes, double distance,
         const TrackedBasis& basis, const TrackedDefect& defect)
      : basis_(basis),
        defect_(defect),
        sizes_(error_sizes(form, sizes, distance, basis)),
        separations_(basis) {
    sum_squares();
    const double N_error = sizes_.gamma * (square(sizes_.a_norm) + square(sizes_.m_norm));
    R_norm_ = std::sqrt(R_total_) + N_error;
    G_error_ =
        sizes_.gamma * (2 * sizes_.a_norm * sizes_.b_norm + sizes_.c * square(sizes_.m_norm) +
                        sizes_.a_norm * sizes_.a_rate + sizes_.m_norm * sizes_.m_rate);
    F_norm_ = kSlack * (std::sqrt(G_total_) + G_error_) / (1 - R_norm_);
  }

  double noise() const { return G_error_; }
  bool provable() const { return R_norm_ < kNearlyOrthonormal && F_norm_ < kInfinity; }

  /// One mode: radius of its block, or a negative number if it cannot be separated.
  double mode_radius(int i) const {
    const std::size_t first = at(i), second = at(basis_.modes + i);
    return radius(finish(i, defect_.diagonal[at(i)], G_rows_[first] + G_rows_[second],
                         G_columns_[first] + G_columns_[second]),
                  separations_.from_rest(i));
  }

  /// Grows the group of block i until it can be separated, and writes its radius.
  void prove_group(int i, TrackedCertificate& certificate) const;

 private:
  void sum_squares();

  /// Errors and the Gram matrix added to the squared norms of a block's G, all rows and columns.
  SetNorms finish(int i, double inner, double right, double left) const {
    const BlockSizes block = block_sizes(basis_, sizes_, i);
    double R = R_rows_[at(basis_.first(i))];
    if (i < basis_.modes) R += R_rows_[at(basis_.second(i))];
    return add_errors(block, block.a * block.rate, block.m * block.rate, R, inner, right, left);
  }
  SetNorms add_errors(const BlockSizes& block, double a_rate, double m_rate, double R_square,
                      double inner, double right, double left) const {
    const ErrorSizes& e = sizes_;
    const double N_rows = e.gamma * (block.a * e.a_norm + block.m * e.m_norm);
    const double rows =
        e.gamma * (block.a * e.b_norm + block.b * e.a_norm + e.c * block.m * e.m_norm +
                   block.a * e.a_rate + block.m * e.m_rate);
    const double columns =
        e.gamma * (block.a * e.b_norm + block.b * e.a_norm + e.c * block.m * e.m_norm +
                   e.a_norm * a_rate + e.m_norm * m_rate);
    const double own = e.gamma * (2 * block.a * block.b + e.c * square(block.m) + block.a * a_rate +
                                  block.m * m_rate);
    const double R = std::sqrt(R_square) + N_rows;
    SetNorms norms;
    norms.left = kSlack * (std::sqrt(left + inner) + columns) / (1 - R_norm_);
    norms.right = kSlack * (std::sqrt(right) + rows + R * F_norm_);
    norms.inner = kSlack * (std::sqrt(inner) + own + R * norms.left);
    return norms;
  }

  double radius(const SetNorms& norms, double separated) const {
    if (separated == kInfinity) return norms.inner;
    const double delta = separated - norms.inner - F_norm_;
    const double product = norms.right * norms.left;
    if (!(delta > 0) || !(4 * product < delta * delta)) return -1;
    return kSlack * (norms.inner + 2 * product / delta);
  }

  const TrackedBasis& basis_;
  const TrackedDefect& defect_;
  ErrorSizes sizes_;
  Separations separations_;
  std::array<double, kMaxWidth> G_rows_{}, G_columns_{}, R_rows_{};  ///< squared norms
  double G_total_ = 0, R_total_ = 0, G_error_ = 0, R_norm_ = 0, F_norm_ = 0;
};

/// Squared norms of the rows and columns of G (without diagonal blocks), and of the rows of
/// Sigma - N.
void Prover::sum_squares() {
  const int columns = basis_.columns(), width = basis_.Z.width;
  std::array<Lanes, kMaxWidth / 4> sums{};
  for (int i = 0; i < columns; ++i) {
    Lanes G_sum{}, R_sum{};
    const double* const g = defect_.G.row(i);
    const double* const r = defect_.R.row(i);
    for (int j = 0; j < width; j += 4) {
      const Lanes x = load(g + j), y = load(r + j), squares = x * x;
      G_sum += squares;
      R_sum += y * y;
      sums[at(j / 4)] += squares;
    }
    R_rows_[at(i)] = (R_sum[0] + R_sum[1]) + (R_sum[2] + R_sum[3]);
    R_total_ += R_rows_[at(i)];
    G_rows_[at(i)] = (G_sum[0] + G_sum[1]) + (G_sum[2] + G_sum[3]);
    G_total_ += G_rows_[at(i)];
  }
  std::memcpy(G_columns_.data(), sums.data(), sizeof G_columns_);
  for (int i = 0; i < basis_.modes; ++i) G_total_ += defect_.diagonal[at(i)];
}

void Prover::prove_group(int i, TrackedCertificate& certificate) const {
  const int blocks = basis_.blocks();
  const auto inside = [&](int block) { return certificate.group[at(block)] == i; };
  std::array<int, kMaxWidth> owner{};
  for (int block = 0; block < blocks; ++block) {
    owner[at(basis_.first(block))] = owner[at(basis_.second(block))] = block;
  }
  for (;;) {
    double separated = kInfinity, inner = 0, right = 0, left = 0, R = 0;
    int nearest = -1;
    BlockSizes set{0, 0, 0, 0};
    double a_rate = 0, m_rate = 0;
    for (int j = 0; j < blocks; ++j) {
      if (!inside(j)) continue;
      if (j < basis_.modes) inner += defect_.diagonal[at(j)];
      const BlockSizes block = block_sizes(basis_, sizes_, j);
      set.a += square(block.a);
      set.b += square(block.b);
      set.m += square(block.m);
      a_rate += square(block.a * block.rate);
      m_rate += square(block.m * block.rate);
      for (int k = 0; k < blocks; ++k) {
        if (inside(k)) continue;
        const double apart = std::max(0.0, separations_.between(j, k));
        if (apart < separated || nearest < 0) separated = apart, nearest = k;
      }
    }
    for (int row = 0; row < basis_.columns(); ++row) {
      const bool row_inside = inside(owner[at(row)]);
      if (row_inside) R += R_rows_[at(row)];
      for (int column = 0; column < basis_.columns(); ++column) {
        const bool column_inside = inside(owner[at(column)]);
        const double g = square(defect_.G(row, column));
        if (row_inside) (column_inside ? inner : right) += g;
        if (!row_inside && column_inside) left += g;
      }
    }
    set = {std::sqrt(set.a), std::sqrt(set.b), std::sqrt(set.m), 0};
    const double found =
        radius(add_errors(set, std::sqrt(a_rate), std::sqrt(m_rate), R, inner, right, left),
               nearest < 0 ? kInfinity : separated);
    if (found >= 0 || nearest < 0) {
      for (int j = 0; j < blocks; ++j) {
        if (inside(j)) certificate.radius[at(j)] = found >= 0 ? found : kInfinity;
      }
      return;
    }
    const int absorbed = certificate.group[at(nearest)];
    for (int j = 0; j < blocks; ++j) {
      if (certificate.group[at(j)] == absorbed) certificate.group[at(j)] = i;
    }
  }
}

}  // namespace

CoefficientSizes coefficient_sizes(const StateForm& form) noexcept {
  const int n = form.joints;
  CoefficientSizes sizes;
  std::array<double, kMaxDof> inverse{};
  double smallest = kInfinity, largest = 0;
  for (int k = 0; k < n; ++k) {
    const double diagonal = form.M[k + k * n];
    smallest = std::min(smallest, diagonal);
    largest = std::max(largest, diagonal);
    sizes.s[at(k)] = std::sqrt(diagonal);
    inverse[at(k)] = 1 / sizes.s[at(k)];
  }
  double mass = 0, damping = 0, stiffness = 0;
  for (int j = 0; j < n; ++j) {
    double M = 0, C = 0, K = 0;
    for (int i = 0; i < n; ++i) {
      M = std::max(M, inverse[at(i)] * std::abs(form.M[i + j * n]));
      C = std::max(C, inverse[at(i)] * std::abs(form.C[i + j * n]));
      if (!form.factored) K = std::max(K, inverse[at(i)] * std::abs(form.W[i + j * n]));
    }
    mass = std::max(mass, M * inverse[at(j)]);
    damping = std::max(damping, C * inverse[at(j)]);
    stiffness = std::max(stiffness, K * inverse[at(j)]);
    double W = 0;
    for (int i = 0; form.factored && i < form.strains; ++i)
      W += square(form.W[i + j * form.strains]);
    sizes.strain[at(j)] = std::sqrt(W);
  }
  sizes.mass = kSlack * mass;
  sizes.damping = kSlack * damping;
  sizes.stiffness = kSlack * std::sqrt(stiffness);
  if (!form.factored) {
    for (int k = 0; k < n; ++k) sizes.strain[at(k)] = sizes.stiffness * sizes.s[at(k)];
  }
  const double rate = sizes.damping + sizes.stiffness;
  sizes.in_range = smallest > 1e-120 && largest < 1e120 && rate < 1e60;
  return sizes;
}

double distance(const StateForm& form, const StateForm& other, const CoefficientSizes& sizes,
                double limit) noexcept {
  const int n = form.joints;
  for (int k = 0; k < n * n; k += n + 1) {  // mostly, a glance at the diagonal is enough
    if (std::abs(form.M[k] - other.M[k]) > 2 * limit * sizes.mass * form.M[k]) return kInfinity;
  }
  double mass = 0, damping = 0, stiffness = 0;
  std::array<double, kMaxDof> inverse{};
  for (int k = 0; k < n; ++k) inverse[at(k)] = 1 / sizes.s[at(k)];
  // Changes relative to the sizes; zero by zero is no change.
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i <= j; ++i) {
      const int k = i + j * n;
      const double unit = inverse[at(i)] * inverse[at(j)];
      mass = std::max(mass, std::abs(form.M[k] - other.M[k]) * unit);
      damping = std::max(damping, std::abs(form.C[k] - other.C[k]) * unit);
      if (!form.factored) stiffness = std::max(stiffness, std::abs(form.W[k] - other.W[k]) * unit);
    }
    double W = 0;
    for (int i = 0; form.factored && i < form.strains; ++i) {
      W += square(form.W[i + j * form.strains] - other.W[i + j * form.strains]);
    }
    if (W > 0) stiffness = std::max(stiffness, std::sqrt(W) / sizes.strain[at(j)]);
  }
  if (!form.factored && stiffness > 0) stiffness /= square(sizes.stiffness);
  if (damping > 0) damping /= sizes.damping;
  return kSlack * std::max({mass / sizes.mass, damping, stiffness});
}

void certify(const StateForm& form, const CoefficientSizes& sizes, double distance,
             const TrackedBasis& basis, const TrackedDefect& defect,
             TrackedCertificate& certificate) noexcept {
  const int blocks = basis.blocks();
  for (int i = 0; i < blocks; ++i) {
    certificate.group[at(i)] = i;
    certificate.radius[at(i)] = kInfinity;
  }
  const Prover prover(form, sizes, distance, basis, defect);
  certificate.noise = prover.noise();
  if (sizes.in_range && prover.provable()) {
    for (int i = 0; i < basis.modes; ++i) {
      if (certificate.group[at(i)] != i) continue;
      const double radius = prover.mode_radius(i);
      if (radius >= 0) {
        certificate.radius[at(i)] = radius;
      } else {
        prover.prove_group(i, certificate);
      }
    }
  }
  for (int i = 0; i < blocks; ++i) {
    int members = 0;
    for (int j = 0; j < blocks; ++j) {
      members += certificate.group[at(j)] == certificate.group[at(i)] ? 1 : 0;
    }
    certificate.alone[at(i)] = members == 1;
  }
}

}  // namespace dashpot::analysis
