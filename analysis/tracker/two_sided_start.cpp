#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/tracker/two_sided_basis.hpp>

#include <limits>

namespace dashpot::analysis {
namespace {

using Columns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxWidth, kMaxWidth>;
using Coefficients = Eigen::Map<const Eigen::MatrixXd>;

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

/// Column k of the spectrum's basis as a state, in column j.
void set_state(const SymmetricPencil& pencil, const ModalBasis<kMaxDof>& from, int k, int j,
               BlockEigenbasis& basis) {
  const int n = pencil.joints, p = pencil.rank;
  const Vector<kMaxDof> v = from.U.lazyProduct(from.Lambda.col(k));
  const Vector<kMaxDof> position =
      pencil.factored ? Vector<kMaxDof>(Coefficients(pencil.W, p, n).lazyProduct(from.U.col(k)))
                      : Vector<kMaxDof>(from.U.col(k));
  for (int row = 0; row < p; ++row) basis.Z(row, j) = position[row];
  for (int row = 0; row < n; ++row) basis.Z(p + row, j) = v[row];
}

void set_block(const SymmetricPencil& pencil, const ModalBasis<kMaxDof>& from, int k, int l, int i,
               BlockEigenbasis& basis) {
  set_state(pencil, from, k, basis.first(i), basis);
  set_state(pencil, from, l, basis.second(i), basis);
  basis.l00[at(i)] = from.Lambda(k, k);
  basis.l01[at(i)] = from.Lambda(k, l);
  basis.l10[at(i)] = from.Lambda(l, k);
  basis.l11[at(i)] = from.Lambda(l, l);
}

/// Y = Sigma (S Z)^-1; false if that is not finite.
bool set_left(const SymmetricPencil& pencil, BlockEigenbasis& basis) {
  const int n = pencil.joints, p = pencil.rank, states = pencil.states();
  Columns SZ(states, states), inverse = Columns::Identity(states, states);
  for (int j = 0; j < states; ++j) {
    for (int row = 0; row < p; ++row) SZ(row, j) = basis.Z(row, j);
    for (int row = 0; row < n; ++row) {
      double sum = 0;
      for (int k = 0; k < n; ++k) sum += pencil.M[row + k * n] * basis.Z(p + k, j);
      SZ(p + row, j) = -sum;
    }
  }
  solve_in_place(SZ, inverse, std::numeric_limits<double>::min());
  if (!is_finite(inverse)) return false;
  for (int i = 0; i < states; ++i) {
    for (int j = 0; j < states; ++j) {
      basis.Y(i, j) = i < basis.modes ? inverse(i, j) : -inverse(i, j);
    }
  }
  return true;
}

}  // namespace

bool start_two_sided(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                     BlockEigenbasis& basis) noexcept {
  const int n = pencil.joints, p = pencil.rank, vibrations = spectrum.modes.size();
  VelocityChoice choice;
  if (!choose(spectrum, choice)) return false;
  if (vibrations + choice.velocities != n || (pencil.factored && vibrations != p)) return false;
  basis = BlockEigenbasis{};
  basis.two_sided = true;
  basis.modes = p;
  basis.zeros = n - p;
  basis.still = p - vibrations;
  basis.Z.width = basis.Y.width = packed_width(basis.modes, basis.zeros);
  for (int i = 0; i < vibrations; ++i) {
    const auto [k, l] = spectrum.modes[i].columns;
    set_block(pencil, spectrum.basis, k, l, i, basis);
  }
  for (int k = 0; k < basis.still; ++k) {
    set_block(pencil, spectrum.basis, choice.still_position[at(k)], choice.still_velocity[at(k)],
              vibrations + k, basis);
  }
  for (int k = 0; k < basis.zeros; ++k) {
    const int column = 2 * p + k;
    set_state(pencil, spectrum.basis, choice.still_velocity[at(k)], column, basis);
    double squares = 0;
    for (int row = 0; row < basis.columns(); ++row) {
      squares += basis.Z(row, column) * basis.Z(row, column);
    }
    for (int row = 0; row < basis.columns(); ++row) basis.Z(row, column) /= std::sqrt(squares);
  }
  balance(pencil, true, basis);
  return set_left(pencil, basis);
}

}  // namespace dashpot::analysis
