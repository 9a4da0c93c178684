#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/controller/model/moved_links.hpp>
#include <dashpot/text/printable.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace dashpot::controller {
namespace {

/// Share of the chain's moments of inertia that cannot matter: it changes frequencies by half as
/// much.
constexpr double kNegligible = 1e-4;
constexpr std::size_t kShownLinks = 10;

std::string quoted(const std::string& link) {
  return "link '" + link + "'";
}

double half_trace(const KDL::RigidBodyInertia& body) {
  const KDL::RotationalInertia I = body.getRotationalInertia();
  return 0.5 * std::abs(I.data[0] + I.data[4] + I.data[8]);
}

/// Returns the heaviest link of these joints; null if there is none.
const MovedLink* heaviest(const std::vector<MovedLink>& links, int first_joint, int last_joint) {
  const MovedLink* found = nullptr;
  for (const MovedLink& link : links) {
    if (link.joint < first_joint || link.joint > last_joint) continue;
    if (!found || link.body.body.getMass() > found->body.body.getMass()) found = &link;
  }
  return found;
}

/// Largest torque of the weight at some postures within the limits.
JointVector largest_weight(const RobotModel& model) {
  constexpr int kPostures = 16;
  const int n = model.dof();
  JointVector most = JointVector::Zero(n), q(n);
  for (int k = 0; k < kPostures; ++k) {
    for (int i = 0; i < n; ++i) {
      const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
      const double wave = std::sin(0.9 * k + 1.7 * i * (k + 1));
      const double middle = 0.5 * (joint.lower + joint.upper);
      q[i] = std::isfinite(middle) ? middle + 0.5 * (joint.upper - joint.lower) * wave : 3 * wave;
    }
    most = most.cwiseMax(evaluate(model, q, JointVector::Zero(n)).gravity.cwiseAbs());
  }
  return most;
}

void doubt_masses(const RobotModel& model, const std::vector<MovedLink>& links,
                  std::vector<std::string>& warnings) {
  constexpr double kTimes = 300, kPart = 1e-3;  // beyond what arms have
  std::vector<double> masses;
  for (int i = 0; i < model.dof(); ++i) {
    const double mass =
        kdl_chain(model).getSegment(static_cast<unsigned>(i)).getInertia().getMass();
    if (mass > 0) masses.push_back(mass);
  }
  if (masses.size() < 3) return;
  std::nth_element(masses.begin(), masses.begin() + static_cast<std::ptrdiff_t>(masses.size() / 2),
                   masses.end());
  const double middle = masses[masses.size() / 2];
  for (int i = 0; i < model.dof(); ++i) {
    const MovedLink* link = heaviest(links, i, i);
    if (!link) continue;
    const double mass = link->body.body.getMass(), share = mass / middle;
    if (mass == 0 || (share < kTimes && share > kPart)) continue;
    warnings.push_back(one_line(quoted(link->body.link) + ": its mass, " + text::number(mass, 4) +
                                " kg, is " + text::number(share, 4) +
                                " times the mass of an ordinary link of this arm" +
                                (share > 1 ? ": is it in g?" : ": is it in kg?")));
  }
}

void doubt_inertias(const RobotModel& model, const std::vector<MovedLink>& links, double reach,
                    std::vector<std::string>& warnings) {
  const double most = std::max(3 * reach, 3.0);
  double moments = 0;
  for (const KDL::Segment& segment : kdl_chain(model).segments) {
    moments += half_trace(segment.getInertia());
  }
  for (const MovedLink& link : links) {
    const double mass = link.body.body.getMass();
    if (!(link.body.moment > mass * most * most) || link.body.moment < 1e-3 * moments) continue;
    warnings.push_back(
        one_line(quoted(link.body.link) + ": its inertia, " + text::number(link.body.moment, 4) +
                 " kg m^2, with its mass, " + text::number(mass, 4) +
                 " kg, fits a body larger than the arm, whose " + "links add up to " +
                 text::number(reach, 4) + " m: is it in kg m^2?"));
  }
}

/// Returns the median of the sizes that the links' masses and inertias have, m; negative for fewer
/// than three links.
double middle_size(const std::vector<MovedLink>& links) {
  std::vector<double> sizes;
  for (const MovedLink& link : links) {
    const double mass = link.body.body.getMass();
    if (mass > 0) sizes.push_back(std::sqrt(link.body.moment / mass));
  }
  if (sizes.size() < 3) return -1;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle;
}

/// Doubts a tool, a payload and inertias that are large beside the reach of the arm, m.
void doubt_sizes(const RobotModel& model, const std::vector<MovedLink>& links, double reach,
                 std::vector<std::string>& warnings) {
  constexpr double kArm = 0.5;     // m: a smaller arm may carry things as large as this
  constexpr double kMiddle = 0.5;  // of the reach
  constexpr double kLeast = 1e-3;  // likewise
  const std::string beside = " m, the arm reaches " + text::number(reach, 4) + " m: ";
  const auto doubt = [&](const std::string& what, double size, const char* question) {
    if (size > std::max(reach, kArm))
      warnings.push_back(what + text::number(size, 4) + beside + question);
  };
  const Attachment& attached = model.attachment();
  const Payload payload = attached.payload();
  doubt("tool: its frame is off the tip link by ", attached.tool.position.norm(),
        "is tool.position in m?");
  doubt("payload: its centre is off the tip link by ", payload.center.norm(),
        "is payload.center in m?");
  if (payload.mass > 0) {
    doubt("payload: its mass and inertia fit a body of ",
          std::sqrt(0.5 * payload.inertia.trace() / payload.mass), "is its inertia in kg m^2?");
  }
  const double size = middle_size(links);
  if (size > kMiddle * reach || (size >= 0 && size < kLeast * reach)) {
    warnings.push_back("links: their masses and inertias fit bodies of " + text::number(size, 4) +
                       beside + "are inertias in kg m^2?");
  }
}

/// Doubts rotors heavier than the arm, and limits of joints that are hardly in rad.
void doubt_joints(const RobotModel& model, const std::vector<MovedLink>& links, double reach,
                  std::vector<std::string>& warnings) {
  constexpr double kTurn = 30;      // rad: five turns, as cables allow
  constexpr double kSpeed = 20;     // rad/s
  constexpr double kEffort = 1e4;   // N m
  constexpr int kArm = 4;           // joints that make an arm
  constexpr double kNoLimit = 1e6;  // what files write for no limit
  constexpr double kFriction = 2;   // times the effort limit, at the velocity limit
  constexpr double kRotors = 0.1;   // of the arm's mass at its reach, in kg m^2
  constexpr double kBare = 2e-4;    // kg m^2: if all rotors are below, they lack their gear ratios
  constexpr double kHeavy = 5;      // kg: in an arm of at least this mass
  double mass = model.attachment().mass;
  for (const MovedLink& link : links) mass += link.body.body.getMass();
  const auto doubt = [&](const Joint& joint, const std::string& what) {
    warnings.push_back(one_line("joint '" + joint.name + "': its " + what));
  };
  const auto limit = [&](const Joint& joint, double value, double most, const std::string& what) {
    if (value > most && value < kNoLimit) doubt(joint, "limit of " + what);
  };
  if (lacks_efforts(model)) {
    warnings.emplace_back(
        "joints: no joint has a limit of effort (0 means no limit): whether they hold the arm is "
        "unknown, and a controller needs limits.torque");
  } else if (model.dof() >= kArm) {
    std::string names;
    for (const Joint& joint : model.joints()) {
      if (std::isinf(joint.effort)) names += (names.empty() ? "" : ", ") + joint.name;
    }
    if (!names.empty()) {
      warnings.push_back(one_line("joints without a limit of effort (0 means no limit): " + names +
                                  ": a controller assumes 100 N m unless limits.torque is set"));
    }
  }
  const bool bare =
      mass > kHeavy && model.joint_values(&Joint::reflected_inertia).maxCoeff() < kBare;
  for (const Joint& joint : model.joints()) {
    if (joint.type == JointType::kPrismatic) continue;
    const double rotor = joint.reflected_inertia;
    const bool large = mass > 0 && rotor > kRotors * mass * std::max(1.0, reach * reach);
    if (large || (rotor > 0 && bare)) {
      doubt(joint, "reflected inertia, " + text::number(rotor, 4) +
                       " kg m^2, is hardly possible for an arm of " + text::number(mass, 4) +
                       " kg, " + text::number(reach, 4) + " m long: is it " +
                       (large ? "in kg m^2?"
                              : "the motor's, to be multiplied by the square of the gear ratio?"));
    }
    for (const auto& [kind, told, friction] :
         {std::tuple("viscous", joint.viscous_friction, joint.viscous_friction * joint.velocity),
          {"Coulomb", joint.coulomb_friction, joint.coulomb_friction}}) {
      if (!std::isfinite(friction) || friction <= kFriction * joint.effort) continue;
      doubt(joint, std::string(kind) + " friction, " + text::number(told, 4) + ", takes " +
                       text::number(friction, 4) + " N m, its effort limit is " +
                       text::number(joint.effort, 4) + " N m: is it in N m and N m s/rad?");
    }
    limit(joint, std::max(-joint.lower, joint.upper), kTurn,
          "position, " + text::number(joint.lower, 4) + " to " + text::number(joint.upper, 4) +
              " rad, is many turns: is it in deg?");
    limit(joint, joint.velocity, kSpeed,
          "velocity, " + text::number(joint.velocity, 4) +
              " rad/s, is hardly possible for an arm: is it in deg/s or rpm?");
    limit(joint, joint.effort, kEffort,
          "effort, " + text::number(joint.effort, 4) +
              " N m, is hardly possible for an arm: is it in N m?");
  }
}

/// Doubts joints that move no mass before the next joint does.
void doubt_massless(const RobotModel& model, std::vector<std::string>& warnings) {
  for (int i = 0; i < model.dof(); ++i) {
    const KDL::Segment& segment = kdl_chain(model).getSegment(static_cast<unsigned>(i));
    if (segment.getInertia().getMass() > 0) continue;
    const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    warnings.push_back(one_line(quoted(segment.getName()) + ", which joint '" + joint.name +
                                "' moves, has no mass: is its inertial missing?"));
  }
}

void doubt_weight(const RobotModel& model, const std::vector<MovedLink>& links,
                  std::vector<std::string>& warnings) {
  constexpr double kTimes = 10;  // what the joint can hold
  const JointVector weight = largest_weight(model);
  int worst = -1;
  for (int i = 0; i < model.dof(); ++i) {
    const double effort = model.joints()[static_cast<std::size_t>(i)].effort;
    if (!(weight[i] > kTimes * effort)) continue;
    if (worst < 0 ||
        weight[i] / effort > weight[worst] / model.joints()[static_cast<std::size_t>(worst)].effort)
      worst = i;
  }
  if (worst < 0) return;
  const Joint& joint = model.joints()[static_cast<std::size_t>(worst)];
  const MovedLink* link = heaviest(links, worst, model.dof() - 1);
  const double payload = model.attachment().mass;
  const bool carried = payload > (link ? link->body.body.getMass() : 0);
  if (!link && !carried) return;
  const char* unit = joint.type == JointType::kPrismatic ? " N" : " N m";
  warnings.push_back(one_line(
      (carried ? "payload: its mass, " + text::number(payload, 4) + " kg, and the"
               : quoted(link->body.link) + ": its mass, " +
                     text::number(link->body.body.getMass(), 4) + " kg, and the other") +
      " links that joint '" + joint.name + "' moves take " + text::number(weight[worst], 4) + unit +
      " to hold, " + text::number(weight[worst] / joint.effort, 4) + " times the effort limit, " +
      text::number(joint.effort, 4) + unit + (carried ? ": is it in g" : ": are masses in g") +
      ", or is the limit not in" + unit + "?"));
}

}  // namespace

