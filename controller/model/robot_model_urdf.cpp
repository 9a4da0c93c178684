// A RobotModel from a URDF.
#include <dashpot/controller/drives.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/controller/model/moved_links.hpp>
#include <dashpot/controller/model/robot_model_data.hpp>
#include <dashpot/controller/model/urdf_tree.hpp>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

namespace dashpot::controller {
namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();

/// The joints from `base` to `tip`, fixed ones too.
std::vector<urdf::JointConstSharedPtr> path_between(const urdf::ModelInterface& tree,
                                                    const std::string& base, const std::string& tip,
                                                    const std::string& name) {
  for (const std::string& link : {base, tip}) {
    if (!tree.getLink(link)) refuse(name, "link", link, "there is none; " + links_near(link, tree));
  }
  std::vector<urdf::JointConstSharedPtr> path;
  for (urdf::LinkConstSharedPtr link = tree.getLink(tip); link->name != base;
       link = tree.getLink(link->parent_joint->parent_link_name)) {
    if (!link->parent_joint) refuse(name, "link", tip, "not beyond the base, '" + base + "'");
    path.push_back(link->parent_joint);
  }
  std::reverse(path.begin(), path.end());
  return path;
}

JointType type_of(const urdf::Joint& joint) {
  switch (joint.type) {
    case urdf::Joint::REVOLUTE:
      return JointType::kRevolute;
    case urdf::Joint::CONTINUOUS:
      return JointType::kContinuous;
    case urdf::Joint::PRISMATIC:
      return JointType::kPrismatic;
    default:
      throw std::invalid_argument(std::string(joint.type == urdf::Joint::PLANAR     ? "planar"
                                              : joint.type == urdf::Joint::FLOATING ? "floating"
                                                                                    : "unknown") +
                                  " joints are not supported");
  }
}

/// Throws std::invalid_argument with what is wrong about it.
Joint read_joint(const urdf::Joint& source) {
  Joint joint;
  joint.name = source.name;
  joint.type = type_of(source);
  if (source.mimic) {
    throw std::invalid_argument("mimics joint '" + source.mimic->joint_name +
                                "', which a serial chain cannot");
  }
  const double length = std::hypot(source.axis.x, source.axis.y, source.axis.z);
  if (!(length > 1e-9) || !std::isfinite(length)) {
    throw std::invalid_argument("its axis has no direction");
  }
  joint.lower = -kUnlimited;
  joint.upper = joint.velocity = joint.effort = kUnlimited;
  if (source.limits) {
    if (joint.type != JointType::kContinuous) {
      joint.lower = source.limits->lower;
      joint.upper = source.limits->upper;
    }
    // Files write 0 for a limit that they do not know.
    if (source.limits->velocity != 0) joint.velocity = source.limits->velocity;
    if (source.limits->effort != 0) joint.effort = source.limits->effort;
  }
  if (!(joint.lower <= joint.upper)) {
    throw std::invalid_argument("its lower limit is above its upper one");
  }
  if (!(joint.velocity >= 0 && joint.effort >= 0)) {
    throw std::invalid_argument("a limit of velocity or effort is negative");
  }
  if (source.dynamics) {
    joint.viscous_friction = source.dynamics->damping;
    joint.coulomb_friction = source.dynamics->friction;
  }
  return joint;
}

/// Sets one property of all joints from an option, if given, and checks it.
void apply(const JointVector& option, double Joint::*property, const std::string& key,
           std::vector<Joint>& joints, const std::string& name) {
  const auto n = static_cast<Eigen::Index>(joints.size());
  if (option.size() != 0 && option.size() != n) {
    throw InvalidModel(name + ": " + key + ": has " + std::to_string(option.size()) +
                       " entries for " + std::to_string(n) + " joints");
  }
  for (std::size_t i = 0; i < joints.size(); ++i) {
    double& value = joints[i].*property;
    if (option.size() != 0) value = option[static_cast<Eigen::Index>(i)];
    if (value >= 0 && std::isfinite(value)) continue;
    refuse(name, "joint", joints[i].name, key + " is negative or not a finite number");
  }
}

/// Throws what is wrong with elastic joints.
void check_gears(const std::vector<Joint>& joints, const std::string& name) {
  std::size_t elastic = 0;
  for (const Joint& joint : joints) {
    if (!(joint.gear_stiffness > 0)) {
      refuse(name, "joint", joint.name, "gear stiffness is not a positive number, N m/rad");
    }
    if (!joint.elastic()) continue;
    ++elastic;
    if (joint.reflected_inertia > 0) continue;
    std::ostringstream stiffness;
    stiffness << joint.gear_stiffness;
    refuse(name, "joint", joint.name,
           "a gear stiffness of " + stiffness.str() +
               " N m/rad needs the reflected inertia (kg m^2) of the motor behind it");
  }
  const std::size_t most = static_cast<std::size_t>(kMaxJoints) - joints.size();
  if (elastic <= most) return;
  throw InvalidModel(name + ": gear stiffness: " + std::to_string(elastic) + " of " +
                     std::to_string(joints.size()) + " joints are elastic, at most " +
                     std::to_string(most) + " can be; set the others to none");
}

/// Sets the gears, and what the drives' torque controllers make of the reflected inertia.
void apply_gears(const ModelOptions& options, std::vector<Joint>& joints, const std::string& name) {
  apply(options.gear_damping, &Joint::gear_damping, "gear damping", joints, name);
  const auto n = static_cast<Eigen::Index>(joints.size());
  for (const auto& [option, key] :
       {std::pair(&options.gear_stiffness, "gear stiffness"),
        std::pair(&options.torque_loop_inertia_ratio, "torque loop inertia ratio")}) {
    if (option->size() == 0 || option->size() == n) continue;
    throw InvalidModel(name + ": " + key + ": has " + std::to_string(option->size()) +
                       " entries for " + std::to_string(n) + " joints");
  }
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    if (options.gear_stiffness.size() != 0) joints[i].gear_stiffness = options.gear_stiffness[at];
    if (options.torque_loop_inertia_ratio.size() == 0) continue;
    const double ratio = options.torque_loop_inertia_ratio[at];
    if (!(ratio > 0 && ratio <= 1)) {
      refuse(name, "joint", joints[i].name, "torque loop inertia ratio is not in (0, 1]");
    }
    joints[i].reflected_inertia *= ratio;
  }
  check_gears(joints, name);
}

