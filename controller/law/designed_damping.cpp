#include <dashpot/controller/law/designed_damping.hpp>

namespace dashpot::controller {

namespace {

analysis::DampingTarget target_of(double ratio) noexcept {
  analysis::DampingTarget target = analysis::DampingTarget::constant(ratio);
  target.soft_frequency = TaskDamper::kSoftFrequency;
  return target;
}

void make_definite(analysis::Square<kMaxJoints>& M) noexcept {
  const double least = 1e-14 * M.trace();
  for (Eigen::Index i = 0; i < M.rows(); ++i) M(i, i) += least;
}

}  // namespace

void TaskDamper::set(const Matrix6& K_C, double ratio, const JointVector& friction) noexcept {
  hold_.set_target(target_of(ratio));
  hold_.set_friction(friction);
  if (hold_.set_stiffness(K_C) == analysis::Status::kOk) return;
  // As much as check_gains lets pass. A slow mode more, and a soft one.
  Matrix6 raised = K_C;
  raised.diagonal().array() += 2e-10 * K_C.cwiseAbs().maxCoeff();
  hold_.set_stiffness(raised);
}

void TaskDamper::update(analysis::Square<kMaxJoints>& M,
                        const analysis::TaskJacobian<kMaxJoints>& J) noexcept {
  make_definite(M);
  hold_.update<kMaxJoints>(M, J, C_C_);
}

void JointDamper::set(const JointMatrix& K_q, double ratio, const JointVector& friction) noexcept {
  hold_.set_target(target_of(ratio));
  hold_.set_friction(friction);
  if (hold_.set_stiffness(K_q) == analysis::Status::kOk) return;
  JointMatrix raised = K_q;
  raised.diagonal().array() += 2e-10 * K_q.cwiseAbs().maxCoeff();
  hold_.set_stiffness(raised);
}

void JointDamper::update(JointMatrix& M) noexcept {
  make_definite(M);
  hold_.update(M, C_q_);
}

}  // namespace dashpot::controller
