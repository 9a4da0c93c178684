#include <dashpot/controller/base/joint_pack.hpp>
#include <dashpot/controller/base/sin_cos.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/kdl_chain.hpp>

#include <Eigen/Geometry>
#include <string>
#include <utility>

namespace dashpot::controller {
namespace {

Eigen::Vector3d to_eigen(const KDL::Vector& v) {
  return {v.x(), v.y(), v.z()};
}

Eigen::Isometry3d to_eigen(const KDL::Frame& frame) {
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) result.linear()(i, j) = frame.M(i, j);
  }
  result.translation() = to_eigen(frame.p);
  return result;
}

/// A rotation whose z axis is `axis`; the identity where that will do.
Eigen::Matrix3d with_z(const Eigen::Vector3d& axis) {
  if (axis == Eigen::Vector3d::UnitZ()) return Eigen::Matrix3d::Identity();
  Eigen::Matrix3d R;
  R.col(0) = axis.unitOrthogonal();
  R.col(1) = axis.cross(R.col(0));
  R.col(2) = axis;
  return R;
}

/// Puts the entries of `values`, by columns, at joint i of the rows.
template <class Rows, class Derived>
void set_joint(Rows& rows, int i, const Eigen::MatrixBase<Derived>& values) {
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    rows[k][static_cast<std::size_t>(i)] = values(at % values.rows(), at / values.rows());
  }
}

template <int G, class Rows>
Lanes3<G> load3(const Rows& rows, std::size_t first = 0) {
  return {JointPack<G>::load(rows[first].data()), JointPack<G>::load(rows[first + 1].data()),
          JointPack<G>::load(rows[first + 2].data())};
}

template <int G, class Rows>
LanesSymmetric<G> load_symmetric(const Rows& rows) {
  return {JointPack<G>::load(rows[0].data()), JointPack<G>::load(rows[1].data()),
          JointPack<G>::load(rows[2].data()), JointPack<G>::load(rows[3].data()),
          JointPack<G>::load(rows[4].data()), JointPack<G>::load(rows[5].data())};
}

template <int N>
JointPack<kGroups<N>> load(const Eigen::Matrix<double, N, 1>& values) {
  JointPack<kGroups<N>> result{};
  __builtin_memcpy(&result, values.data(), N * sizeof(double));
  return result;
}

/// One column for each joint, of x, y, z and an unused entry, turned into rows.
template <int G>
Lanes3<G> to_lanes(const Vec4d (&columns)[4 * G]) {
  Lanes3<G> result;
  for (int g = 0; g < G; ++g) {
    const Vec4d* c = columns + 4 * g;
    const Vec4d xy01 = __builtin_shufflevector(c[0], c[1], 0, 4, 1, 5);
    const Vec4d xy23 = __builtin_shufflevector(c[2], c[3], 0, 4, 1, 5);
    const Vec4d z01 = __builtin_shufflevector(c[0], c[1], 2, 6, 2, 6);
    const Vec4d z23 = __builtin_shufflevector(c[2], c[3], 2, 6, 2, 6);
    result.x.group[g] = __builtin_shufflevector(xy01, xy23, 0, 1, 4, 5);
    result.y.group[g] = __builtin_shufflevector(xy01, xy23, 2, 3, 6, 7);
    result.z.group[g] = __builtin_shufflevector(z01, z23, 0, 1, 4, 5);
  }
  return result;
}

/// R_i for all links: `rotation` is that from link i to link i - 1 at q = 0, by columns, and link i
/// turns by `angle` about its z axis besides. The products along the chain, which have to wait for
/// one another, take a register for each column.
template <int N, class Rows>
Lanes33<kGroups<N>> link_rotations(const Rows& rotation, const JointPack<kGroups<N>>& angle) {
  constexpr int G = kGroups<N>;
  JointPack<G> sine, cosine;
  for (int g = 0; g < G; ++g) sin_cos(angle.group[g], sine.group[g], cosine.group[g]);
  const Lanes3<G> x_0 = load3<G>(rotation, 0), y_0 = load3<G>(rotation, 3);
  const Lanes3<G> x_1 = cosine * x_0 + sine * y_0, y_1 = cosine * y_0 - sine * x_0;
  alignas(32) double turned[6][kLanes<N>];
  const JointPack<G>* entries[] = {&x_1.x, &x_1.y, &x_1.z, &y_1.x, &y_1.y, &y_1.z};
  for (std::size_t k = 0; k < 6; ++k) entries[k]->store(turned[k]);

  Vec4d x_axes[4 * G] = {}, y_axes[4 * G] = {}, z_axes[4 * G] = {};
  Vec4d x{1, 0, 0, 0}, y{0, 1, 0, 0}, z{0, 0, 1, 0};
  for (std::size_t i = 0; i < N; ++i) {
    const Vec4d new_x = x * turned[0][i] + y * turned[1][i] + z * turned[2][i];
    const Vec4d new_y = x * turned[3][i] + y * turned[4][i] + z * turned[5][i];
    z = x * rotation[6][i] + y * rotation[7][i] + z * rotation[8][i];
    x_axes[i] = x = new_x;
    y_axes[i] = y = new_y;
    z_axes[i] = z;
  }
  return {to_lanes<G>(x_axes), to_lanes<G>(y_axes), to_lanes<G>(z_axes)};
}