/// Inertia of `link`, and, if wanted, of all that hangs on it but the branch that begins with joint
/// `next`, at its zero position; in the link's axes. It does not call itself: branches may be
/// thousands of links long.
KDL::RigidBodyInertia lump(const urdf::ModelInterface& tree, const std::string& link,
                           const std::string& next, const ModelOptions& options, int segment,
                           std::vector<MovedLink>& moved) {
  KDL::RigidBodyInertia sum = KDL::RigidBodyInertia::Zero();
  std::vector<std::pair<urdf::LinkConstSharedPtr, KDL::Frame>> open;  // with their poses in `link`
  open.emplace_back(tree.getLink(link), KDL::Frame::Identity());
  while (!open.empty()) {
    const auto [at, frame] = open.back();
    open.pop_back();
    const LinkBody own = body_of(*at);
    sum = sum + frame * own.body;
    if (at->inertial) moved.push_back({own, segment});
    if (!options.include_off_chain) break;
    for (const urdf::JointSharedPtr& joint : at->child_joints) {
      if (joint->name == next) continue;
      open.emplace_back(tree.getLink(joint->child_link_name),
                        frame * to_kdl(joint->parent_to_joint_origin_transform));
    }
  }
  return sum;
}

/// Rotation from B to the root link's axes.
KDL::Rotation rotation_of_base(const urdf::ModelInterface& tree, const std::string& base) {
  KDL::Rotation rotation;
  for (urdf::LinkConstSharedPtr link = tree.getLink(base); link->parent_joint;
       link = tree.getLink(link->parent_joint->parent_link_name)) {
    rotation = to_kdl(link->parent_joint->parent_to_joint_origin_transform).M * rotation;
  }
  return rotation;
}

