#include <dashpot/controller/held_damping.hpp>

namespace dashpot::controller {

void TaskDamper::set(const Matrix6& K_C, double ratio) noexcept {
  analysis::DampingTarget target = analysis::DampingTarget::constant(ratio);
  target.soft_frequency = kSoftFrequency;
  hold_.set_target(target);
  if (hold_.set_stiffness(K_C) == analysis::Status::kOk) return;
  // As much as check_gains lets pass. A slow mode more, and a soft one.
  Matrix6 raised = K_C;
  raised.diagonal().array() += 2e-10 * K_C.cwiseAbs().maxCoeff();
  hold_.set_stiffness(raised);
}

void TaskDamper::update(analysis::Square<kMaxJoints>& M,
                        const analysis::TaskJacobian<kMaxJoints>& J) noexcept {
  const double least = 1e-14 * M.trace();
  for (Eigen::Index i = 0; i < M.rows(); ++i) M(i, i) += least;
  hold_.update<kMaxJoints>(M, J, C_C_);
}

}  // namespace dashpot::controller
