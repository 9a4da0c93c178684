#include <dashpot/analysis/tracker/tracked_enclosure.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

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

template <typename T>
T square(const T& x) {
  return x * x;
}

double square_root(double x) {
  return std::sqrt(x);
}
Vec4d square_root(Vec4d x) {
  for (int lane = 0; lane < 4; ++lane) x[lane] = std::sqrt(x[lane]);
  return x;
}

/// What bounds the errors of a set of blocks, of one, or of one in each lane.
template <typename T>
struct BlockSizes {
  T a, b, m;         ///< see ErrorSizes
  T a_rate, m_rate;  ///< a and m times |Lambda_i|
};

/// Errors of N and G, entrywise, with the vectors a, b, m (one entry a column of Z) and a factor
/// gamma:   |N error| <= gamma (a a' + m m'),   |Z' B Z error| <= gamma (a b' + b a' + c m m').
/// a is the size of a column's elastic coordinates, b of the elastic rates W v of its velocities, m
/// of its momenta.
class ErrorSizes {
 public:
  ErrorSizes(const SymmetricPencil& pencil, const CoefficientSizes& sizes, double distance,
             const BlockEigenbasis& basis)
      // Two nested sums of p + n terms each, and the subtraction of N Lambda.
      : gamma((2 * pencil.states() + 16) * kUnit + distance), c(sizes.damping / sizes.mass) {
    Columns a2, b, m;
    read_columns(pencil, sizes, basis, a2, b, m);
    const auto set = [&](int i, int first, int second, const auto& rate) {
      const auto two = [&](const Columns& x, bool squared) {
        const Vec4d y = load(&x[at(first)]), z = load(&x[at(second)]);
        return square_root(squared ? y + z : y * y + z * z);
      };
      const Vec4d a_i = two(a2, true), m_i = two(m, false);
      store(&a_[at(i)], a_i);
      store(&b_[at(i)], two(b, false));
      store(&m_[at(i)], m_i);
      store(&a_rate_[at(i)], a_i * rate);
      store(&m_rate_[at(i)], m_i * rate);
    };
    for (int i = 0; i < basis.modes; i += 4) {
      const auto square_of = [i](const BlockEigenbasis::Entries& l) {
        return load(&l[at(i)]) * load(&l[at(i)]);
      };
      set(i, i, basis.modes + i,
          square_root(square_of(basis.l00) + square_of(basis.l01) + square_of(basis.l10) +
                      square_of(basis.l11)));
    }
    for (int k = 0; k < basis.zeros; ++k) {
      const std::size_t i = at(basis.modes + k), column = at(2 * basis.modes + k);
      const double rate = std::abs(basis.rate[at(k)]);
      a_[i] = std::sqrt(a2[column]);
      b_[i] = b[column];
      m_[i] = m[column];
      a_rate_[i] = a_[i] * rate;
      m_rate_[i] = m_[i] * rate;
    }
    all = {norm(a_, basis), norm(b_, basis), norm(m_, basis), norm(a_rate_, basis),
           norm(m_rate_, basis)};
  }

  template <typename T>
  BlockSizes<T> of(int i) const {
    if constexpr (std::is_same_v<T, double>) {
      const std::size_t k = at(i);
      return {a_[k], b_[k], m_[k], a_rate_[k], m_rate_[k]};
    } else {
      const auto four = [i](const Blocks& x) { return load(&x[at(i)]); };
      return {four(a_), four(b_), four(m_), four(a_rate_), four(m_rate_)};
    }
  }

  double gamma, c;
  BlockSizes<double> all{};  ///< of all columns

 private:
  using Columns = std::array<double, kMaxWidth + 4>;
  using Blocks = std::array<double, kMaxDof + 4>;

  static void read_columns(const SymmetricPencil& pencil, const CoefficientSizes& sizes,
                           const BlockEigenbasis& basis, Columns& a2, Columns& b, Columns& m);
  static double norm(const Blocks& x, const BlockEigenbasis& basis) {
    double squares = 0;
    for (int i = 0; i < basis.blocks(); ++i) squares += square(x[at(i)]);
    return std::sqrt(squares);
  }

  Blocks a_, b_, m_, a_rate_, m_rate_;
};