Attachment attached(const ModelOptions& options, const std::string& name) try {
  return {options.payload, options.tool};
} catch (const InvalidModel& error) {
  throw InvalidModel(name + ": " + error.what());
}

/// Moving joints of the path, in order, with what the options say of them.
std::vector<Joint> read_joints(const std::vector<urdf::JointConstSharedPtr>& path,
                               const UrdfTree& tree, const ModelOptions& options,
                               const std::string& name) {
  std::vector<Joint> joints;
  for (const urdf::JointConstSharedPtr& joint : path) {
    if (joint->type == urdf::Joint::FIXED) continue;
    if (const auto lacks = tree.lacks.find(joint->name); lacks != tree.lacks.end()) {
      refuse(name, "joint", joint->name, "its limit has no " + lacks->second);
    }
    try {
      joints.push_back(read_joint(*joint));
    } catch (const std::invalid_argument& error) {
      refuse(name, "joint", joint->name, error.what());
    }
    if (const auto limits = tree.limits.find(joint->name); limits != tree.limits.end()) {
      joints.back().acceleration = limits->second.acceleration;
      joints.back().deceleration = limits->second.deceleration;
      joints.back().jerk = limits->second.jerk;
    }
  }
  for (Joint& joint : joints) {
    const auto rotor = tree.reflected_inertia.find(joint.name);
    if (rotor != tree.reflected_inertia.end()) joint.reflected_inertia = rotor->second;
  }
  if (!options.drives.empty()) {
    const Drives& drives = find_drives(options.drives, static_cast<int>(joints.size()));
    const auto take = [&](const auto& figures, double Joint::*property) {
      for (std::size_t i = 0; i < joints.size(); ++i) joints[i].*property = figures[i];
    };
    take(drives.reflected_inertia, &Joint::reflected_inertia);
    if (options.drives_friction) {
      take(drives.viscous_friction, &Joint::viscous_friction);
      take(drives.coulomb_friction, &Joint::coulomb_friction);
    }
  }
  apply(options.reflected_inertia, &Joint::reflected_inertia, "reflected inertia", joints, name);
  apply(options.viscous_friction, &Joint::viscous_friction, "damping", joints, name);
  apply(options.coulomb_friction, &Joint::coulomb_friction, "friction", joints, name);
  apply_gears(options, joints, name);
  return joints;
}

/// Sets the chain, with nothing attached to it yet, and returns the links that move and have a
/// mass.
std::vector<MovedLink> make_chain(const urdf::ModelInterface& tree,
                                  const std::vector<urdf::JointConstSharedPtr>& path,
                                  const std::vector<Joint>& joints, const ModelOptions& options,
                                  RobotModel::Data& data) {
  std::vector<MovedLink> moved;
  KDL::Chain& chain = data.chain;
  KDL::Segment segment;  // being put together; the first, what stands still, is dropped
  KDL::RigidBodyInertia body = KDL::RigidBodyInertia::Zero();
  KDL::Frame frame;  // of the last link of the path in the segment's frame
  std::size_t moving = 0;
  const auto finish = [&] {
    if (moving == 0) return;
    segment.setInertia(body);
    chain.addSegment(segment);
  };
  for (std::size_t i = 0; i < path.size(); ++i) {
    const urdf::Joint& joint = *path[i];
    const KDL::Frame origin = frame * to_kdl(joint.parent_to_joint_origin_transform);
    const std::string next = i + 1 < path.size() ? path[i + 1]->name : "";
    const bool moves = joint.type != urdf::Joint::FIXED;
    if (moves) {
      finish();
      const auto type =
          joint.type == urdf::Joint::PRISMATIC ? KDL::Joint::TransAxis : KDL::Joint::RotAxis;
      segment = KDL::Segment(joint.child_link_name,
                             KDL::Joint(joint.name, origin.p, origin.M * to_kdl(joint.axis), type,
                                        1, 0, joints[moving].reflected_inertia),
                             origin);
      body = KDL::RigidBodyInertia::Zero();
      ++moving;
    }
    frame = moves ? KDL::Frame::Identity() : origin;
    if (moving == 0) continue;
    const int index = static_cast<int>(moving) - 1;
    body = body + frame * lump(tree, joint.child_link_name, next, options, index, moved);
  }
  finish();
  chain.addSegment(KDL::Segment());
  data.last_body = body;
  data.tip_link = frame;
  return moved;
}

