#include <dashpot/controller/base/joint_pack.hpp>
#include <dashpot/controller/base/sin_cos.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/controller/model/robot_model_data.hpp>

#include <Eigen/Geometry>
#include <string>

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

/// A rotation whose z axis is `axis`, the identity if possible.
Eigen::Matrix3d with_z(const Eigen::Vector3d& axis) {
  if (axis == Eigen::Vector3d::UnitZ()) return Eigen::Matrix3d::Identity();
  Eigen::Matrix3d R;
  R.col(0) = axis.unitOrthogonal();
  R.col(1) = axis.cross(R.col(0));
  R.col(2) = axis;
  return R;
}

/// Puts the entries of `values`, by columns, at the place of joint i in the rows of its four.
template <class Rows, class Derived>
void set_joint(Rows& rows, int i, const Eigen::MatrixBase<Derived>& values) {
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    rows[k][static_cast<std::size_t>(i % 4)] = values(at % values.rows(), at / values.rows());
  }
}

/// xx yy zz xy xz yz
Vector6 six(const Eigen::Matrix3d& I) {
  return Vector6{{I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)}};
}

using Four = std::array<double, 4>;

Lanes3 load3(const Four* rows) {
  return {load(rows[0].data()), load(rows[1].data()), load(rows[2].data())};
}

/// Rotations R of four links, by columns: `rotation` leads from link i to link i - 1 at q = 0, and
/// link i also turns by `angle` about its z axis. `last` are the columns of the link before the
/// four, and then of the fourth. The products along the chain, which have to wait for one another,
/// take a register for each column.
Lanes33 link_rotations(const std::array<Four, 9>& rotation, const Vec4d& angle, Vec4d (&last)[3]) {
  Vec4d sine, cosine;
  sin_cos(angle, sine, cosine);
  const Lanes3 x_0 = load3(&rotation[0]), y_0 = load3(&rotation[3]);
  const Lanes3 x_1 = cosine * x_0 + sine * y_0, y_1 = cosine * y_0 - sine * x_0;
  Vec4d columns[3][4];  // of each link
  for (std::size_t i = 0; i < 4; ++i) {
    const Vec4d x = last[0] * x_1.x[i] + last[1] * x_1.y[i] + last[2] * x_1.z[i];
    const Vec4d y = last[0] * y_1.x[i] + last[1] * y_1.y[i] + last[2] * y_1.z[i];
    last[2] = last[0] * rotation[6][i] + last[1] * rotation[7][i] + last[2] * rotation[8][i];
    last[0] = x;
    last[1] = y;
    for (std::size_t k = 0; k < 3; ++k) columns[k][i] = last[k];
  }
  Lanes33 R;
  Lanes3* const axes[] = {&R.x, &R.y, &R.z};
  for (std::size_t k = 0; k < 3; ++k) {  // x, y, z and an unused entry of four links become rows
    const Vec4d* c = columns[k];
    const Vec4d xy01 = __builtin_shufflevector(c[0], c[1], 0, 4, 1, 5);
    const Vec4d xy23 = __builtin_shufflevector(c[2], c[3], 0, 4, 1, 5);
    const Vec4d z01 = __builtin_shufflevector(c[0], c[1], 2, 6, 2, 6);
    const Vec4d z23 = __builtin_shufflevector(c[2], c[3], 2, 6, 2, 6);
    axes[k]->x = __builtin_shufflevector(xy01, xy23, 0, 1, 4, 5);
    axes[k]->y = __builtin_shufflevector(xy01, xy23, 2, 3, 6, 7);
    axes[k]->z = __builtin_shufflevector(z01, z23, 0, 1, 4, 5);
  }
  return R;
}

/// Results of the pass outward for four links.
struct MovingLinks {
  Lanes33 R;
  Lanes3 e, p, w, wd, a;

  /// Returns the bias acceleration of points at r from the links' origins.
  Lanes3 acceleration(const Lanes3& r) const { return cross(wd, r) + cross(w, cross(w, r)); }
};

/// One number for each of all joints, and zeros beyond.
using Row = std::array<double, kMaxJoints + 4>;
/// J, or the wrenches at the tip of unit accelerations: linear x, y, z, angular x, y, z.
using Rows6 = std::array<Row, 6>;

void store6(const Lanes3& linear, const Lanes3& angular, std::size_t group, Rows6& rows) {
  const Vec4d* const from[] = {&linear.x, &linear.y, &linear.z, &angular.x, &angular.y, &angular.z};
  for (std::size_t k = 0; k < 6; ++k) store(*from[k], &rows[k][group]);
}

/// J, and M_ki = J_k . wrench_i for k <= i, mirrored.
void write_J_M(const Rows6& J, const Rows6& wrench, int n, DynamicsResult& result) {
  result.J.resize(6, n);
  result.M.resize(n, n);
  double* const M = result.M.data();
  for (int i = 0; i < n; ++i) {
    const auto at = static_cast<std::size_t>(i);
    for (std::size_t k = 0; k < 6; ++k) result.J.data()[6 * at + k] = J[k][at];
    Row column;
    for (std::size_t g = 0; g <= at; g += 4) {
      Vec4d entries{};
      for (std::size_t k = 0; k < 6; ++k) entries += load(&J[k][g]) * wrench[k][at];
      store(entries, &column[g]);
    }
    for (int k = 0; k <= i; ++k) M[k + n * i] = M[i + n * k] = column[static_cast<std::size_t>(k)];
  }
}

