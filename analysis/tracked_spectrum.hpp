#pragma once
#include <dashpot/analysis/mode.hpp>
#include <dashpot/analysis/solver_status.hpp>

#include <array>
#include <cstdint>

namespace dashpot::analysis {

/// Eigenvectors of a mode's two eigenvalues. Left eigenvectors are the same where coefficients are
/// symmetric.
struct TrackedShapes {
  /// u in joint coordinates, n each, u^H M u = 1, largest entry real and positive. At critical
  /// damping both are the only eigenvector. Zero if the eigenvalue is exactly zero: it belongs to
  /// an elastic coordinate that no motion changes.
  std::array<ComplexVector<kMaxDof>, 2> u;
  /// u' (2 lambda M + C) u (no conjugation), 1/s: the scale of left eigenvectors;
  /// zero at critical damping, and where coefficients are not symmetric
  std::array<Complex, 2> slope{};
};

struct TrackedSpectrum {
  /// kUncertified: some error_bound is infinite. With kOk too, the bounds of a mode's frequency and
  /// ratio are infinite if an eigenvalue may be zero.
  Status status = Status::kNotConverged;
  SpectrumOrigin origin = SpectrumOrigin::kDirect;
  int mode_count = 0;
  /// Index i denotes the same physical mode in successive updates while `epoch` is unchanged.
  /// `epoch` increases when modes can no longer be matched: their number changed, or the stiffness
  /// switched between factored and unfactored form. After a jump or a failure each mode gets the
  /// index of the earlier mode that it resembles most.
  std::uint64_t epoch = 0;
  std::array<ModeNumbers, kMaxDof> modes{};
  /// Indices of the modes by falling sqrt|l1 l2|, which is the natural frequency of a mode that has
  /// one.
  std::array<int, kMaxDof> order{};
  /// Eigenvectors of mode i, if TrackerOptions::shapes is set.
  std::array<TrackedShapes, kMaxDof> shapes;
  int zero_mode_count = 0;
  std::array<double, kMaxDof> zero_mode_rates{};  ///< eigenvalues of their velocities, 1/s

  /// Returns a positive number that mode `index` keeps for as long as it can be matched. No other
  /// mode gets this number meanwhile. After 2^26 epochs numbers repeat.
  std::int32_t label(int index) const noexcept {
    return static_cast<std::int32_t>((epoch - 1) % (1u << 26)) * kMaxDof + index + 1;
  }
};

}  // namespace dashpot::analysis
