#pragma once
#include <dashpot/analysis/mode.hpp>
#include <dashpot/analysis/spectrum/refinement.hpp>

namespace dashpot::analysis {

/// Eigenvectors in joint coordinates, read from a basis.
template <int N>
class ModeShapes {
 public:
  /// Keeps references to its arguments. `residual` belongs to the basis.
  ModeShapes(const System<N>& system, const BasisResidual<N>& residual, const ModalBasis<N>& basis,
             bool symmetric) noexcept
      : system_(system),
        residual_(residual),
        basis_(basis),
        symmetric_(symmetric),
        M_norm_(system.mass.norm()),
        C_norm_(system.damping.norm()),
        K_norm_(system.stiffness.norm()) {}

  /// Writes shapes[which] and left_shapes[which] of a mode: the eigenvectors to the eigenvalue mu
  /// (1/s) of a block of the basis. Its backward error and condition number become those of this
  /// pair, if they are larger.
  void write(const Block& block, const Complex& mu, std::size_t which,
             Mode<N>& mode) const noexcept;

 private:
  ComplexVector<N> left_shape(const Block& block, const Complex& mu) const noexcept;

  const System<N>& system_;
  const BasisResidual<N>& residual_;
  const ModalBasis<N>& basis_;
  bool symmetric_;
  double M_norm_, C_norm_, K_norm_;  ///< Frobenius norms of the coefficients
};

}  // namespace dashpot::analysis
