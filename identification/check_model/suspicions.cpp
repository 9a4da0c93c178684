#include <dashpot/identification/check_model/findings.hpp>
#include <dashpot/text/printable.hpp>

#include <cmath>

namespace dashpot::identification {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Compares the rotor with the model's.
void doubt_rotor(const TorqueFit& fit, Index j, JointCheck& joint) {
  const Index i = fit.rotor(j);
  const double added = fit.result.value[i], deviation = joint.reflected_inertia.deviation;
  const VectorXd without = fit.result.residual + fit.linear.A.col(i) * added;
  const double old = fit.rms(without, fit.result, j);
  constexpr double kSmall = 0.005, kShare = 0.8, kClear = 4;
  if (!(std::abs(added) > kClear * deviation)) return;
  if (old < kSmall * fit.largest[j] || joint.residual_after > kShare * old) return;
  add_reason(joint.suspicious, "it looks as if its reflected inertia is " +
                                   beside_model(added, deviation, fit.inertia_unit(j)) +
                                   then_leaves(fit, j, joint.residual_after, old));
}

/// Compares the residual with the torque that varies with the motion.
void doubt_rest(const TorqueFit& fit, Index j, JointCheck& joint) {
  VectorXd varying = fit.torque.reshaped();
  double mean = 0, count = 0;
  for (Index row = j; row < varying.size(); row += fit.n) {
    const double weight = fit.linear.used[row] * fit.result.weight[row];
    mean += weight * varying[row];
    count += weight;
  }
  varying.array() -= count > 0 ? mean / count : 0;
  const double varies = fit.rms(varying, fit.result, j);
  constexpr double kMuch = 0.25;
  if (joint.residual_after > kMuch * varies && joint.suspicious.empty()) {
    joint.suspicious = text::number(joint.residual_after, 2) + " of " + text::number(varies, 2) +
                       fit.torque_unit(j) +
                       " of its torque's variation remain unexplained by model, friction, offset "
                       "and payload";
  }
}

void doubt(const TorqueFit& fit, Index j, JointCheck& joint) {
  // Friction that is large for the joint: a torque, and a torque for a velocity.
  const double largest = fit.largest[j];
  const double fastest = fit.linear.A.col(3 * j + 2).cwiseAbs().maxCoeff();
  const auto doubt_friction = [&](const char* name, const Estimate& one, double scale) {
    if (one.value < -4 * one.deviation && -one.value > 0.02 * scale) {
      add_reason(joint.suspicious,
                 std::string("its ") + name +
                     " friction is negative: the torque does not belong to this motion, or lags "
                     "behind it");
    }
  };
  doubt_friction("Coulomb", joint.coulomb_friction, largest);
  doubt_friction("viscous", joint.viscous_friction, fastest > 0 ? largest / fastest : 0);
  doubt_rotor(fit, j, joint);
  doubt_rest(fit, j, joint);
}

}  // namespace

void report_suspicions(const TorqueFit& fit, ModelCheck& check) {
  for (Index j = 0; j < fit.n; ++j) {
    if (fit.moves[j]) doubt(fit, j, check.joints[static_cast<std::size_t>(j)]);
  }
  const Estimate& mass = check.payload.mass;
  if (mass.value < -4 * mass.deviation && mass.value < -0.005 * fit.moved_mass()) {
    add_reason(check.joints.back().suspicious,
               "the payload that fits has a negative mass: the last links, or the payload of the "
               "configuration, weigh less than the model says");
  }
}

void add_reason(std::string& text, const std::string& reason) {
  text += (text.empty() ? "" : "; ") + reason;
}

std::string beside_model(double value, double deviation, const std::string& unit) {
  return text::number(std::abs(value), 2) + " +- " + text::number(deviation, 2) + unit +
         (value > 0 ? " more" : " less") + " than the model says";
}

std::string then_leaves(const TorqueFit& fit, Index j, double now, double before) {
  return ": joint " + std::to_string(j + 1) + " then leaves " + text::number(now, 2) +
         " instead of " + text::number(before, 2) + fit.torque_unit(j) + " over";
}

}  // namespace dashpot::identification
