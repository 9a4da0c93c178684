#include <dashpot/controller/audit/stated_gains.hpp>
#include <dashpot/controller/contact_audit.hpp>
#include <dashpot/controller/dynamics.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

namespace dashpot::controller {
namespace {

using analysis::ContactLimit;
using analysis::Touch;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// The loop at a posture whose tip touches something.
class TouchingTip {
 public:
  TouchingTip(const Audit& audit, const JointVector& q, const ContactOptions& options)
      : options_(options),
        loop_(audit.at(q)),
        spectrum_(analysis::analyze(loop_.system, kZeroModes)) {
    require(audit.options().period > 0, "period: a loop needs one");
    for (const auto& [name, value] :
         {std::pair("damper", options.damping), {"mass", options.mass}}) {
      require(std::isfinite(value) && value >= 0,
              std::string(name) + ": must be finite and not negative");
    }
    robot_ = evaluate(audit.model(), q, JointVector::Zero(q.size()));
    mobility_ = Eigen::LLT<Eigen::MatrixXd>(robot_.M).solve(robot_.J.topRows<3>().transpose());
    mobility_ = (robot_.J.topRows<3>() * mobility_).eval();
    if (!options.direction) return;
    const Vector3d given = *options.direction;
    require(given.allFinite() && given.norm() > 0, "direction: has to be finite and not zero");
    require(moves(given.normalized()), "direction: the tip cannot move there at this posture");
  }

  const DynamicsResult& robot() const { return robot_; }
  const LoopAt& loop() const { return loop_; }
  const analysis::Spectrum<>& spectrum() const { return spectrum_; }

  /// Returns true if a force at the tip moves it in a direction.
  bool moves(const Vector3d& n) const {
    constexpr double kStuck = 1e-6;  // of the mobility in the three axes together
    return mobility(n) > kStuck * mobility_.trace();
  }
  /// Returns the acceleration of the tip in a direction from a force of 1 N there.
  double mobility(const Vector3d& n) const { return n.dot(mobility_ * n); }
  /// Returns a of x = a' q, in the loop's coordinates.
  VectorXd reach(const Vector3d& n) const {
    VectorXd a = VectorXd::Zero(loop_.system.dof());
    a.head(robot_.J.cols()) = robot_.J.topRows<3>().transpose() * n;
    return a;
  }
  Touch touch(const Vector3d& n) const {
    return {reach(n), options_.damping, options_.mass, options_.most};
  }
  ContactLimit limit(const Touch& touch, bool proved = false) const {
    return analysis::contact_limit(loop_.system, spectrum_, loop_.sampled, touch, proved);
  }

  /// Takes a direction with a smaller limit than the best so far. Returns whether it is smaller.
  bool take_if_worse(const Vector3d& n, ContactAt& best) const {
    if (!moves(n)) return false;
    constexpr double kNearLimit = 0.45;  // of the limit: the next step, of 2.25, is beyond it
    Touch here = touch(n);
    here.most = std::min(here.most, best.limit.stiffness);
    if (std::isfinite(best.limit.stiffness)) here.coarse = kNearLimit * best.limit.stiffness;
    const ContactLimit found = limit(here);
    if (!(found.stiffness < best.limit.stiffness)) return false;
    best = {n, found};
    return true;
  }