/// J, and M_ki = J_k . (force, moment)_i for k <= i, mirrored; the wrench is taken at the tip.
template <int N>
void write_J_M(const Lanes3<kGroups<N>>& J_linear, const Lanes3<kGroups<N>>& J_angular,
               const Lanes3<kGroups<N>>& force, const Lanes3<kGroups<N>>& moment,
               Dynamics<N>& result) {
  using L = JointPack<kGroups<N>>;
  const L* J[] = {&J_linear.x, &J_linear.y, &J_linear.z, &J_angular.x, &J_angular.y, &J_angular.z};
  const L* wrench[] = {&force.x, &force.y, &force.z, &moment.x, &moment.y, &moment.z};
  alignas(32) double J_rows[6][kLanes<N>], wrench_rows[6][kLanes<N>];
  for (std::size_t k = 0; k < 6; ++k) {
    J[k]->store(J_rows[k]);
    wrench[k]->store(wrench_rows[k]);
  }
  for (int i = 0; i < N; ++i) {
    for (int k = 0; k < 6; ++k) result.J(k, i) = J_rows[k][i];
    alignas(32) double column[kLanes<N>];
    for (int g = 0; g <= i / 4; ++g) {
      Vec4d entries{};
      for (int k = 0; k < 6; ++k) entries += J[k]->group[g] * wrench_rows[k][i];
      __builtin_memcpy(column + 4 * g, &entries, sizeof(entries));
    }
    for (int k = 0; k <= i; ++k) result.M(k, i) = result.M(i, k) = column[k];
  }
}

template <int N>
void store(const JointPack<kGroups<N>>& source, Eigen::Matrix<double, N, 1>& target) {
  __builtin_memcpy(target.data(), &source, N * sizeof(double));
}

/// v of joint i.
template <int G>
Eigen::Vector3d of_joint(const Lanes3<G>& v, int i) {
  return {v.x.group[i / 4][i % 4], v.y.group[i / 4][i % 4], v.z.group[i / 4][i % 4]};
}

}  // namespace

template <int N>
DynamicsKernel<N>::DynamicsKernel(const RobotModel& model)
    : rotation_{},
      offset_{},
      next_slide_{},
      first_moment_{},
      inertia_{},
      mass_{},
      carried_mass_{},
      revolute_{},
      prismatic_{},
      gravity_(model.gravity()) {
  if (model.dof() != N) {
    throw std::invalid_argument("DynamicsKernel<" + std::to_string(N) + ">: the model has " +
                                std::to_string(model.dof()) + " joints");
  }
  reflected_inertia_ = model.joint_values(&Joint::reflected_inertia);
  const KDL::Chain& chain = kdl_chain(model);

  Eigen::Isometry3d link = Eigen::Isometry3d::Identity();  // KDL's link i - 1 in our link i - 1
  for (int i = 0; i < N; ++i) {
    const auto row = static_cast<std::size_t>(i);
    const KDL::Segment& segment = chain.getSegment(static_cast<unsigned>(i));
    const bool prismatic = segment.getJoint().getType() == KDL::Joint::TransAxis;
    revolute_[row] = prismatic ? 0 : 1;
    prismatic_[row] = prismatic ? 1 : 0;

    Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();  // our link i in KDL's link i - 1
    frame.linear() = with_z(to_eigen(segment.getJoint().JointAxis()));
    frame.translation() = to_eigen(segment.getJoint().JointOrigin());
    const Eigen::Isometry3d to_previous = link * frame;
    set_joint(rotation_, i, to_previous.linear());
    if (i == 0) {
      first_joint_ = to_previous.translation();
      first_slide_ = prismatic_[row] * to_previous.linear().col(2);
    } else {
      set_joint(offset_, i - 1, to_previous.translation());
      set_joint(next_slide_, i - 1, prismatic_[row] * to_previous.linear().col(2));
    }
    link = frame.inverse() * to_eigen(segment.pose(0));

    KDL::RigidBodyInertia body = segment.getInertia();
    mass_[row] = body.getMass();
    const Eigen::Vector3d center = link * to_eigen(body.getCOG());
    set_joint(first_moment_, i, body.getMass() * center);
    const KDL::RotationalInertia about_center = body.RefPoint(body.getCOG()).getRotationalInertia();
    const Eigen::Matrix3d I = link.linear() * Eigen::Map<const Eigen::Matrix3d>(about_center.data) *
                                  link.linear().transpose() +
                              body.getMass() * (center.squaredNorm() * Eigen::Matrix3d::Identity() -
                                                center * center.transpose());
    set_joint(inertia_, i, Vector6{{I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)}});
  }
  const Eigen::Isometry3d tip = link * to_eigen(chain.getSegment(N).pose(0));
  set_joint(offset_, N - 1, tip.translation());
  tool_ = tip.linear();
  double carried = 0;
  for (std::size_t i = N; i-- > 0;) carried_mass_[i] = carried += mass_[i];
}

