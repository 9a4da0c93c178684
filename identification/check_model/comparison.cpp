#include <dashpot/identification/check_model.hpp>
#include <dashpot/identification/check_model/joint_order.hpp>
#include <dashpot/identification/check_model/torque_fit.hpp>
#include <dashpot/text/printable.hpp>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

namespace dashpot::identification {
namespace {

constexpr Index kFewestWindows = 20;  // fewer leave no degrees of freedom for the deviations
/// Two in the sum of logarithms is a seventh of the variance at one joint.
constexpr double kMuchBetter = 2;
constexpr double kMuchLeft = 0.05;  // of a joint's largest torque

void check_sizes(const std::vector<TorqueRecord>& records, Index n) {
  if (records.empty()) throw std::invalid_argument("no records");
  for (const TorqueRecord& record : records) {
    const Index N = record.time.size();
    if (record.position.rows() != n || record.torque.rows() != n || record.position.cols() != N ||
        record.torque.cols() != N) {
      throw std::invalid_argument("positions and torques have to be " + std::to_string(n) +
                                  " rows of as many samples as there are times");
    }
    for (Index i = 0; i < N; ++i) {
      const bool rises = i == 0 || record.time[i] > record.time[i - 1];
      if (!std::isfinite(record.time[i]) || !rises) {
        throw std::invalid_argument("times have to be finite and to rise (sample " +
                                    std::to_string(i + 1) + ")");
      }
    }
    if (N == 0) throw std::invalid_argument("a record without samples");
  }
}

/// s of motion in so many windows.
double seconds(Index windows, const WeakForm& form) {
  return static_cast<double>(windows) * form.width() / 2;
}

void check_length(const WeakForm& form, const RecordFilter& how) {
  if (form.count() >= kFewestWindows) return;
  throw std::invalid_argument(
      text::number(seconds(form.count(), form), 2) + " s without gaps, need " +
      text::number(seconds(kFewestWindows, form), 2) + " s or more (samples every " +
      text::number(how.half_width / 4.5, 2) + " s or closer)");
}

/// Smoothed records, and the fit of a model to them.
struct Comparison {
  Comparison(const controller::RobotModel& model, const std::vector<TorqueRecord>& records,
             const RecordFilter& how, const ModelCheckOptions& options)
      : runs(smooth(records, how)), form(runs, how), fit(model, runs, how, form, options) {}
  Comparison(const Comparison&) = delete;
  Comparison& operator=(const Comparison&) = delete;
  ~Comparison() = default;

