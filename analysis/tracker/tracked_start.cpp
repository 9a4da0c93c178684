#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/double_double.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/tracker/state_column.hpp>
#include <dashpot/analysis/tracker/tracked_start.hpp>

#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

/// Squared lengths in the metric below this, relative to those in the energy metric, belong to
/// vectors of no sign type: a pair at critical damping that is not in one block.
constexpr double kNeutral = 1e-6;

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

/// Column j of the spectrum's basis as a state.
Column column(const SymmetricPencil& pencil, const ModalBasis<kMaxDof>& basis, int j) {
  const Vector<kMaxDof> v = basis.U.lazyProduct(basis.Lambda.col(j));
  return state(pencil, basis.U.col(j), v);
}

void resize(const SymmetricPencil& pencil, BlockEigenbasis& basis) {
  basis = BlockEigenbasis{};
  basis.modes = pencil.rank;
  basis.zeros = pencil.zeros();
  basis.Z.width = basis.Y.width = packed_width(basis.modes, basis.zeros);
}

/// Columns of a spectrum's basis by what they are.
struct VelocityChoice {
  std::array<int, kMaxDof> still_position{}, still_velocity{};
  int positions = 0, velocities = 0;
};

/// Zero modes: positions, and what the modes left over. False if a block has several modes.
bool choose(const Spectrum<kMaxDof>& spectrum, VelocityChoice& choice) {
  std::array<bool, kMaxWidth> taken{};
  for (const Mode<kMaxDof>& mode : spectrum.modes) {
    for (const int column : mode.columns) taken[at(column)] = true;
  }
  for (const Block& block : spectrum.basis.blocks) {
    if (block.size > 2) return false;
    if (taken[at(block.first)]) continue;
    if (block.zero_mode) {
      if (choice.positions == kMaxDof) return false;
      choice.still_position[at(choice.positions++)] = block.first;
      if (block.size == 1) continue;
    } else if (block.size != 1) {
      return false;
    }
    if (choice.velocities == kMaxDof) return false;
    choice.still_velocity[at(choice.velocities++)] = block.first + block.size - 1;
  }
  return choice.positions == choice.velocities;
}

/// Collects the columns of a basis of one side by what they are.
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
  Column column(int j) const { return analysis::column(pencil_, spectrum_.basis, j); }
  bool take_modes();
  bool take_zero_modes();
  bool add_elastic_coordinates();
  void write(BlockEigenbasis& basis) const;

  const SymmetricPencil& pencil_;
  const Spectrum<kMaxDof>& spectrum_;
  std::array<Plane, kMaxDof> planes_;
  std::array<Column, kMaxDof> zeros_;  ///< of unit length
  int plane_count_ = 0, zero_count_ = 0;
};

bool BasisFromSpectrum::take_modes() {
  for (const Mode<kMaxDof>& mode : spectrum_.modes) {
    const auto [i, j] = mode.columns;
    if (!make_plane(pencil_, column(i), column(j), planes_[at(plane_count_++)])) return false;
  }
  return true;
}

bool BasisFromSpectrum::take_zero_modes() {
  VelocityChoice choice;
  if (!choose(spectrum_, choice)) return false;
  for (int k = 0; k < choice.velocities; ++k) {
    const Column x = column(choice.still_velocity[at(k)]);
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

void BasisFromSpectrum::write(BlockEigenbasis& basis) const {
  resize(pencil_, basis);
  for (int i = 0; i < basis.modes; ++i) {
    set_column(basis.first(i), planes_[at(i)].first, basis);
    set_column(basis.second(i), planes_[at(i)].second, basis);
  }
  for (int k = 0; k < basis.zeros; ++k) set_column(2 * basis.modes + k, zeros_[at(k)], basis);
}

/// Columns k and l of the spectrum's basis, in block i.
void set_block(const SymmetricPencil& pencil, const ModalBasis<kMaxDof>& from, int k, int l, int i,
               BlockEigenbasis& basis) {
  set_column(basis.first(i), column(pencil, from, k), basis);
  set_column(basis.second(i), column(pencil, from, l), basis);
  basis.l00[at(i)] = from.Lambda(k, k);
  basis.l01[at(i)] = from.Lambda(k, l);
  basis.l10[at(i)] = from.Lambda(l, k);
  basis.l11[at(i)] = from.Lambda(l, l);
}

using Columns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxWidth, kMaxWidth>;

/// Y = Sigma (S Z)^-1; false if that is not finite.
bool set_left(const SymmetricPencil& pencil, BlockEigenbasis& basis) {
  const int n = pencil.joints, states = pencil.states();
  Columns SZ(states, states), inverse = Columns::Identity(states, states);
  for (int row = 0; row < states; ++row) {
    for (int j = 0; j < states; ++j) SZ(row, j) = basis.Z(row, j);
  }
  const Square<kMaxDof> M = Coefficients(pencil.M, n, n);
  SZ.bottomRows(n) = (-M.lazyProduct(SZ.bottomRows(n))).eval();
  solve_in_place(SZ, inverse, std::numeric_limits<double>::min());
  if (!is_finite(inverse)) return false;
  for (int i = 0; i < states; ++i) {
    for (int j = 0; j < states; ++j) {
      basis.Y(i, j) = i < basis.modes ? inverse(i, j) : -inverse(i, j);
    }
  }
  return true;
}

/// A basis of two sides, in the order of the modes.
bool start_two_sided(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                     BlockEigenbasis& basis) {
  const int n = pencil.joints, p = pencil.rank, vibrations = spectrum.modes.size();
  VelocityChoice choice;
  if (!choose(spectrum, choice)) return false;
  if (vibrations + choice.velocities != n || (pencil.factored && vibrations != p)) return false;
  resize(pencil, basis);
  basis.two_sided = true;
  basis.still = p - vibrations;
  basis.still_floor = spectrum.zero_modes.floor;
  for (int i = 0; i < vibrations; ++i) {
    const auto [k, l] = spectrum.modes[i].columns;
    set_block(pencil, spectrum.basis, k, l, i, basis);
  }
  for (int k = 0; k < basis.still; ++k) {
    set_block(pencil, spectrum.basis, choice.still_position[at(k)], choice.still_velocity[at(k)],
              vibrations + k, basis);
  }
  for (int k = 0; k < basis.zeros; ++k) {
    const Column x = column(pencil, spectrum.basis, choice.still_velocity[at(k)]);
    set_column(2 * p + k, x / x.norm(), basis);
  }
  balance(pencil, true, basis);
  return set_left(pencil, basis);
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

bool start_basis(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum, bool symmetric,
                 TrackedResidual& residual, BlockEigenbasis& basis) noexcept {
  // A symmetric K without a factor is the metric of a basis of one side, if it is definite.
  const bool definite = pencil.factored || (spectrum.zero_modes.stiffness_values.array() > 0).all();
  if (symmetric && definite ? !BasisFromSpectrum(pencil, spectrum).run(basis)
                            : !start_two_sided(pencil, spectrum, basis)) {
    return false;
  }
  evaluate(pencil, basis, residual);
  if (!basis.two_sided) rotate_hyperbolically(residual, 0, basis);
  return true;
}

}  // namespace dashpot::analysis
