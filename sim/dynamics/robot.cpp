#include <dashpot/sim/robot.hpp>
#include <dashpot/text/plain_urdf.hpp>
#include <dashpot/text/printable.hpp>
#include <dashpot/text/read_file.hpp>
#include <dashpot/text/xml_check.hpp>

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <exception>
#include <set>
#include <sstream>
#include <utility>

namespace dashpot::sim {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

[[noreturn]] void fail(const std::string& where, const std::string& reason) {
  throw InvalidRobot(text::printable(where + ": " + reason));
}

void require_finite(double value, double least, const std::string& where, const char* unit) {
  if (std::isfinite(value) && value >= least) return;
  std::ostringstream text;
  text << "is " << value << " " << unit << ", must be finite"
       << (least == 0 ? " and not negative" : "");
  fail(where, text.str());
}

Vector3d vector_of(const urdf::Vector3& v) {
  return {v.x, v.y, v.z};
}

Pose pose_of(const urdf::Pose& pose, const std::string& where) {
  const Eigen::Quaterniond turn(pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z);
  Pose result{vector_of(pose.position), turn.normalized().toRotationMatrix()};
  if (!result.position.allFinite()) fail(where, "origin xyz is not finite");
  if (!result.rotation.allFinite()) fail(where, "origin rpy is not finite");
  return result;
}

/// With `any_inertia` moments may be negative.
void require_physical(const Inertia& body, const std::string& where, bool any_inertia) {
  require_finite(body.mass, 0, where + ": mass", "kg");
  if (!body.center.allFinite()) fail(where, "the centre of mass is not finite");
  if (!body.about_center.allFinite()) fail(where, "inertia is not finite");
  if (body.about_center != body.about_center.transpose()) fail(where, "inertia is not symmetric");
  const Vector3d moments =
      Eigen::SelfAdjointEigenSolver<Matrix3d>(body.about_center, Eigen::EigenvaluesOnly)
          .eigenvalues();
  // Rounding: of the largest moment, and of a mass one micrometre from its centre.
  const double rounding = 1e-9 * moments[2] + 1e-12 * std::max(body.mass, 1e-6);
  if (!any_inertia && moments[0] < -rounding) {
    std::ostringstream text;
    text << "inertia has the negative principal moment " << moments[0] << " kg m^2";
    fail(where, text.str());
  }
}

/// Keeps the parser's messages, which it reports through a logger.
class ParserMessages : public console_bridge::OutputHandler {
 public:
  ParserMessages() { console_bridge::useOutputHandler(this); }
  ~ParserMessages() override { console_bridge::restorePreviousOutputHandler(); }
  ParserMessages(const ParserMessages&) = delete;
  ParserMessages& operator=(const ParserMessages&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level < console_bridge::CONSOLE_BRIDGE_LOG_ERROR || !first_.empty()) return;
    constexpr std::size_t kEnough = 1000;  // bytes; it may quote a text of any length
    first_ = text.substr(0, kEnough);
    std::replace(first_.begin(), first_.end(), '\n', ' ');
  }
  const std::string& first() const { return first_; }

 private:
  std::string first_;
};

using Link = urdf::LinkConstSharedPtr;

class Reader {
 public:
  Reader(const std::string& text, const std::string& name, bool any_inertia)
      : name_(name), any_inertia_(any_inertia) {
    ParserMessages messages;
    try {
      model_ = urdf::parseURDF(text::plain_urdf(text, name).text);
    } catch (const std::exception& error) {
      fail(name, error.what());
    }
    if (!model_) fail(name, messages.first().empty() ? "not a robot" : messages.first());
    require_tree();
  }

  Link link(const std::string& name, const char* role) const {
    Link found = model_->getLink(name);
    if (!found) fail(name_, std::string(role) + " link '" + name + "' does not exist");
    return found;
  }