  std::vector<SmoothRun> runs;
  WeakForm form;
  TorqueFit fit;
};

/// Shifts the torques by the delay that was found and fits again, until no delay is left.
std::unique_ptr<Comparison> take_delay(const controller::RobotModel& model,
                                       const std::vector<TorqueRecord>& records, RecordFilter how,
                                       const ModelCheckOptions& options, TorqueKind kind,
                                       std::unique_ptr<Comparison> last) {
  constexpr double kLongest = 0.1;  // s: a longer delay means another motion
  for (int round = 0; round < 4 && !last->fit.delay_is_taken(); ++round) {
    how.torque_delay = last->fit.delay();
    if (std::abs(how.torque_delay) > kLongest) break;
    auto next = std::make_unique<Comparison>(model, records, how, options);
    if (next->form.count() < kFewestWindows) break;
    next->fit.fit(kind);
    last = std::move(next);
  }
  return last;
}

/// Returns the robot as it hangs from a ceiling or at a wall, if whole torques then fit far better
/// than `best`.
std::optional<controller::RobotDescription> hung(const controller::RobotDescription& robot,
                                                 const Comparison& upright, const RecordFilter& how,
                                                 const ModelCheckOptions& options, double best) {
  std::optional<controller::RobotDescription> found;
  double least = best - kMuchBetter;
  for (int k = 0; k < 6; ++k) {
    controller::RobotDescription other = robot;
    other.options.gravity =
        (k < 3 ? 1 : -1) * robot.options.gravity.norm() * Eigen::Vector3d::Unit(k % 3) +
        Eigen::Vector3d::Zero();  // no zero with a sign
    const controller::RobotModel hanging = other.model();
    TorqueFit there(hanging, upright.runs, how, upright.form, options);
    const double score = there.fit_inclined(other);
    if (score < least) least = score, found = other;
  }
  return found;
}

/// Whether gravity, which changed by `moved` of its size, has settled.
bool settled(double moved, double deviation, int tilts) {
  // A direction along an axis counts as exact unless the torques contradict it.
  constexpr double kSmallTilt = 0.005, kSettled = 1e-3;  // rad
  return moved < (tilts > 1 ? kSettled : std::max(kSmallTilt, 4 * deviation));
}

/// The kind of torques with a far smaller residual than whole ones; `best` becomes its misfit.
TorqueKind best_kind(TorqueFit& fit, double& best) {
  TorqueKind found = TorqueKind::kWhole;
  for (const TorqueKind kind : {TorqueKind::kWithoutGravity, TorqueKind::kExternal}) {
    const double score = fit.fit(kind);
    if (best - score > kMuchBetter) best = score, found = kind;
  }
  return found;
}

/// check_model for a robot whose gravity was changed so many times already; its direction is free
/// then.
ModelCheck compare(const controller::RobotDescription& robot,
                   const std::vector<TorqueRecord>& records, const ModelCheckOptions& options,
                   int tilts) {
  const controller::RobotModel model = robot.model();
  check_sizes(records, model.dof());
  const RecordFilter how = choose_smoothing(records);
  auto comparison = std::make_unique<Comparison>(model, records, how, options);
  const WeakForm& form = comparison->form;
  check_length(form, how);
  ModelCheck check;
  check.window = form.width();
  check.used = seconds(form.count(), form);
  check.validation = options.validation * check.used;
  TorqueFit& fit = comparison->fit;
  if (!fit.moves.any()) throw std::invalid_argument("no joint moves by more than its noise");
  double best = fit.fit_inclined(robot);
  if (tilts == 0) check.kind = best_kind(fit, best);
  fit.fit(check.kind);
  if (tilts == 0 && (check.kind != TorqueKind::kWhole || fit.most_left() > kMuchLeft)) {
    if (const auto other = hung(robot, *comparison, how, options, best)) {
      ModelCheck there = compare(*other, records, options, 1);
      if (there.order.empty()) return there;
    }
  }
  const JointOrder order = find_order(model, comparison->runs, how);
  if (tilts < 2 && !order.joints().empty()) {
    // Only with a payload is it certain that no payload is the reason.
    const std::vector<SmoothRun> changed = order.apply(comparison->runs);
    const WeakForm changed_form(changed, how);
    TorqueFit ordered(model, changed, how, changed_form, options);
    if (best - ordered.fit(order.kind) > kMuchBetter) {
      check.kind = order.kind;
      check.order = order.changes();
      fit.fit(check.kind);
    }
  }
  if (check.order.empty()) {
    comparison = take_delay(model, records, how, options, check.kind, std::move(comparison));
  }
  const auto gravity = explain(comparison->fit, robot, tilts > 0, check);
  report(comparison->fit, check);
  if (gravity && gravity->allFinite()) {
    const Eigen::Vector3d& before = robot.options.gravity;
    const double moved = (*gravity - before).norm() / before.norm();
    constexpr int kMostTilts = 6;
    if (tilts == 0 || (tilts < kMostTilts && !settled(moved, check.gravity_deviation, tilts))) {
      controller::RobotDescription tilted = robot;
      tilted.options.gravity = *gravity;
      return compare(tilted, records, options, std::max(2, tilts + 1));
    }
    check.gravity = tilts > 1 ? *gravity : before;
    check.gravity_fits =
        comparison->fit.most_left() <= kMuchLeft ||
        std::all_of(check.joints.begin(), check.joints.end(),
                    [](const JointCheck& joint) { return joint.suspicious.empty(); });
  }
  if (check.order.empty()) return check;
  for (const Index j : order.joints()) {
    check.joints[static_cast<std::size_t>(j)].suspicious =
        "its columns look exchanged or turned around";
  }
  return check;
}

}  // namespace

ModelCheck check_model(const controller::RobotDescription& robot,
                       const std::vector<TorqueRecord>& records, const ModelCheckOptions& options) {
  return compare(robot, records, options, 0);
}

}  // namespace dashpot::identification
