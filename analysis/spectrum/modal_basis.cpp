#include <dashpot/analysis/spectrum/modal_basis.hpp>

namespace dashpot::analysis {

template <int N>
StateVector<N> coordinates(const ModalBasis<N>& basis, const Square<N>& mass,
                           const Square<N>& damping, const Vector<N>& position,
                           const Vector<N>& velocity) {
  const auto solve = [&](const Vector<N>& q, const Vector<N>& v) -> StateVector<N> {
    const Vector<N> momentum = mass * q;
    const Vector<N> force = damping * q + mass * v;
    const StateVector<N> left = basis.Y.transpose() * momentum;
    const StateVector<N> sum = basis.Y.transpose() * force + basis.Gamma.transpose() * left;
    return basis.weight * sum;
  };
  StateVector<N> xi = solve(position, velocity);

  // One step of iterative refinement takes out what the basis lacks in orthogonality.
  const StateVector<N> xi_rate = basis.Lambda * xi;
  const Vector<N> position_error = position - basis.U * xi;
  const Vector<N> velocity_error = velocity - basis.U * xi_rate;
  xi += solve(position_error, velocity_error);
  return xi;
}

template <int N>
StateVector<N> drive(const ModalBasis<N>& basis, const Vector<N>& f) {
  const StateVector<N> left = basis.Y.transpose() * f;
  return basis.weight * left;
}

template StateVector<kDynamic> coordinates(const ModalBasis<kDynamic>&, const Square<kDynamic>&,
                                           const Square<kDynamic>&, const Vector<kDynamic>&,
                                           const Vector<kDynamic>&);
template StateVector<kDynamic> drive(const ModalBasis<kDynamic>&, const Vector<kDynamic>&);

template StateVector<kMaxDof> coordinates(const ModalBasis<kMaxDof>&, const Square<kMaxDof>&,
                                          const Square<kMaxDof>&, const Vector<kMaxDof>&,
                                          const Vector<kMaxDof>&);
template StateVector<kMaxDof> drive(const ModalBasis<kMaxDof>&, const Vector<kMaxDof>&);

}  // namespace dashpot::analysis