  /// The joints from the base link to the tip link, fixed ones too.
  std::vector<urdf::JointConstSharedPtr> path(const Link& base, const Link& tip) const {
    std::vector<urdf::JointConstSharedPtr> joints;
    for (Link at = tip; at != base; at = at->getParent()) {
      if (!at->parent_joint) {
        fail(name_, "tip link '" + tip->name + "' does not hang on base link '" + base->name + "'");
      }
      joints.push_back(at->parent_joint);
    }
    std::reverse(joints.begin(), joints.end());
    return joints;
  }

  std::string at(const urdf::Joint& joint) const { return name_ + ": joint '" + joint.name + "'"; }

  Pose origin(const urdf::Joint& joint) const {
    return pose_of(joint.parent_to_joint_origin_transform, at(joint));
  }

  /// Returns the inertia of the link and all that hangs on it, but for the joint `left_out`; in the
  /// link's axes.
  Inertia lumped(const urdf::Link& link, const urdf::Joint* left_out) const {
    Inertia sum;
    std::vector<std::pair<const urdf::Link*, Pose>> open = {{&link, Pose()}};  // pose in `link`
    while (!open.empty()) {  // branches may be too long for recursion
      const auto [at, pose] = open.back();
      open.pop_back();
      sum = sum + pose * own(*at);
      for (const urdf::JointSharedPtr& joint : at->child_joints) {
        if (joint.get() != left_out) open.emplace_back(&child(*joint), pose * origin(*joint));
      }
    }
    return sum;
  }

  Joint joint(const urdf::Joint& read) const;
  Vector3d axis(const urdf::Joint& joint) const;
  const urdf::Link& child(const urdf::Joint& joint) const {
    return *model_->getLink(joint.child_link_name);
  }
  Link root() const { return model_->getRoot(); }

 private:
  Inertia own(const urdf::Link& link) const {
    if (!link.inertial) return {};
    const std::string where = name_ + ": link '" + link.name + "'";
    const urdf::Inertial& read = *link.inertial;
    Inertia body;
    body.mass = read.mass;
    body.about_center << read.ixx, read.ixy, read.ixz,  //
        read.ixy, read.iyy, read.iyz,                   //
        read.ixz, read.iyz, read.izz;
    require_physical(body, where, any_inertia_);
    return pose_of(read.origin, where) * body;
  }

  /// The parser lets links with two parents and loops pass.
  void require_tree() const {
    for (const auto& [name, joint] : model_->joints_) {
      if (child(*joint).parent_joint != joint) {
        fail(name_, "link '" + joint->child_link_name + "' is the child of two joints");
      }
    }
    std::vector<Link> open = {root()};
    std::set<std::string> reached;
    while (!open.empty()) {
      const Link at = open.back();
      open.pop_back();
      reached.insert(at->name);
      for (const urdf::LinkSharedPtr& below : at->child_links) open.push_back(below);
    }
    for (const auto& [name, link] : model_->links_) {
      if (reached.count(name) == 0) fail(name_, "link '" + name + "' is part of a loop");
    }
  }

  std::string name_;
  bool any_inertia_;
  urdf::ModelInterfaceSharedPtr model_;
};