 private:
  static constexpr analysis::SpectrumOptions kZeroModes{
      .residual = analysis::SpectrumOptions::Residual::kWorking};  // bounds are not used here
  ContactOptions options_;
  LoopAt loop_;
  analysis::Spectrum<> spectrum_;
  DynamicsResult robot_;
  Eigen::MatrixXd mobility_;  ///< J_v M^-1 J_v', 3 x 3
};

ContactAt worst_of_thirteen(const TouchingTip& tip) {
  ContactAt best;
  best.limit.stiffness = std::numeric_limits<double>::infinity();
  std::vector<Vector3d> directions = contact_directions();
  std::sort(directions.begin(), directions.end(), [&](const Vector3d& a, const Vector3d& b) {
    return tip.mobility(a) > tip.mobility(b);  // the lightest first: others are then seen quickly
  });
  for (const Vector3d& n : directions) {
    if (best.direction.isZero() && tip.moves(n)) best.direction = n;
    tip.take_if_worse(n, best);
  }
  require(!best.direction.isZero(), "direction: the tip cannot move at this posture");
  return best;
}

/// Turns a direction as long as that lowers its limit.
void refine(const TouchingTip& tip, ContactAt& best) {
  constexpr double kFirst = 0.3, kLast = 0.01;  // rad
  constexpr int kTurns = 40;
  double step = kFirst;
  for (int turn = 0; turn < kTurns && step > kLast && std::isfinite(best.limit.stiffness); ++turn) {
    const Vector3d n = best.direction, u = n.unitOrthogonal(), v = n.cross(u);
    bool turned = false;
    for (const Vector3d& side : {u, v, Vector3d(-u), Vector3d(-v)}) {
      turned = turned || tip.take_if_worse((n + step * side).normalized(), best);
    }
    if (!turned) step *= 0.5;
  }
}

/// Returns the force in a direction at which the first joint reaches its limit, and by how much it
/// compresses the springs, whose compliance there is C' = a' K^+ a.
HeldForce held_force(const TouchingTip& tip, const JointVector& weight, const JointVector& effort,
                     const Vector3d& n) {
  HeldForce result{n, std::numeric_limits<double>::infinity(), -1, 0};
  const VectorXd a = tip.reach(n);
  bool unknown = false;
  for (Eigen::Index i = 0; i < weight.size(); ++i) {
    unknown = unknown || (a[i] != 0 && std::isinf(effort[i]));
    if (a[i] == 0 || std::isinf(effort[i])) continue;
    const double force =
        std::max(0.0, (effort[i] - std::copysign(1.0, a[i]) * weight[i]) / std::abs(a[i]));
    if (force < result.force) result.force = force, result.joint = static_cast<int>(i);
  }
  if (result.joint < 0 && unknown) result.force = std::numeric_limits<double>::quiet_NaN();
  const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> springs(
      tip.loop().system.stiffness);
  const VectorXd x = springs.solve(a);
  const bool sprung =
      !a.isZero(0) && (tip.loop().system.stiffness * x - a).norm() <= 1e-6 * a.norm();
  result.deflection = sprung ? result.force * a.dot(x) : std::numeric_limits<double>::infinity();
  return result;
}

}  // namespace

std::vector<Vector3d> contact_directions() {
  std::vector<Vector3d> directions;
  for (int i = 26; i > 13; --i) {  // (i - 13) and its negative are one direction
    const int second = i / 3 % 3, third = i / 9;
    directions.push_back((Vector3d(i % 3, second, third) - Vector3d::Ones()).normalized());
  }
  return directions;
}

ContactAt find_contact(const Audit& audit, const JointVector& q, const ContactOptions& options) {
  const TouchingTip tip(audit, q, options);
  if (!options.direction) return worst_of_thirteen(tip);
  const Vector3d n = options.direction->normalized();
  return {n, tip.limit(tip.touch(n))};
}

ContactAudit audit_contact(const Audit& audit, const JointVector& q,
                           const ContactOptions& options) {
  const TouchingTip tip(audit, q, options);
  ContactAudit result;
  result.q = q;
  if (options.direction) {
    result.touch.direction = options.direction->normalized();
  } else {
    result.touch = worst_of_thirteen(tip);
    refine(tip, result.touch);
  }
  const Vector3d n = result.touch.direction;
  const Touch touch = tip.touch(n);
  result.touch.limit = tip.limit(touch, true);

  Touch changed = touch;
  changed.stiffness_share = 0.5;
  result.with_half_stiffness = tip.limit(changed).stiffness;
  changed = touch;
  changed.damping_share = 1.5;
  result.with_more_damping = tip.limit(changed).stiffness;
  result.with_less_delay = std::numeric_limits<double>::quiet_NaN();
  if (analysis::SampledLoop early = tip.loop().sampled; early.delay > 0) {
    --early.delay;
    result.with_less_delay =
        analysis::contact_limit(tip.loop().system, tip.spectrum(), early, touch, false).stiffness;
  }
  result.passivity = analysis::port_passivity(tip.loop().system, tip.loop().sampled);
  result.weight = tip.robot().gravity;
  result.effort = audit.model().joint_values(&Joint::effort);
  for (const Vector3d& side :
       {n, Vector3d(-n), Vector3d(1, 0, 0), Vector3d(-1, 0, 0), Vector3d(0, 1, 0),
        Vector3d(0, -1, 0), Vector3d(0, 0, 1), Vector3d(0, 0, -1)}) {
    result.forces.push_back(held_force(tip, result.weight, result.effort, side));
  }
  return result;
}

std::vector<analysis::ContactPoint> contact_curve(const Audit& audit, const JointVector& q,
                                                  const ContactOptions& options,
                                                  const std::vector<double>& stiffness) {
  require(options.direction.has_value(), "direction: a curve needs one");
  const TouchingTip tip(audit, q, options);
  return analysis::contact_curve(tip.loop().system, tip.spectrum(), tip.loop().sampled,
                                 tip.touch(options.direction->normalized()), stiffness);
}

}  // namespace dashpot::controller