/// Warns of the position limits of joints that turn without end, because they do not count.
void doubt_limits(const std::vector<urdf::JointConstSharedPtr>& path,
                  std::vector<std::string>& warnings) {
  for (const urdf::JointConstSharedPtr& joint : path) {
    if (joint->type != urdf::Joint::CONTINUOUS || !joint->limits) continue;
    const double lower = joint->limits->lower, upper = joint->limits->upper;
    if (!(lower < upper)) continue;
    std::ostringstream range;
    range << lower << " to " << upper;
    warnings.push_back(one_line("joint '" + joint->name + "': it is continuous, so its limits " +
                                range.str() +
                                " rad do not count; a revolute joint keeps them, and "
                                "so does limits.position_lower, _upper"));
  }
}

/// Warns of joints whose origins are rotated by more than a turn.
void doubt_turns(const std::vector<urdf::JointConstSharedPtr>& path, const UrdfTree& tree,
                 std::vector<std::string>& warnings) {
  for (const urdf::JointConstSharedPtr& joint : path) {
    const auto found = tree.turns.find(joint->name);
    if (found == tree.turns.end()) continue;
    warnings.push_back(one_line("joint '" + joint->name + "': its origin's rpy is " +
                                found->second + " rad, beyond a turn: is it in degrees?"));
  }
}

/// Warns of wrong inertias of links before the first moving joint, which affect nothing.
void doubt_base(const urdf::ModelInterface& tree, const std::string& base,
                const std::vector<urdf::JointConstSharedPtr>& path,
                std::vector<std::string>& warnings) {
  std::string link = base;
  for (std::size_t i = 0;; ++i) {
    const std::string problem = body_of(*tree.getLink(link)).problem;
    if (!problem.empty()) {
      warnings.push_back(one_line(std::string("link '").append(link).append("': ").append(
          problem + "; it stands still, and does not count")));
    }
    if (i == path.size() || path[i]->type != urdf::Joint::FIXED) return;
    link = path[i]->child_link_name;
  }
}

/// The joint nearest to the tip that no inertia resists, according to the pivots of M from its last
/// row up at an ordinary position; -1 if there is none.
int unresisted_joint(const RobotModel& model, double phase) {
  const int n = model.dof();
  JointVector q(n);
  for (int i = 0; i < n; ++i) q[i] = std::sin(phase + 1.7 * i);
  JointMatrix M = evaluate(model, q, JointVector::Zero(n)).M;
  for (int i = 0; i < n; ++i) {  // behind an elastic gear the motor resists no link
    const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    if (joint.elastic()) M(i, i) -= joint.reflected_inertia;
  }
  double scale = M.diagonal().maxCoeff();  // of the numbers whose rounding errors count
  for (const KDL::Segment& segment : kdl_chain(model).segments) {
    const KDL::RigidBodyInertia& body = segment.getInertia();
    scale = std::max(scale, body.getMass() * KDL::dot(body.getCOG(), body.getCOG()));
  }
  const double floor = 1e-13 * scale;
  for (int i = n - 1; i >= 0; --i) {
    if (!(M(i, i) > floor)) return i;
    const JointVector column = M.col(i).head(i);
    M.topLeftCorner(i, i) -= column * column.transpose() / M(i, i);
  }
  return -1;
}