/// v of joint i of four.
Eigen::Vector3d of_joint(const Lanes3& v, int i) {
  return {v.x[i], v.y[i], v.z[i]};
}

}  // namespace

DynamicsKernel::DynamicsKernel(const RobotModel& model)
    : n_(model.dof()),
      reflected_inertia_(model.joint_values(&Joint::reflected_inertia)),
      gravity_(model.gravity()) {
  const KDL::Chain& chain = kdl_chain(model);

  Eigen::Isometry3d link = Eigen::Isometry3d::Identity();  // KDL's link i - 1 in our link i - 1
  for (int i = 0; i < n_; ++i) {
    Links& links = links_[static_cast<std::size_t>(i) / 4];
    const auto lane = static_cast<std::size_t>(i) % 4;
    const KDL::Segment& segment = chain.getSegment(static_cast<unsigned>(i));
    const bool prismatic = segment.getJoint().getType() == KDL::Joint::TransAxis;
    links.revolute[lane] = prismatic ? 0 : 1;
    links.prismatic[lane] = prismatic ? 1 : 0;

    Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();  // our link i in KDL's link i - 1
    frame.linear() = with_z(to_eigen(segment.getJoint().JointAxis()));
    frame.translation() = to_eigen(segment.getJoint().JointOrigin());
    const Eigen::Isometry3d to_previous = link * frame;
    set_joint(links.rotation, i, to_previous.linear());
    if (i == 0) {
      first_joint_ = to_previous.translation();
      first_slide_ = links.prismatic[lane] * to_previous.linear().col(2);
    } else {
      Links& before = links_[static_cast<std::size_t>(i - 1) / 4];
      set_joint(before.offset, i - 1, to_previous.translation());
      set_joint(before.next_slide, i - 1, links.prismatic[lane] * to_previous.linear().col(2));
    }
    link = frame.inverse() * to_eigen(segment.pose(0));

    const bool end = i == n_ - 1;  // the end comes with what is attached to it
    KDL::RigidBodyInertia body = end ? model.data().last_body : segment.getInertia();
    links.mass[lane] = body.getMass();
    const Eigen::Vector3d center = link * to_eigen(body.getCOG());
    set_joint(links.first_moment, i, body.getMass() * center);
    const KDL::RotationalInertia about_center = body.RefPoint(body.getCOG()).getRotationalInertia();
    const Eigen::Matrix3d I = link.linear() * Eigen::Map<const Eigen::Matrix3d>(about_center.data) *
                                  link.linear().transpose() +
                              body.getMass() * (center.squaredNorm() * Eigen::Matrix3d::Identity() -
                                                center * center.transpose());
    set_joint(links.inertia, i, six(I));
    if (!end) continue;
    bare_mass_ = body.getMass();
    bare_first_moment_ = body.getMass() * center;
    bare_inertia_ = I;
  }
  const Eigen::Isometry3d tip = link * to_eigen(model.data().tip_link);
  tip_link_ = {tip.translation(), tip.linear()};
  attach(model.attachment());
}

void DynamicsKernel::attach(const Attachment& given) noexcept {
  const Eigen::Matrix3d& R = tip_link_.rotation;
  const Eigen::Vector3d& p = tip_link_.position;
  // About p_n: I_body + m (|p|^2 1 - p p') + 2 h.p 1 - h p' - p h'
  const Eigen::Vector3d h = R * given.first_moment;
  const Eigen::Matrix3d about_origin =
      R * given.inertia * R.transpose() +
      (given.mass * p.squaredNorm() + 2 * h.dot(p)) * Eigen::Matrix3d::Identity() -
      given.mass * p * p.transpose() - h * p.transpose() - p * h.transpose();
  Links& links = links_[static_cast<std::size_t>(n_ - 1) / 4];
  const auto lane = static_cast<std::size_t>(n_ - 1) % 4;
  links.mass[lane] = bare_mass_ + given.mass;
  set_joint(links.first_moment, n_ - 1, Eigen::Vector3d(bare_first_moment_ + h + given.mass * p));
  set_joint(links.inertia, n_ - 1, six(bare_inertia_ + about_origin));
  set_joint(links.offset, n_ - 1, Eigen::Vector3d(p + R * given.tool.position));
  tool_ = R * given.tool.rotation;
  double carried = 0;
  for (auto i = static_cast<std::size_t>(n_); i-- > 0;) {
    links_[i / 4].carried_mass[i % 4] = carried += links_[i / 4].mass[i % 4];
  }
}

