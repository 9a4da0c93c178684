#include <dashpot/identification/check_model/torque_fit.hpp>
#include <dashpot/identification/check_model/weak_form.hpp>
#include <dashpot/text/printable.hpp>

#include <Eigen/Eigenvalues>
#include <cmath>

namespace dashpot::identification {
namespace {

constexpr double kKnownRotor = 0.04;  // deviation of a determined rotor, over it

Estimate estimate(const TorqueFit& fit, Index i, double scale) {
  Estimate one;
  one.value = fit.result.value[i];
  if (fit.unseen(i)) return one;
  one.deviation = std::sqrt(fit.variance(i));
  one.determined = one.deviation < std::max(0.5 * std::abs(one.value), 0.02 * scale);
  return one;
}

/// All of a joint's rotor.
Estimate rotor_estimate(const TorqueFit& fit, Index j) {
  const Index i = fit.rotor(j);
  Estimate one;
  one.value = fit.joint(j).reflected_inertia + fit.result.value[i];
  if (fit.unseen(i) || fit.linear.prior[i] == kHeld) return one;
  one.deviation = std::sqrt(fit.variance(i));
  one.determined = one.deviation < kKnownRotor * one.value;
  return one;
}

/// Returns the undetermined parameters of joint j, and the motion that would determine them.
std::string wanted(const TorqueFit& fit, Index j, const JointCheck& joint) {
  std::string all;
  const Estimate& rotor = joint.reflected_inertia;
  if (fit.linear.prior[fit.rotor(j)] == kHeld) {
    add_reason(all, "reflected inertia: move it without a payload, or with a known one");
  } else if (!rotor.determined && rotor.value > 3 * rotor.deviation) {
    add_reason(all, "reflected inertia: accelerate " +
                        text::number(rotor.deviation / (kKnownRotor * rotor.value), 2) +
                        " times as much");
  } else if (!rotor.determined) {
    add_reason(all, "reflected inertia, below " +
                        text::number(std::max(0.0, rotor.value) + 2 * rotor.deviation, 2) +
                        fit.inertia_unit(j) + ": accelerate more");
  }
  if (!joint.coulomb_friction.determined || !joint.viscous_friction.determined) {
    add_reason(all, "friction: turn it both ways, slowly and fast");
  }
  if (!joint.offset.determined) add_reason(all, "offset: move it at other postures of all joints");
  return all;
}

/// Validates joint j on the validation part.
void validate(const TorqueFit& fit, Index j, JointCheck& joint) {
  std::vector<Index> kept;
  double mean = 0, all = 0, before = 0, after = 0, neighbours = 0, last = 0;
  for (Index k = 0; k < fit.K; ++k) {
    const bool validates = fit.purpose[static_cast<std::size_t>(k)] == Purpose::kValidation;
    if (!validates || !(fit.turning(j, k) > 0)) continue;
    kept.push_back(k);
    mean += fit.torque(j, k);
  }
  mean /= std::max(1.0, static_cast<double>(kept.size()));
  const controller::Joint& model = fit.joint(j);
  for (const Index k : kept) {
    const Index row = k * fit.n + j;
    const double was = fit.linear.y[row] - fit.linear.A(row, 3 * j + 1) * model.coulomb_friction -
                       fit.linear.A(row, 3 * j + 2) * model.viscous_friction;
    const double left = fit.result.residual[row];
    all += std::pow(fit.torque(j, k) - mean, 2);
    before += was * was;
    after += left * left;
    neighbours += left * last;
    last = left;
  }
  if (!(all > 0)) return;
  joint.explained_before = std::max(0.0, 1 - before / all);
  joint.explained_after = std::max(0.0, 1 - after / all);
  joint.correlation = after > 0 ? neighbours / after : 0;
}

void report_moving(const TorqueFit& fit, Index j, JointCheck& joint) {
  joint.residual_before = fit.rms(fit.linear.y, fit.result, j);
  joint.residual_after = fit.rms(fit.result.residual, fit.result, j);
  joint.offset = estimate(fit, 3 * j, fit.largest[j]);
  joint.coulomb_friction = estimate(fit, 3 * j + 1, fit.largest[j]);
  joint.viscous_friction = estimate(fit, 3 * j + 2, fit.largest[j]);
  joint.reflected_inertia = rotor_estimate(fit, j);
  joint.wanted = wanted(fit, j, joint);
  validate(fit, j, joint);
}

/// Reports a joint that hardly moves: an offset alone, which may contain static friction.
void report_resting(const TorqueFit& fit, Index j, JointCheck& joint) {
  VectorXd rest(fit.K), left(fit.K);
  const Index shared = fit.linear.A.cols() - fit.payload();
  for (Index k = 0; k < fit.K; ++k) {
    const Index row = k * fit.n + j;
    rest[k] = fit.linear.y[row];
    left[k] = rest[k] - fit.linear.A.row(row).tail(shared).dot(fit.result.value.tail(shared));
  }
  const auto count = static_cast<double>(fit.K);
  joint.residual_before = std::sqrt(rest.squaredNorm() / count);
  joint.offset.value = left.mean();
  joint.residual_after = std::sqrt((left.array() - left.mean()).matrix().squaredNorm() / count);
  joint.wanted = "nothing: turn it both ways, faster than it did";
}

void report_payload(const TorqueFit& fit, PayloadCheck& payload) {
  const controller::Attachment& before = fit.model.attachment();
  const Index first = fit.payload();
  const double mass = before.mass + fit.result.value[first];
  const Eigen::Vector3d moment = before.first_moment + fit.result.value.segment<3>(first + 1);
  const Eigen::MatrixXd& covariance = fit.result.covariance;
  payload.mass.value = mass;
  if (fit.unseen(first)) return;
  payload.mass.deviation = std::sqrt(fit.variance(first));
  payload.mass.determined =
      fit.spread.size() == 0 &&
      payload.mass.deviation < std::max(0.01 * fit.moved_mass(), 0.1 * std::abs(mass));
  for (Index i = 0; i < 3; ++i) {
    Estimate& one = payload.center[static_cast<std::size_t>(i)];
    const Index at = first + 1 + i;
    if (fit.unseen(at) || mass == 0) continue;
    one.value = moment[i] / mass;
    const double square = covariance(at, at) - 2 * one.value * covariance(at, first) +
                          one.value * one.value * covariance(first, first);
    one.deviation = std::sqrt(std::max(0.0, square)) / std::abs(mass);
    constexpr double kKnown = 0.03;  // m
    one.determined = mass > 3 * payload.mass.deviation && one.deviation < kKnown;
  }
}

/// Returns the model's body at the tip with what was found, which has a mass and an inertia that is
/// not negative; the model's if there is none.
controller::Attachment found_body(const TorqueFit& fit) {
  controller::Attachment body = fit.model.attachment();
  if (fit.unseen(fit.payload())) return body;
  for (Index i = 0; i < kPayloadColumns; ++i) {
    add_to_body(body, i, fit.result.value[fit.payload() + i]);
  }
  if (!(body.mass > 0)) return fit.model.attachment();
  const Eigen::Vector3d center = body.first_moment / body.mass;
  const Eigen::Matrix3d of_point = body.mass * (center.squaredNorm() * Eigen::Matrix3d::Identity() -
                                                center * center.transpose());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> about_center(body.inertia - of_point);
  body.inertia = of_point + about_center.eigenvectors() *
                                about_center.eigenvalues().cwiseMax(0).asDiagonal() *
                                about_center.eigenvectors().transpose();
  return body;
}

void report_delay(const TorqueFit& fit, Estimate& delay) {
  delay.value = fit.delay();
  if (fit.unseen(fit.rest_of_delay())) return;
  delay.deviation = std::sqrt(fit.variance(fit.rest_of_delay()));
  constexpr double kKnownDelay = 2.5e-4;  // s
  delay.determined = delay.deviation < std::max(kKnownDelay, 0.05 * std::abs(delay.value));
}

/// Windows in which two joints or more do not fit, one after the other.
void report_contacts(const TorqueFit& fit, std::vector<LeftOut>& contacts) {
  for (Index k = 0; k < fit.K; ++k) {
    int off = 0, used = 0;
    for (Index j = 0; j < fit.n; ++j) {
      const Index row = k * fit.n + j;
      if (!(fit.linear.used[row] > 0)) continue;
      ++used;
      // If the other residuals are a thousandth, a residual below a hundredth is not a contact yet.
      constexpr double kSmall = 0.01;
      const bool far = std::abs(fit.result.residual[row]) > kSmall * fit.largest[j];
      off += fit.result.weight[row] < 0.05 && far ? 1 : 0;
    }
    if (off < std::min(2, std::max(1, used))) continue;
    const WeakForm::Window& window = fit.form.windows()[static_cast<std::size_t>(k)];
    if (!contacts.empty() && contacts.back().record == window.record &&
        contacts.back().to >= window.from) {
      contacts.back().to = window.to;
    } else {
      contacts.push_back({window.record, window.from, window.to});
    }
  }
  // A single window is a joint that turns just then, more often than a touch.
  std::erase_if(contacts,
                [&fit](const LeftOut& one) { return one.to - one.from < 1.2 * fit.form.width(); });
}

}  // namespace

void report(const TorqueFit& fit, ModelCheck& check) {
  for (Index j = 0; j < fit.n; ++j) {
    JointCheck& joint = check.joints[static_cast<std::size_t>(j)];
    joint.moves = fit.moves[j];
    (joint.moves ? report_moving : report_resting)(fit, j, joint);
  }
  report_payload(fit, check.payload);
  report_delay(fit, check.delay);
  check.attachment = found_body(fit);
  const Index always = fit.rest_of_delay() + 1;
  check.covariance = fit.result.covariance.topLeftCorner(always, always);
  if (fit.spread.size() > 0) {
    check.covariance += fit.spread.head(always) * fit.spread.head(always).transpose();
  }
  if (check.order.empty()) report_suspicions(fit, check);
  report_ambiguities(fit, check);
  report_contacts(fit, check.contacts);
}

namespace {

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

namespace {

std::string list(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  }
  return text;
}

/// Whether parameter i is of a joint that rests.
bool rests(const TorqueFit& fit, Index i) {
  if (i < fit.payload()) return !fit.moves[i / 3];
  return i >= fit.rotor(0) && i < fit.rest_of_delay() && !fit.moves[i - fit.rotor(0)];
}

void report_unseen(const TorqueFit& fit, ModelCheck& check) {
  for (const auto direction : fit.result.unseen.colwise()) {
    std::vector<std::string> names;
    for (Index i = 0; i < direction.size(); ++i) {
      if (!rests(fit, i) && std::abs(direction[i]) > 0.2) names.push_back(fit.parameter_name(i));
    }
    if (names.empty()) continue;
    check.ambiguities.push_back(
        (names.size() == 1 ? "the records say nothing of " : "the records cannot tell apart ") +
        list(names));
  }
}

void report_alike(const TorqueFit& fit, ModelCheck& check) {
  const Eigen::MatrixXd& covariance = fit.result.covariance;
  const auto nuisance = [&fit](Index i) {
    return fit.linear.prior[i] == kHeld || (i >= fit.payload() + 4 && i < fit.rotor(0)) ||
           fit.unseen(i);
  };
  for (Index i = 0; i <= fit.rest_of_delay(); ++i) {
    for (Index k = i + 1; k <= fit.rest_of_delay(); ++k) {
      if (nuisance(i) || nuisance(k)) continue;
      const double correlation = covariance(i, k) / std::sqrt(covariance(i, i) * covariance(k, k));
      if (std::abs(correlation) < 0.97) continue;
      check.ambiguities.push_back("the records can hardly tell apart " + fit.parameter_name(i) +
                                  " and " + fit.parameter_name(k) + " (correlation " +
                                  text::fixed(correlation, 3) + ")");
    }
  }
}

}  // namespace

void report_ambiguities(const TorqueFit& fit, ModelCheck& check) {
  report_unseen(fit, check);
  for (Index j = 0; j < fit.n; ++j) {
    if (fit.moves[j]) continue;
    check.ambiguities.push_back("joint " + std::to_string(j + 1) +
                                " hardly moves: its friction is not known, and may be in its "
                                "offset");
  }
  report_alike(fit, check);
}

}  // namespace dashpot::identification