/// Reads a moving joint, without its pose and inertia.
Joint Reader::joint(const urdf::Joint& read) const {
  const bool continuous = read.type == urdf::Joint::CONTINUOUS;
  const bool prismatic = read.type == urdf::Joint::PRISMATIC;
  const std::string where = at(read);
  if (!continuous && !prismatic && read.type != urdf::Joint::REVOLUTE) {
    fail(where, "type must be fixed, revolute, continuous or prismatic on the chain");
  }
  if (read.mimic) fail(where, "mimics another joint; on the chain it must move by itself");
  Joint result;
  result.name = read.name;
  result.prismatic = prismatic;
  const bool limited = read.limits && !continuous;
  result.lower = limited ? read.limits->lower : -kInfinity;
  result.upper = limited ? read.limits->upper : kInfinity;
  if (!(result.lower < result.upper)) fail(where, "lower limit is not below upper limit");
  // Files write 0 for a limit that they do not know.
  result.effort = read.limits && read.limits->effort != 0 ? read.limits->effort : kInfinity;
  result.velocity = read.limits && read.limits->velocity != 0 ? read.limits->velocity : kInfinity;
  if (!(result.effort > 0)) fail(where, "limit effort is negative");
  if (!(result.velocity > 0)) fail(where, "limit velocity is negative");
  if (read.dynamics) {
    result.viscous_friction = read.dynamics->damping;
    result.coulomb_friction = read.dynamics->friction;
  }
  require_finite(result.viscous_friction, 0, where + ": dynamics damping",
                 prismatic ? "N s/m" : "N m s/rad");
  require_finite(result.coulomb_friction, 0, where + ": dynamics friction",
                 prismatic ? "N" : "N m");
  return result;
}

/// Unit vector, in the axes of the child link.
Vector3d Reader::axis(const urdf::Joint& joint) const {
  const Vector3d axis = vector_of(joint.axis);
  const double norm = axis.norm();
  if (!std::isfinite(norm) || norm < 1e-9) fail(at(joint), "axis is zero or not finite");
  return axis / norm;
}

/// Columns x, y, z of a frame whose z axis is `axis`; the identity for (0, 0, 1).
Matrix3d frame_on(const Vector3d& axis) {
  return Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), axis).toRotationMatrix();
}

/// Adds the moving joints along the path; returns its last link's pose in the last joint's body.
Pose read_chain(const Reader& reader, const std::vector<urdf::JointConstSharedPtr>& path,
                std::vector<Joint>& joints) {
  // The pose of the link reached so far in the last moving joint's body, or in the base.
  Pose link_in_body;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const urdf::Joint& read = *path[i];
    link_in_body = link_in_body * reader.origin(read);
    if (read.type != urdf::Joint::FIXED) {
      Joint joint = reader.joint(read);
      const Matrix3d R_LB = frame_on(reader.axis(read));  // from the body's axes to the link's
      joint.origin = link_in_body * Pose{Vector3d::Zero(), R_LB};
      link_in_body = {Vector3d::Zero(), R_LB.transpose()};
      joints.push_back(joint);
    }
    if (joints.empty()) continue;  // still part of the base
    const urdf::Joint* next = i + 1 < path.size() ? path[i + 1].get() : nullptr;
    Inertia& inertia = joints.back().inertia;
    inertia = inertia + link_in_body * reader.lumped(reader.child(read), next);
  }
  return link_in_body;
}

void require_size(const JointVector& values, const char* key, const std::vector<Joint>& joints) {
  if (values.size() == static_cast<Eigen::Index>(joints.size())) return;
  std::ostringstream text;
  text << "has " << values.size() << " entries, the chain has " << joints.size() << " joints";
  fail(key, text.str());
}

void override_with(const JointVector& values, double Joint::*member, const char* key,
                   const char* unit, std::vector<Joint>& joints) {
  if (values.size() == 0) return;
  require_size(values, key, joints);
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const double value = values[static_cast<Eigen::Index>(i)];
    require_finite(value, 0, std::string(key) + " of joint '" + joints[i].name + "'", unit);
    joints[i].*member = value;
  }
}

