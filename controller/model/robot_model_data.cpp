// The data of a RobotModel: bodies of URDF, what is attached, and what the model shows.
#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/controller/model/robot_model_data.hpp>
#include <dashpot/controller/model/urdf_tree.hpp>
#include <dashpot/text/printable.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace dashpot::controller {
namespace {

constexpr double kInertiaRounding = 0.005;  // of published inertias, relative
constexpr double kSmallest = 1e-12;         // squared radius of gyration that counts, m^2
constexpr double kLightest = 1e-6;          // kg

/// Returns by how much the largest moment exceeds the sum of the others: " by 8.6 %", or " far".
std::string excess_text(const Eigen::Vector3d& moments) {
  const double excess = moments[2] / (moments[0] + moments[1]) - 1;
  if (!(excess > 0 && excess < 10)) return " far";
  return " by " + text::number(100 * excess, 3) + " %";
}

KDL::RigidBodyInertia make_body(double mass, const Eigen::Vector3d& center,
                                const Eigen::Matrix3d& I) {
  return KDL::RigidBodyInertia(
      mass, to_kdl(center),
      KDL::RotationalInertia(I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)));
}

}  // namespace

KDL::Vector to_kdl(const Eigen::Vector3d& v) {
  return KDL::Vector(v.x(), v.y(), v.z());
}

KDL::Rotation to_kdl(const Eigen::Matrix3d& R) {
  return {R(0, 0), R(0, 1), R(0, 2), R(1, 0), R(1, 1), R(1, 2), R(2, 0), R(2, 1), R(2, 2)};
}

KDL::Vector to_kdl(const urdf::Vector3& v) {
  return {v.x, v.y, v.z};
}

KDL::Frame to_kdl(const urdf::Pose& pose) {
  const urdf::Rotation& r = pose.rotation;
  return {KDL::Rotation::Quaternion(r.x, r.y, r.z, r.w), to_kdl(pose.position)};
}

std::string mass_problem(double mass, const Eigen::Vector3d& center,
                         const Eigen::Matrix3d& inertia) {
  if (!std::isfinite(mass)) return "its mass is not a finite number";
  if (!center.allFinite()) return "its centre of mass is not finite";
  if (!inertia.allFinite()) return "its inertia is not finite";
  if (mass < 0) return "its mass is negative, " + text::number(mass) + " kg";
  return "";
}

std::string inertia_problem(double mass, const Eigen::Matrix3d& inertia) {
  if (!inertia.isApprox(inertia.transpose(), 1e-10)) return "its inertia is not symmetric";
  const Eigen::Vector3d moments =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(inertia, Eigen::EigenvaluesOnly).eigenvalues();
  const double rounding =
      kInertiaRounding * moments.cwiseAbs().maxCoeff() + kSmallest * std::max(mass, kLightest);
  if (moments[0] < -rounding) {
    return "its inertia is not positive definite: a principal moment is " +
           text::number(moments[0]) + " kg m^2";
  }
  if (moments[2] > moments[0] + moments[1] + rounding) {
    return "its inertia breaks the triangle inequality" + excess_text(moments) +
           ": principal moments " + text::number(moments[0]) + ", " + text::number(moments[1]) +
           ", " + text::number(moments[2]) + " kg m^2";
  }
  return "";
}

LinkBody body_of(const urdf::Link& link) {
  LinkBody result;
  result.link = link.name;
  result.body = KDL::RigidBodyInertia::Zero();
  if (!link.inertial) return result;
  const urdf::Inertial& source = *link.inertial;
  const KDL::Frame frame = to_kdl(source.origin);
  Eigen::Matrix3d I;
  I << source.ixx, source.ixy, source.ixz, source.ixy, source.iyy, source.iyz, source.ixz,
      source.iyz, source.izz;
  result.problem = mass_problem(source.mass, {frame.p.x(), frame.p.y(), frame.p.z()}, I);
  if (!result.problem.empty()) return result;
  result.possible = true;
  result.problem = inertia_problem(source.mass, I);
  result.moment = I.cwiseAbs().maxCoeff();
  result.body = frame * make_body(source.mass, Eigen::Vector3d::Zero(), I);
  return result;
}