/// a^2, b and m of each column.
void ErrorSizes::read_columns(const SymmetricPencil& pencil, const CoefficientSizes& sizes,
                              const BlockEigenbasis& basis, Columns& a2, Columns& b, Columns& m) {
  const int p = pencil.rank, width = basis.Z.width;
  const double mass = std::sqrt(sizes.mass);
  for (int j = 0; j < width; j += 4) {
    Vec4d a_sum{}, b_sum{}, m_sum{};
    const auto entries = [&](int row) { return magnitude(load(basis.Z.row(row) + j)); };
    if (pencil.factored) {
      for (int k = 0; k < p; ++k) {
        const Vec4d z = load(basis.Z.row(k) + j);
        a_sum += z * z;
      }
    } else {
      for (int k = 0; k < p; ++k) a_sum += (sizes.stiffness * sizes.s[at(k)]) * entries(k);
      a_sum *= a_sum;
    }
    for (int k = 0; k < pencil.joints; ++k) {
      const Vec4d v = entries(p + k);
      b_sum += sizes.elastic[at(k)] * v;
      m_sum += (mass * sizes.s[at(k)]) * v;
    }
    store(&a2[at(j)], a_sum);
    store(&b[at(j)], b_sum);
    store(&m[at(j)], m_sum);
  }
}

/// Lower bounds of sep(Lambda_i, Lambda_j), the smallest singular value of X -> Lambda_i X - X
/// Lambda_j, for all pairs of blocks. With p the characteristic polynomial of B, and A X - X B = Q,
/// p(A) X = (A - t/2) Q + Q (B - t/2), t = tr B, so that sep >= s_min(p(A)) / (|A - t/2| + |B -
/// t/2|).
class Separations {
 public:
  explicit Separations(const BlockEigenbasis& basis) : basis_(basis) {
    for (int i = 0; i < basis.modes; i += 4) {
      const std::size_t k = at(i);
      const Vec4d a = load(&basis.l00[k]), b = load(&basis.l01[k]), c = load(&basis.l10[k]),
                  d = load(&basis.l11[k]);
      const Vec4d cross = b * b + c * c;
      store(&trace_[k], a + d);
      store(&determinant_[k], a * d - b * c);
      store(&traceless_[k], square_root(0.5 * square(a - d) + cross));
      store(&size2_[k], a * a + d * d + cross);
    }
  }

  /// Of modes i to i + 3 from block j.
  Vec4d of_four(int i, int j) const {
    const std::size_t k = at(i);
    if (j >= basis_.modes) {
      const double x = basis_.rate[at(j - basis_.modes)];
      const Vec4d trace = load(&trace_[k]);
      const Vec4d least = magnitude(x * x - trace * x + load(&determinant_[k])) -
                          64 * kUnit * (x * x + trace * trace + load(&size2_[k]));
      return least / (kSlack * (magnitude(x - 0.5 * trace) + load(&traceless_[k])));
    }
    const Vec4d a = load(&basis_.l00[k]), b = load(&basis_.l01[k]), c = load(&basis_.l10[k]),
                d = load(&basis_.l11[k]);
    const double trace = trace_[at(j)];
    const Vec4d across = load(&trace_[k]) - trace, product = b * c + determinant_[at(j)];
    const Vec4d p00 = a * (a - trace) + product, p11 = d * (d - trace) + product;
    const Vec4d p01 = b * across, p10 = c * across;
    // s_min = |det p| / s_max, s_max at most the sum of all entries, less p's rounding errors.
    const Vec4d sum = magnitude(p00) + magnitude(p01) + magnitude(p10) + magnitude(p11);
    const Vec4d rounding = 64 * kUnit * (load(&size2_[k]) + trace * trace + size2_[at(j)]);
    const Vec4d halves = load(&traceless_[k]) + traceless_[at(j)] + 0.7072 * magnitude(across);
    const Vec4d least = magnitude(p00 * p11 - p01 * p10) - rounding * sum;
    return least / (kSlack * sum * halves);
  }

  double between(int i, int j) const {
    if (i >= basis_.modes && j >= basis_.modes) {
      return std::abs(basis_.rate[at(i - basis_.modes)] - basis_.rate[at(j - basis_.modes)]);
    }
    if (i >= basis_.modes) std::swap(i, j);
    return of_four(i / 4 * 4, j)[i % 4];
  }

  /// Of modes i to i + 3, each from all other blocks; zero if that is not a number.
  Vec4d from_rest(int i) const {
    Vec4d least = Vec4d{} + kInfinity;
    for (int j = 0; j < basis_.blocks(); ++j) {
      Vec4d apart = of_four(i, j);
      apart = apart > 0 ? apart : Vec4d{};
      if (j >= i && j < i + 4 && j < basis_.modes) apart[j - i] = kInfinity;
      least = apart < least ? apart : least;
    }
    return least;
  }