/// Sets gears; an elastic one needs a drive with an inertia.
void set_gears(const RobotParameters& parameters, std::vector<Joint>& joints) {
  const JointVector& stiffness = parameters.gear_stiffness;
  override_with(parameters.gear_damping, &Joint::gear_damping, "gear_damping", "N m s/rad", joints);
  if (stiffness.size() == 0) return;
  require_size(stiffness, "gear_stiffness", joints);
  std::size_t coordinates = joints.size();
  for (std::size_t i = 0; i < joints.size(); ++i) {
    Joint& joint = joints[i];
    const std::string where = "gear_stiffness of joint '" + joint.name + "'";
    joint.gear_stiffness = stiffness[static_cast<Eigen::Index>(i)];
    if (!(joint.gear_stiffness > 0)) fail(where, "must be positive, N m/rad; infinite: rigid");
    if (!joint.elastic()) continue;
    ++coordinates;
    if (joint.reflected_inertia == 0) fail(where, "needs a reflected_inertia, of the drive");
  }
  if (coordinates > kMaxJoints) {
    fail("gear_stiffness", "joints and elastic gears are " + std::to_string(coordinates) +
                               " coordinates, at most " + std::to_string(kMaxJoints) +
                               " are possible");
  }
}

/// Every joint must move something. Masses that lie on its axis in some position are not detected
/// here; the plant then reports Status::kStateNotFinite.
void require_inertia(const std::vector<Joint>& joints, const std::string& name) {
  double mass = 0, moment = 0;
  for (auto joint = joints.rbegin(); joint != joints.rend(); ++joint) {
    mass += joint->inertia.mass;
    moment += joint->inertia.about_center.trace() +
              joint->inertia.mass * joint->inertia.center.squaredNorm();
    if (joint->drive_inertia_on_link() == 0 && mass == 0 && (joint->prismatic || moment == 0)) {
      fail(name + ": joint '" + joint->name + "'",
           joint->elastic() ? "moves no mass behind its elastic gear"
                            : "moves no mass and has no reflected_inertia");
    }
  }
}

}  // namespace

int Robot::coordinates() const noexcept {
  const auto elastic = std::count_if(joints_.begin(), joints_.end(),
                                     [](const Joint& joint) { return joint.elastic(); });
  return dof() + static_cast<int>(elastic);
}

Robot Robot::from_file(const std::string& path, const std::string& base, const std::string& tip,
                       const RobotParameters& parameters) {
  std::string text;
  try {
    text = text::read_file(path, text::kLargestXml);
  } catch (const std::exception& error) {
    fail(path, error.what());
  }
  return from_text(text, base, tip, parameters, path);
}

Robot Robot::from_text(const std::string& urdf, const std::string& base, const std::string& tip,
                       const RobotParameters& parameters, const std::string& name) {
  const Reader reader(urdf, name, parameters.accept_inertias);
  const Link base_link = reader.link(base, "base");
  Robot robot;
  robot.tip_ = read_chain(reader, reader.path(base_link, reader.link(tip, "tip")), robot.joints_);
  const std::size_t n = robot.joints_.size();
  if (n < 1 || n > kMaxJoints) {
    fail(name, "the chain from '" + base + "' to '" + tip + "' has " + std::to_string(n) +
                   " moving joints, must have 1 to " + std::to_string(kMaxJoints));
  }
  require_physical(parameters.payload, "payload", false);
  Inertia& last = robot.joints_.back().inertia;
  last = last + robot.tip_ * parameters.payload;
  robot.last_ = last;
  override_with(parameters.reflected_inertia, &Joint::reflected_inertia, "reflected_inertia",
                "kg m^2", robot.joints_);
  override_with(parameters.viscous_friction, &Joint::viscous_friction, "viscous friction",
                "N m s/rad", robot.joints_);
  override_with(parameters.coulomb_friction, &Joint::coulomb_friction, "Coulomb friction", "N m",
                robot.joints_);
  set_gears(parameters, robot.joints_);
  require_inertia(robot.joints_, name);

  if (!parameters.gravity.allFinite()) fail("gravity", "is not finite");
  Matrix3d R_RB = Matrix3d::Identity();  // from the base's axes to the root's
  for (const auto& joint : reader.path(reader.root(), base_link)) {
    R_RB = R_RB * reader.origin(*joint).rotation;
  }
  robot.gravity_ = R_RB.transpose() * parameters.gravity;
  return robot;
}

}  // namespace dashpot::sim
