#include <dashpot/controller/model/rigid_bodies.hpp>
#include <dashpot/controller/model/urdf_tree.hpp>
#include <dashpot/text/printable.hpp>

#include <Eigen/Eigenvalues>
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

}  // namespace dashpot::controller