template <int N>
void DynamicsKernel<N>::evaluate(const Eigen::Matrix<double, N, 1>& q_in,
                                 const Eigen::Matrix<double, N, 1>& qd_in,
                                 Dynamics<N>& result) const noexcept {
  constexpr int G = kGroups<N>;
  using L = JointPack<G>;
  using L3 = Lanes3<G>;
  const L q = load<N>(q_in), qd = load<N>(qd_in);
  const L revolute = L::load(revolute_.data()), prismatic = L::load(prismatic_.data());

  const Lanes33<G> R = link_rotations<N>(rotation_, revolute * q);

  // Positions from the first joint's origin, and the Jacobian at the tip.
  const L3 e = R * (load3<G>(offset_) + of_next(q) * load3<G>(next_slide_));
  const L3 p_next = sum_outward(e);
  const L3 p = of_previous(p_next);
  const Eigen::Vector3d tip = of_joint(p_next, N - 1);
  const L3 to_tip = {all<G>(tip.x()) - p.x, all<G>(tip.y()) - p.y, all<G>(tip.z()) - p.z};
  const L3 J_angular = revolute * R.z;
  const L3 J_linear = cross(J_angular, to_tip) + prismatic * R.z;

  // Outward: velocities and bias accelerations.
  const L3 w = sum_outward(qd * J_angular);
  const L3 swing = cross(w, qd * R.z);
  const L3 wd = sum_outward(revolute * swing);
  const auto acceleration = [&](const L3& r) { return cross(wd, r) + cross(w, cross(w, r)); };
  const L3 e_bias = acceleration(e);
  const L3 a = sum_outward(of_previous(e_bias) + (2 * prismatic) * swing);
  const L3 a_tip = a + e_bias;

  // Inward: forces and moments.
  const L mass = L::load(mass_.data());
  const L3 h_link = R * load3<G>(first_moment_);
  const LanesSymmetric<G> I_link = turned(R, load_symmetric<G>(inertia_));
  const L3 f = sum_inward(acceleration(h_link) + mass * a);
  const L3 n =
      sum_inward(I_link * wd + cross(w, I_link * w) + cross(h_link, a) + cross(e, of_next(f)));
  const L coriolis = dot(J_angular, n) + prismatic * dot(R.z, f);

  // Inward: what each joint carries.
  const L carried = L::load(carried_mass_.data()), beyond = of_next(carried);
  const L3 h = sum_inward(h_link + beyond * e);
  const LanesSymmetric<G> I = sum_inward(I_link + shift_term(of_next(h) + (0.5 * beyond) * e, e));
  const L3 F = cross(J_angular, h) + (prismatic * carried) * R.z;
  const L3 moment = I * J_angular + cross(h, prismatic * R.z) + cross(F, to_tip);
  const L gravity = -(gravity_.x() * F.x + gravity_.y() * F.y + gravity_.z() * F.z);

  write_J_M<N>(J_linear, J_angular, F, moment, result);
  result.M.diagonal() += reflected_inertia_;
  store<N>(coriolis, result.coriolis);
  store<N>(gravity, result.gravity);
  result.Jdot_qd << of_joint(a_tip, N - 1), of_joint(wd, N - 1);
  result.p_BT_B = first_joint_ + q_in[0] * first_slide_ + tip;
  Eigen::Matrix3d R_last;
  R_last << of_joint(R.x, N - 1), of_joint(R.y, N - 1), of_joint(R.z, N - 1);
  result.R_BT.noalias() = R_last * tool_;
}

template class DynamicsKernel<1>;
template class DynamicsKernel<2>;
template class DynamicsKernel<3>;
template class DynamicsKernel<4>;
template class DynamicsKernel<5>;
template class DynamicsKernel<6>;
template class DynamicsKernel<7>;
template class DynamicsKernel<8>;
template class DynamicsKernel<9>;
template class DynamicsKernel<10>;
template class DynamicsKernel<11>;
template class DynamicsKernel<12>;
template class DynamicsKernel<13>;
template class DynamicsKernel<14>;
template class DynamicsKernel<15>;
template class DynamicsKernel<16>;

namespace {

template <int N>
void evaluate_fixed(const RobotModel& model, const JointVector& q, const JointVector& qd,
                    DynamicsResult& result) {
  Dynamics<N> fixed;
  DynamicsKernel<N>(model).evaluate(q, qd, fixed);
  result = {fixed.M,       fixed.coriolis, fixed.gravity, fixed.J,
            fixed.Jdot_qd, fixed.p_BT_B,   fixed.R_BT};
}

}  // namespace

DynamicsResult evaluate(const RobotModel& model, const JointVector& q, const JointVector& qd) {
  const int n = model.dof();
  if (q.size() != n || qd.size() != n) {
    throw std::invalid_argument("evaluate: q and qd need " + std::to_string(n) + " entries each");
  }
  DynamicsResult result;
  [&]<int... I>(std::integer_sequence<int, I...>) {
    (void)((n == I + 1 && (evaluate_fixed<I + 1>(model, q, qd, result), true)) || ...);
  }
  (std::make_integer_sequence<int, kMaxJoints>{});
  return result;
}

}  // namespace dashpot::controller
