#pragma once
#include <dashpot/analysis/spectrum/spectrum_result.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

#include <cstdint>

namespace dashpot::analysis {

/// Keeps what stays with a mode along a path: its index, and whether it was soft.
struct ModeLabels {
  /// Grows when modes cannot be matched to earlier ones, and indices are new.
  std::uint64_t epoch = 0;
  std::array<bool, kMaxDof> soft{};  ///< of each index

  /// Gives the modes of `basis` the indices of the modes of `before` that they resemble, or, if
  /// there are none or another number of them, new ones. Returns the index that each mode gets.
  std::array<int, kMaxDof> match(const System<kMaxDof>& system, bool symmetric, bool any_before,
                                 const BlockEigenbasis& before, BlockEigenbasis& basis) noexcept;
};

/// Makes the columns of `basis` span the planes of the modes of `spectrum`. Such a basis serves
/// only for matching later modes, not as a start for Newton's method.
void set_planes(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                BlockEigenbasis& basis) noexcept;

}  // namespace dashpot::analysis