 private:
  const BlockEigenbasis& basis_;
  BlockEigenbasis::Entries trace_, determinant_, traceless_, size2_;
};

/// Of G for one set of blocks (or one block in each lane) and the rest: squared norms of its
/// square, of its rows beside that and of its columns above and below.
template <typename T>
struct SetSquares {
  T inner, right, left;
  T R;  ///< of its rows of R
};

class StewartBound {
 public:
  StewartBound(const SymmetricPencil& pencil, const CoefficientSizes& sizes, double distance,
               const BlockEigenbasis& basis, const TrackedResidual& residual)
      : basis_(basis),
        residual_(residual),
        sizes_(pencil, sizes, distance, basis),
        separations_(basis) {
    sum_squares();
    const BlockSizes<double>& e = sizes_.all;
    R_norm_ = std::sqrt(R_total_) + sizes_.gamma * (square(e.a) + square(e.m));
    G_error_ =
        sizes_.gamma * (2 * e.a * e.b + sizes_.c * square(e.m) + e.a * e.a_rate + e.m * e.m_rate);
    F_norm_ = kSlack * (std::sqrt(G_total_) + G_error_) / (1 - R_norm_);
  }

  double roundoff_bound() const { return G_error_; }
  bool provable() const { return R_norm_ < kNearlyOrthonormal && F_norm_ < kInfinity; }

  /// Radii of the blocks of modes i to i + 3, negative where one cannot be separated.
  Vec4d mode_radii(int i) const {
    const auto two = [&](const Columns& squares) {
      return load(&squares[at(i)]) + load(&squares[at(basis_.modes + i)]);
    };
    return radius<Vec4d>(
        sizes_.of<Vec4d>(i),
        {load(&residual_.diagonal[at(i)]), two(G_rows_), two(G_columns_), two(R_rows_)},
        separations_.from_rest(i));
  }

  /// Grows the group of block i until it can be separated, and writes its radius.
  void prove_group(int i, TrackedEnclosure& enclosure) const;

 private:
  void sum_squares();

  /// Stewart's bound from norms of F, which are those of G and of what the Gram matrix and rounding
  /// errors add; negative if the set cannot be separated.
  template <typename T>
  T radius(const BlockSizes<T>& set, const SetSquares<T>& squares, const T& separated) const {
    const BlockSizes<double>& e = sizes_.all;
    const double gamma = sizes_.gamma, c = sizes_.c;
    const T both = set.a * e.b + set.b * e.a + c * set.m * e.m;
    const T rows = gamma * (both + set.a * e.a_rate + set.m * e.m_rate);
    const T columns = gamma * (both + e.a * set.a_rate + e.m * set.m_rate);
    const T own =
        gamma * (2 * set.a * set.b + c * set.m * set.m + set.a * set.a_rate + set.m * set.m_rate);
    const T R = square_root(squares.R) + gamma * (set.a * e.a + set.m * e.m);
    const T left = kSlack * (square_root(squares.left + squares.inner) + columns) / (1 - R_norm_);
    const T right = kSlack * (square_root(squares.right) + rows + R * F_norm_);
    const T inner = kSlack * (square_root(squares.inner) + own + R * left);
    const T delta = separated - inner - F_norm_, product = right * left;
    const T found = kSlack * (inner + 2 * product / delta);
    const T apart = 4 * product < delta * delta ? found : T{} - 1;
    return delta > 0 ? apart : T{} - 1;
  }

  const BlockEigenbasis& basis_;
  const TrackedResidual& residual_;
  ErrorSizes sizes_;
  Separations separations_;
  using Columns = std::array<double, kMaxWidth + 4>;
  Columns G_rows_, G_columns_, R_rows_;  ///< squared norms
  double G_total_ = 0, R_total_ = 0, G_error_ = 0, R_norm_ = 0, F_norm_ = 0;
};

