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

/// The elastic coordinate that moves most beside the first `modes` modes, of unit length; false if
/// none does.
bool add_elastic_coordinate(const SymmetricPencil& pencil, int modes, BlockEigenbasis& basis) {
  Column best;
  double largest = 0;
  for (int k = 0; k < pencil.rank; ++k) {
    Column x = Column::Unit(pencil.states(), k);
    for (int i = 0; i < modes; ++i) {
      const Plane plane = plane_of(pencil, basis, i);
      x -= products(pencil, plane.first, x).indefinite() * plane.first;
      x += products(pencil, plane.second, x).indefinite() * plane.second;
    }
    const double size = products(pencil, x, x).indefinite();
    if (size > largest) largest = size, best = x;
  }
  if (!(largest > kNeutral)) return false;
  set_column(basis.first(modes), best / std::sqrt(largest), basis);
  return true;
}

/// A basis of one side, in the order of the modes. Elastic coordinates that no mode moves any more
/// become modes again, of frequency zero, each with the velocity of a zero mode.
bool start_one_sided(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                     BlockEigenbasis& basis) {
  const int p = pencil.rank, vibrations = spectrum.modes.size();
  VelocityChoice choice;
  if (!choose(spectrum, choice) || vibrations + choice.velocities != pencil.joints) return false;
  if (vibrations > p || (!pencil.factored && vibrations != p)) return false;
  resize(pencil, basis);
  for (int i = 0; i < vibrations; ++i) {
    const auto [k, l] = spectrum.modes[i].columns;
    Plane plane;
    if (!make_plane(pencil, column(pencil, spectrum.basis, k), column(pencil, spectrum.basis, l),
                    plane)) {
      return false;
    }
    set_column(basis.first(i), plane.first, basis);
    set_column(basis.second(i), plane.second, basis);
  }
  for (int k = 0; k < choice.velocities; ++k) {
    const Column x = column(pencil, spectrum.basis, choice.still_velocity[at(k)]);
    const double size = -products(pencil, x, x).indefinite();
    if (!(size > 0)) return false;
    const int mode = pencil.joints - 1 - k;  // the last velocities go to modes
    set_column(k < basis.zeros ? 2 * p + k : basis.second(mode), x / std::sqrt(size), basis);
  }
  for (int i = vibrations; i < p; ++i) {
    if (!add_elastic_coordinate(pencil, i, basis)) return false;
  }
  return true;
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
  // Products are exact; errors of sums are 3 u^2 of partial sums, at most of the absolute values.
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
  const auto start = symmetric && definite ? start_one_sided : start_two_sided;
  if (!start(pencil, spectrum, basis)) return false;
  evaluate(pencil, basis, residual);
  if (!basis.two_sided) rotate_hyperbolically(residual, 0, basis);
  return true;
}

}  // namespace dashpot::analysis
