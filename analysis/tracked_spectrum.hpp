#pragma once
#include <dashpot/analysis/mode.hpp>
#include <dashpot/analysis/status.hpp>

#include <array>
#include <cstdint>

namespace dashpot::analysis {

/// Eigenvectors of a mode's two eigenvalues. Left ones are the same where coefficients are
/// symmetric.
struct TrackedShapes {
  /// u in joint coordinates, n each, u^H M u = 1, largest entry real and positive. At critical
  /// damping both are the one eigenvector there is. Zero where an eigenvalue is exactly zero: that
  /// of a strain which no motion changes.
  std::array<ComplexVector<kMaxDof>, 2> u;
  /// u' (2 lambda M + C) u (no conjugation), 1/s: the scale of dual vectors and of sensitivities;
  /// zero at critical damping, and where coefficients are not symmetric
  std::array<Complex, 2> slope{};
};

struct TrackedSpectrum {
  Status status = Status::kNotConverged;  ///< kUncertified: some bound is infinite
  SpectrumOrigin origin = SpectrumOrigin::kDirect;
  int mode_count = 0;
  /// A mode keeps its place here along a path, as long as `lineage` stays the same: it grows when
  /// modes cannot be recognised, because there are more or fewer of them, or the stiffness comes
  /// with a factor where it came without one. After a jump or a failure modes take the places of
  /// those that they resemble most.
  std::uint64_t lineage = 0;
  std::array<ModeNumbers, kMaxDof> modes{};
  /// Places of the modes by falling sqrt|l1 l2|: the natural frequency where there is one.
  std::array<int, kMaxDof> by_frequency{};
  /// Where asked for: of the modes, in the same places.
  std::array<TrackedShapes, kMaxDof> shapes;
  int zero_mode_count = 0;
  std::array<double, kMaxDof> zero_mode_rates{};  ///< eigenvalues of their velocities, 1/s
};

}  // namespace dashpot::analysis