/// Squared norms of the rows and columns of G (without diagonal blocks), and of the rows of
/// Sigma - N.
void StewartBound::sum_squares() {
  const int columns = basis_.columns(), width = basis_.Z.width;
  for (int j = 0; j < width; j += 4) {
    Vec4d squares{};
    for (int i = 0; i < columns; ++i) squares += square(load(residual_.G.row(i) + j));
    store(&G_columns_[at(j)], squares);
  }
  Vec4d R_total{}, G_total{};
  for (int i = 0; i < columns; ++i) {
    Vec4d G_sum{}, R_sum{};
    for (int j = 0; j < width; j += 4) {
      G_sum += square(load(residual_.G.row(i) + j));
      R_sum += square(load(residual_.R.row(i) + j));
    }
    G_rows_[at(i)] = sum(G_sum);
    R_rows_[at(i)] = sum(R_sum);
    G_total += G_sum;
    R_total += R_sum;
  }
  G_total_ = sum(G_total);
  R_total_ = sum(R_total);
  for (int i = 0; i < basis_.modes; ++i) G_total_ += residual_.diagonal[at(i)];
}

void StewartBound::prove_group(int i, TrackedEnclosure& enclosure) const {
  const int blocks = basis_.blocks();
  const auto inside = [&](int block) { return enclosure.group[at(block)] == i; };
  std::array<int, kMaxWidth> owner{};
  for (int block = 0; block < blocks; ++block) {
    owner[at(basis_.first(block))] = owner[at(basis_.second(block))] = block;
  }
  for (;;) {
    double separated = kInfinity;
    int nearest = -1;
    SetSquares<double> G{0, 0, 0, 0};
    BlockSizes<double> set{0, 0, 0, 0, 0};
    for (int j = 0; j < blocks; ++j) {
      if (!inside(j)) continue;
      if (j < basis_.modes) G.inner += residual_.diagonal[at(j)];
      const auto block = sizes_.of<double>(j);
      set.a += square(block.a);
      set.b += square(block.b);
      set.m += square(block.m);
      set.a_rate += square(block.a_rate);
      set.m_rate += square(block.m_rate);
      for (int k = 0; k < blocks; ++k) {
        if (inside(k)) continue;
        const double apart = std::max(0.0, separations_.between(j, k));
        if (apart < separated || nearest < 0) separated = apart, nearest = k;
      }
    }
    for (int row = 0; row < basis_.columns(); ++row) {
      const bool row_inside = inside(owner[at(row)]);
      if (row_inside) G.R += R_rows_[at(row)];
      for (int column = 0; column < basis_.columns(); ++column) {
        const bool column_inside = inside(owner[at(column)]);
        const double g = square(residual_.G(row, column));
        if (row_inside) (column_inside ? G.inner : G.right) += g;
        if (!row_inside && column_inside) G.left += g;
      }
    }
    for (double* size : {&set.a, &set.b, &set.m, &set.a_rate, &set.m_rate}) {
      *size = std::sqrt(*size);
    }
    const double found = radius(set, G, separated);
    if (found >= 0 || nearest < 0) {
      for (int j = 0; j < blocks; ++j) {
        if (inside(j)) enclosure.radius[at(j)] = found >= 0 ? found : kInfinity;
      }
      return;
    }
    const int absorbed = enclosure.group[at(nearest)];
    for (int j = 0; j < blocks; ++j) {
      if (enclosure.group[at(j)] == absorbed) enclosure.group[at(j)] = i;
    }
  }
}

}  // namespace

void enclose(const SymmetricPencil& pencil, const CoefficientSizes& sizes, double distance,
             const BlockEigenbasis& basis, const TrackedResidual& residual,
             TrackedEnclosure& enclosure) noexcept {
  const int blocks = basis.blocks();
  for (int i = 0; i < blocks; ++i) {
    enclosure.group[at(i)] = i;
    enclosure.radius[at(i)] = kInfinity;
  }
  const StewartBound prover(pencil, sizes, distance, basis, residual);
  enclosure.roundoff_bound = prover.roundoff_bound();
  if (sizes.in_range && prover.provable()) {
    std::array<double, kMaxDof> radii;
    for (int i = 0; i < basis.modes; i += 4) store(&radii[at(i)], prover.mode_radii(i));
    for (int i = 0; i < basis.modes; ++i) {
      if (enclosure.group[at(i)] != i) continue;
      if (radii[at(i)] >= 0) {
        enclosure.radius[at(i)] = radii[at(i)];
      } else {
        prover.prove_group(i, enclosure);
      }
    }
  }
  for (int i = 0; i < blocks; ++i) {
    int members = 0;
    for (int j = 0; j < blocks; ++j) {
      members += enclosure.group[at(j)] == enclosure.group[at(i)] ? 1 : 0;
    }
    enclosure.alone[at(i)] = members == 1;
  }
}

}  // namespace dashpot::analysis