void DynamicsKernel::evaluate(const JointVector& q_in, const JointVector& qd_in,
                              DynamicsResult& result) const noexcept {
  const auto last = static_cast<std::size_t>(n_ - 1) / 4 * 4;  // the last four
  const int end = (n_ - 1) % 4;                                // the last joint of them
  Row q{}, qd{};
  for (int i = 0; i < n_; ++i) {
    q[static_cast<std::size_t>(i)] = q_in[i];
    qd[static_cast<std::size_t>(i)] = qd_in[i];
  }

  // Outward: rotations, positions from the first joint's origin, velocities, bias accelerations.
  MovingLinks moving[kMaxJoints / 4];
  Vec4d axes[3] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
  Lanes3 p_next{}, w{}, wd{}, a{}, e_bias{};  // of the four joints before
  for (std::size_t g = 0; g <= last; g += 4) {
    const Links& links = links_[g / 4];
    MovingLinks& m = moving[g / 4];
    const Vec4d revolute = load(links.revolute.data()), prismatic = load(links.prismatic.data());
    m.R = link_rotations(links.rotation, revolute * load(&q[g]), axes);
    m.e = m.R * (load3(&links.offset[0]) + load(&q[g + 1]) * load3(&links.next_slide[0]));
    const Lanes3 p_before = p_next, bias_before = e_bias, slope = load(&qd[g]) * m.R.z;
    p_next = sum_outward(m.e, p_before);
    m.p = of_previous(p_next, p_before);
    m.w = w = sum_outward(revolute * slope, w);
    const Lanes3 swing = cross(w, slope);
    m.wd = wd = sum_outward(revolute * swing, wd);
    e_bias = m.acceleration(m.e);
    m.a = a = sum_outward(of_previous(e_bias, bias_before) + (2 * prismatic) * swing, a);
  }
  const Eigen::Vector3d tip = of_joint(p_next, end);
  result.Jdot_qd << of_joint(a, end) + of_joint(e_bias, end), of_joint(wd, end);
  result.p_BT_B = first_joint_ + q_in[0] * first_slide_ + tip;
  const Lanes33& R_end = moving[last / 4].R;
  Eigen::Matrix3d R_last;
  R_last << of_joint(R_end.x, end), of_joint(R_end.y, end), of_joint(R_end.z, end);
  result.R_BT.noalias() = R_last * tool_;

  // Inward: forces and moments, what each joint carries, and the Jacobian at the tip.
  Rows6 J, wrench;
  Row coriolis, gravity;
  Lanes3 f{}, n{}, h{};  // of the four joints beyond
  LanesSymmetric I{};
  Vec4d carried{};
  for (std::size_t g = last + 4; g > 0;) {
    g -= 4;
    const Links& links = links_[g / 4];
    const MovingLinks& m = moving[g / 4];
    const Lanes3 f_beyond = f, h_beyond = h;
    const Vec4d beyond = of_next(load(links.carried_mass.data()), carried);
    carried = load(links.carried_mass.data());
    const Lanes3 J_angular = load(links.revolute.data()) * m.R.z;
    const Lanes3 slide = load(links.prismatic.data()) * m.R.z;
    const Lanes3 h_link = m.R * load3(&links.first_moment[0]);
    const Lanes3 squares = load3(&links.inertia[0]), products = load3(&links.inertia[3]);
    const LanesSymmetric I_link =
        turned(m.R, {squares.x, squares.y, squares.z, products.x, products.y, products.z});
    f = sum_inward(m.acceleration(h_link) + load(links.mass.data()) * m.a, f_beyond);
    n = sum_inward(I_link * m.wd + cross(m.w, I_link * m.w) + cross(h_link, m.a) +
                       cross(m.e, of_next(f, f_beyond)),
                   n);
    store(dot(J_angular, n) + dot(slide, f), &coriolis[g]);
    h = sum_inward(h_link + beyond * m.e, h_beyond);
    I = sum_inward(I_link + shift_term(of_next(h, h_beyond) + (0.5 * beyond) * m.e, m.e), I);

    const Vec4d one{1, 1, 1, 1};
    const Lanes3 to_tip = Lanes3{tip.x() * one, tip.y() * one, tip.z() * one} - m.p;
    const Lanes3 F = cross(J_angular, h) + carried * slide;
    store6(cross(J_angular, to_tip) + slide, J_angular, g, J);
    store6(F, I * J_angular + cross(h, slide) + cross(F, to_tip), g, wrench);
    store(-(gravity_.x() * F.x + gravity_.y() * F.y + gravity_.z() * F.z), &gravity[g]);
  }
  write_J_M(J, wrench, n_, result);
  result.coriolis.resize(n_);
  result.gravity.resize(n_);
  for (int i = 0; i < n_; ++i) {
    result.M(i, i) += reflected_inertia_[i];
    result.coriolis[i] = coriolis[static_cast<std::size_t>(i)];
    result.gravity[i] = gravity[static_cast<std::size_t>(i)];
  }
}

DynamicsResult evaluate(const RobotModel& model, const JointVector& q, const JointVector& qd) {
  const int n = model.dof();
  if (q.size() != n || qd.size() != n) {
    throw std::invalid_argument("evaluate: q and qd need " + std::to_string(n) + " entries each");
  }
  DynamicsResult result;
  DynamicsKernel(model).evaluate(q, qd, result);
  return result;
}

}  // namespace dashpot::controller