/// Throws unless each joint moves a mass or has a reflected inertia.
void check_inertia(const RobotModel& model, const std::string& name) {
  if (unresisted_joint(model, 1.0) < 0) return;
  const int i = unresisted_joint(model, 2.5);
  if (i < 0) return;
  refuse(name, "joint", model.joints()[static_cast<std::size_t>(i)].name,
         "no inertia resists it: the links it moves lack mass, and it has no reflected inertia" +
             std::string(model.joints()[static_cast<std::size_t>(i)].elastic()
                             ? " on this side of its gear"
                             : ""));
}

}  // namespace

RobotModel RobotModel::from_urdf_text(const std::string& text, const std::string& base,
                                      const std::string& tip, const ModelOptions& options,
                                      const std::string& name) {
  const UrdfTree read = read_urdf(text, name);
  const urdf::ModelInterface* const tree = read.model.get();
  for (const std::string& link : options.accept_inertias_of) {
    if (!tree->getLink(link)) {
      refuse(name, "link", link,
             "there is none whose inertia to accept; " + links_near(link, *tree));
    }
  }
  const auto path = path_between(*tree, base, tip, name);
  std::vector<Joint> joints = read_joints(path, read, options, name);
  if (joints.empty()) refuse(name, "link", tip, "no joint moves it against '" + base + "'");
  if (joints.size() > static_cast<std::size_t>(kMaxJoints)) {
    refuse(name, "link", tip,
           std::to_string(joints.size()) + " joints from '" + base + "', more than " +
               std::to_string(kMaxJoints));
  }
  const Attachment attachment = attached(options, name);
  if (!options.gravity.allFinite()) throw InvalidModel(name + ": gravity: not finite");

  auto data = std::make_shared<Data>();
  data->name = tree->getName();
  data->base = base;
  data->tip = tip;
  const std::vector<MovedLink> moved = make_chain(*tree, path, joints, options, *data);
  check_links(moved, options, data->chain, name, data->warnings);
  doubt_base(*tree, base, path, data->warnings);
  doubt_limits(path, data->warnings);
  doubt_turns(path, read, data->warnings);
  const KDL::Chain bare = data->chain;
  data->attach(attachment);
  data->joints = std::move(joints);
  data->position_sensor = options.position_sensor;
  const KDL::Vector g = rotation_of_base(*tree, base).Inverse(to_kdl(options.gravity));
  data->gravity = {g.x(), g.y(), g.z()};
  RobotModel model(data);
  check_inertia(model, name);
  doubt_units(model, moved, bare, data->warnings);
  return model;
}

RobotModel RobotModel::with(const Attachment& attachment) const {
  auto data = std::make_shared<Data>(*data_);
  data->attach(attachment);
  RobotModel model(std::move(data));
  check_inertia(model, name());
  return model;
}

RobotModel RobotModel::with_reflected_inertia(const JointVector& inertia) const {
  auto data = std::make_shared<Data>(*data_);
  data->chain = KDL::Chain();
  for (unsigned i = 0; i < data_->chain.getNrOfSegments(); ++i) {
    KDL::Segment segment = data_->chain.getSegment(i);
    if (i < data->joints.size()) {
      const KDL::Joint& joint = segment.getJoint();
      const double own = inertia[static_cast<Eigen::Index>(i)];
      data->joints[i].reflected_inertia = own;
      segment = KDL::Segment(segment.getName(),
                             KDL::Joint(joint.getName(), joint.JointOrigin(), joint.JointAxis(),
                                        joint.getType(), 1, 0, own),
                             segment.pose(0), segment.getInertia());
    }
    data->chain.addSegment(segment);
  }
  RobotModel model(std::move(data));
  check_inertia(model, name());
  return model;
}

RobotModel RobotModel::from_urdf_file(const std::string& path, const std::string& base,
                                      const std::string& tip, const ModelOptions& options) {
  return from_urdf_text(read_urdf_file(path), base, tip, options, path);
}

}  // namespace dashpot::controller
