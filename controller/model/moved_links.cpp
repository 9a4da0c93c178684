#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/controller/model/moved_links.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace dashpot::controller {
namespace {

constexpr double kNegligible = 1e-6;  // share of the chain
constexpr std::size_t kShownLinks = 10;

std::string figure(double value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.4g", value);
  return text.data();
}

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

/// Far out, as the distances of joints and centres of mass add up, m.
double reach_of(const RobotModel& model) {
  double reach = 0;
  for (const KDL::Segment& segment : kdl_chain(model).segments) {
    reach += segment.getFrameToTip().p.Norm() + segment.getInertia().getCOG().Norm();
  }
  for (const Joint& joint : model.joints()) {
    const double range = joint.upper - joint.lower;
    if (joint.type == JointType::kPrismatic && std::isfinite(range)) reach += range;
  }
  return reach;
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
    warnings.push_back(one_line(quoted(link->body.link) + ": its mass, " + figure(mass) +
                                " kg, is " + figure(share) +
                                " times that of an ordinary link of this arm" +
                                (share > 1 ? ": is it in g?" : ": is it in kg?")));
  }
}

void doubt_inertias(const RobotModel& model, const std::vector<MovedLink>& links,
                    std::vector<std::string>& warnings) {
  const double reach = reach_of(model), most = std::max(3 * reach, 3.0);
  double moments = 0;
  for (const KDL::Segment& segment : kdl_chain(model).segments) {
    moments += half_trace(segment.getInertia());
  }
  for (const MovedLink& link : links) {
    const double mass = link.body.body.getMass();
    if (!(link.body.moment > mass * most * most) || link.body.moment < 1e-3 * moments) continue;
    warnings.push_back(one_line(quoted(link.body.link) + ": its inertia, " +
                                figure(link.body.moment) + " kg m^2, with its mass, " +
                                figure(mass) +
                                " kg, is that of a body larger than the arm, whose " +
                                "links add up to " + figure(reach) + " m: is it in kg m^2?"));
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
  warnings.push_back(
      one_line((carried ? "payload: its mass, " + figure(payload) + " kg, and the"
                        : quoted(link->body.link) + ": its mass, " +
                              figure(link->body.body.getMass()) + " kg, and the other") +
               " links that joint '" + joint.name + "' moves take " + figure(weight[worst]) + unit +
               " to hold, " + figure(weight[worst] / joint.effort) + " times the effort limit, " +
               figure(joint.effort) + unit + (carried ? ": is it in g" : ": are masses in g") +
               ", or is the limit not in" + unit + "?"));
}

}  // namespace

void check_links(const std::vector<MovedLink>& links, const ModelOptions& options,
                 const KDL::Chain& chain, const std::string& name,
                 std::vector<std::string>& warnings) {
  double mass = 0, moments = 0;  // of the chain
  for (const KDL::Segment& segment : chain.segments) {
    mass += segment.getInertia().getMass();
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
    if (own.possible && own.body.getMass() < kNegligible * mass &&
        own.moment < kNegligible * moments) {
      warnings.push_back(one_line(quoted(own.link) + ": " + own.problem +
                                  "; its share of the arm is below 1e-6, and cannot matter"));
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
                 std::vector<std::string>& warnings) {
  doubt_masses(model, links, warnings);
  doubt_inertias(model, links, warnings);
  doubt_weight(model, links, warnings);
}

}  // namespace dashpot::controller