double reach_of(const KDL::Chain& chain, const std::vector<Joint>& joints) {
  double reach = 0;
  for (const KDL::Segment& segment : chain.segments) {
    reach += segment.getFrameToTip().p.Norm() + segment.getInertia().getCOG().Norm();
  }
  for (const Joint& joint : joints) {
    const double range = joint.upper - joint.lower;
    if (joint.type == JointType::kPrismatic && std::isfinite(range)) reach += range;
  }
  return reach;
}

void check_links(const std::vector<MovedLink>& links, const ModelOptions& options,
                 const KDL::Chain& chain, const std::string& name,
                 std::vector<std::string>& warnings) {
  double moments = 0;  // of the chain
  for (const KDL::Segment& segment : chain.segments) {
    moments += half_trace(segment.getInertia());
  }
  std::string text;
  std::size_t faults = 0, acceptable = 0;
  for (const auto& [own, unused] : links) {
    if (own.problem.empty()) continue;
    const auto& names = options.accept_inertias_of;
    if (own.possible && (options.accept_inertias ||
                         std::find(names.begin(), names.end(), own.link) != names.end())) {
      continue;
    }
    if (own.possible && own.moment < kNegligible * moments) {
      warnings.push_back(one_line(quoted(own.link) + ": " + own.problem + "; it is " +
                                  text::number(own.moment / moments, 4) +
                                  " of the arm's inertia, and cannot matter"));
      continue;
    }
    if (own.possible) ++acceptable;
    if (++faults > kShownLinks) continue;
    text += (faults == 1 ? "" : "; ") + quoted(own.link) + ": " + own.problem;
  }
  if (faults == 0) return;
  if (faults > kShownLinks) text += "; and " + std::to_string(faults - kShownLinks) + " more links";
  if (acceptable > 0) {
    text += std::string("; robot.accept_inertias: true, or --accept-inertias, takes ") +
            (acceptable == 1 ? "it as it is" : "them as they are") +
            "; both take names of links as well";
  }
  throw InvalidModel(one_line(name + ": " + text));
}

void doubt_units(const RobotModel& model, const std::vector<MovedLink>& links,
                 const KDL::Chain& bare, std::vector<std::string>& warnings) {
  constexpr double kLongArm = 50;               // m
  constexpr double kGravity = 30, kWeak = 1.5;  // m/s^2: beyond the planets, below the Moon
  const double reach = reach_of(bare, model.joints());
  if (reach > kLongArm) {
    warnings.push_back("links: they add up to " + text::number(reach, 4) +
                       " m: are lengths in mm?");
    return;
  }
  const double gravity = model.gravity().norm();
  if (gravity > kGravity || (gravity > 0 && gravity < kWeak)) {
    warnings.push_back("gravity: " + text::number(gravity, 4) +
                       " m/s^2 fits no planet: is it in m/s^2?");
  }
  doubt_massless(model, warnings);
  doubt_joints(model, links, reach, warnings);
  doubt_sizes(model, links, reach, warnings);
  doubt_masses(model, links, warnings);
  doubt_inertias(model, links, reach, warnings);
  doubt_weight(model, links, warnings);
}

}  // namespace dashpot::controller