const std::string& RobotModel::name() const noexcept {
  return data_->name;
}
const std::string& RobotModel::base() const noexcept {
  return data_->base;
}
const std::string& RobotModel::tip() const noexcept {
  return data_->tip;
}
int RobotModel::dof() const noexcept {
  return static_cast<int>(data_->joints.size());
}
const std::vector<Joint>& RobotModel::joints() const noexcept {
  return data_->joints;
}
const std::vector<std::string>& RobotModel::warnings() const noexcept {
  return data_->warnings;
}
const Eigen::Vector3d& RobotModel::gravity() const noexcept {
  return data_->gravity;
}

JointVector RobotModel::joint_values(double Joint::*property) const {
  JointVector values(dof());
  for (int i = 0; i < dof(); ++i) values[i] = data_->joints[static_cast<std::size_t>(i)].*property;
  return values;
}

int RobotModel::elastic_joints() const noexcept {
  int count = 0;
  for (const Joint& joint : joints()) count += joint.elastic() ? 1 : 0;
  return count;
}
PositionSensor RobotModel::position_sensor() const noexcept {
  return data_->position_sensor;
}

const Attachment& RobotModel::attachment() const noexcept {
  return data_->attachment;
}

void RobotModel::Data::attach(const Attachment& given) {
  attachment = given;
  const Payload payload = given.payload();
  const Eigen::Matrix3d& I = payload.inertia;
  const KDL::RigidBodyInertia body(
      payload.mass, to_kdl(payload.center),
      KDL::RotationalInertia(I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)));
  const unsigned end = chain.getNrOfSegments() - 1;
  chain.getSegment(end - 1).setInertia(last_body + tip_link * body);
  const KDL::Frame tool(to_kdl(given.tool.rotation), to_kdl(given.tool.position));
  chain.getSegment(end) =
      KDL::Segment("tool", KDL::Joint("tool", KDL::Joint::None), tip_link * tool);
}

const KDL::Chain& kdl_chain(const RobotModel& model) noexcept {
  return model.data().chain;
}

namespace {

/// |p|^2 1 - p p': the inertia of 1 kg at p.
Eigen::Matrix3d of_point(const Eigen::Vector3d& p) noexcept {
  return p.squaredNorm() * Eigen::Matrix3d::Identity() - p * p.transpose();
}

}  // namespace

Attachment::Attachment(const Payload& payload, const Pose& given)
    : mass(payload.mass),
      first_moment(payload.mass * payload.center),
      inertia(payload.inertia + payload.mass * of_point(payload.center)),
      tool(given) {
  std::string problem = mass_problem(payload.mass, payload.center, payload.inertia);
  if (problem.empty()) problem = inertia_problem(payload.mass, payload.inertia);
  if (!problem.empty()) throw InvalidModel("payload: " + problem);
  if (!first_moment.allFinite() || !inertia.allFinite()) throw InvalidModel("payload: too large");
  const Eigen::Matrix3d& R = given.rotation;
  const bool turns = (R.transpose() * R).isIdentity(1e-9) && R.determinant() > 0;
  if (!turns || !given.position.allFinite()) {
    throw InvalidModel("tool: not a rotation and a finite position");
  }
}

Payload Attachment::payload() const noexcept {
  if (mass == 0) return {0, Eigen::Vector3d::Zero(), inertia};
  const Eigen::Vector3d center = first_moment / mass;
  return {mass, center, inertia - mass * of_point(center)};
}

bool Attachment::operator==(const Attachment& other) const noexcept {
  return mass == other.mass && first_moment == other.first_moment && inertia == other.inertia &&
         tool.position == other.tool.position && tool.rotation == other.tool.rotation;
}

Attachment blend(const Attachment& a, const Attachment& b, double s) noexcept {
  const double r = 1 - s;
  Attachment c;
  c.mass = r * a.mass + s * b.mass;
  c.first_moment = r * a.first_moment + s * b.first_moment;
  c.inertia = r * a.inertia + s * b.inertia;
  c.tool.position = r * a.tool.position + s * b.tool.position;
  c.tool.rotation = a.tool.rotation;
  if (a.tool.rotation != b.tool.rotation) {
    const Eigen::Quaterniond from(a.tool.rotation), to(b.tool.rotation);
    c.tool.rotation = from.slerp(s, to).normalized().toRotationMatrix();
  }
  return c;
}

Pose carried(const Pose& pose, const Pose& from, const Pose& to) noexcept {
  if (from.position == to.position && from.rotation == to.rotation) return pose;
  const Eigen::Matrix3d R = pose.rotation * from.rotation.transpose();
  return {pose.position + R * (to.position - from.position), R * to.rotation};
}

}  // namespace dashpot::controller
