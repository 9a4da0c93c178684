#pragma once
// The arms of sim/models on their way through the workspace, through the stretched singularity, and
// back, at 1 kHz, with their modes followed and watched.

#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/controller/base/impedance.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/elastic_joints.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/vibration/loop_system.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/constant_damping.hpp>

#include <cmath>
#include <memory>
#include <numbers>

namespace dashpot::testing {

/// Joint positions at the share t of the way, 0 to 1: every joint swings, and the elbow goes from
/// bent over stretched (at 0.25 and 0.75) to bent the other way, and back. Stretched arms are
/// singular: the Panda and the Baxter, whose links are offset, to 1e-4 or so, the others exactly.
inline controller::JointVector arm_way(const std::string& arm, double t) {
  const bool panda = arm == "panda", ur5 = arm == "ur5", baxter = arm == "baxter_left";
  const int elbow = ur5 ? 2 : 3;
  const double stretched = panda ? -0.447676721 : baxter ? 0.1672256 : 0;  // rad
  const double bent = panda || !(ur5 || baxter) ? -1.9 : 1.5;
  controller::JointVector q(ur5 ? 6 : 7);
  if (ur5) {
    q << 0.2, -1.1, 0, -1.3, 1.2, 0.3;
  } else if (baxter) {
    q << -0.3, -0.4, 0.2, 0, 0.3, 0.9, 0.2;
  } else {
    q << 0.1, 0.5, 0.2, 0, 0.3, 1.2, 0.4;
  }
  const double angle = 2 * std::numbers::pi * t;
  for (int i = 0; i < static_cast<int>(q.size()); ++i) {
    q[i] += 0.3 * (std::sin((1 + i % 3) * angle + i) - std::sin(i));
  }
  const double share = t == 0.25 || t == 0.75 ? 0 : std::cos(angle);
  q[elbow] = stretched + (bent - stretched) * share;
  return q;
}

/// Changes of an arm's default gains: what their damping is multiplied with, and the springs and
/// dampers of the null space, which are not there for 0.
struct GainScales {
  double damping = 1, null_space = 1;
};

/// The closed loop of an arm in the form in which the controller follows it.
class ArmLoop {
 public:
  ArmLoop(const controller::RobotModel& model, const GainScales& scales)
      : kernel_(model),
        elastic_(controller::elastic_joints(model)),
        friction_(model.joint_values(&controller::Joint::viscous_friction)),
        impedance_(model.dof()) {
    controller::Setpoint setpoint = constant_damping(model).initial;
    setpoint.mode = controller::Mode::kCartesian;
    setpoint.gains.task_damping *= scales.damping;
    setpoint.gains.null_stiffness *= scales.null_space;
    setpoint.gains.null_damping *= scales.damping * scales.null_space;
    impedance_ = controller::Impedance(setpoint, model.dof());
  }

  const analysis::System<analysis::kMaxDof>& at(const controller::JointVector& q) {
    kernel_.evaluate(q, controller::JointVector::Zero(q.size()), robot_);
    null_space_.compute(robot_, impedance_);
    loop_.form(robot_, impedance_, null_space_, friction_, system_);
    if (elastic_.any()) elastic_.extend_factored(system_);
    return system_;
  }

 private:
  controller::DynamicsKernel kernel_;
  analysis::Gears elastic_;
  controller::JointVector friction_;
  controller::Impedance impedance_;
  controller::NullSpace null_space_;
  controller::LoopSystem loop_;
  controller::DynamicsResult robot_;
  analysis::System<analysis::kMaxDof> system_;
};

/// Faults and oddities of a tick's modes.
struct ModeWatch {
  long modes = 0;      ///< compared with the modes of the tick before; soft ones are not
  long separated = 0;  ///< whose identity the eigenvalues alone decide
  long lost = 0;       ///< of these, those that were given another place
  long not_numbers = 0, bounds_missing = 0;
  double largest_change = 0;  ///< of a separated one's damping ratio from tick to tick
};

/// Follows the modes of one arm and compares each tick with the one before.
class WatchedArm {
 public:
  using System = analysis::System<analysis::kMaxDof>;

  WatchedArm(const controller::RobotModel& model, const GainScales& scales, std::string name)
      : name_(std::move(name)), loop_(model, scales), tracker_(options()) {}

  /// Up to the share t of the way.
  void step(double t) {
    before_ = now_;
    system_ = loop_.at(arm_way(name_, t));
    tracker_.update(system_, now_);
    if (ticks_++ > 0) compare();
  }

  const System& system() const { return system_; }
  const analysis::TrackedSpectrum& spectrum() const { return now_; }
  const analysis::TrackerCounters& counters() const { return tracker_.counters(); }
  const ModeWatch& watch() const { return watch_; }

 private:
  static analysis::TrackerOptions options() {
    analysis::TrackerOptions options;
    options.soft_frequency = 0.1;
    return options;
  }
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  void compare();
  /// Another place that holds what this mode was, as far as its eigenvalues tell.
  bool given_away(int i, bool& separated) const;

  std::string name_;
  ArmLoop loop_;
  analysis::ModeTracker tracker_;
  System system_;
  analysis::TrackedSpectrum now_, before_;
  ModeWatch watch_;
  long ticks_ = 0;
};

inline void WatchedArm::compare() {
  using analysis::ModeKind;
  if (now_.mode_count != before_.mode_count || now_.epoch != before_.epoch) return;
  for (int i = 0; i < now_.mode_count; ++i) {
    const analysis::ModeNumbers &was = before_.modes[at(i)], &is = now_.modes[at(i)];
    if (!std::isfinite(is.error_bound)) ++watch_.bounds_missing;
    if (was.kind == ModeKind::kSoft || is.kind == ModeKind::kSoft) continue;
    if (std::isnan(is.damping_ratio) || std::isnan(is.natural_frequency)) {
      ++watch_.not_numbers;
      continue;
    }
    ++watch_.modes;
    bool separated = false;
    const bool lost = given_away(i, separated);
    watch_.separated += separated ? 1 : 0;
    watch_.lost += lost ? 1 : 0;
    if (!separated) continue;
    const double change = std::abs(is.damping_ratio - was.damping_ratio);
    watch_.largest_change = std::max(watch_.largest_change, change);
  }
}

inline bool WatchedArm::given_away(int i, bool& separated) const {
  const analysis::Complex was = before_.modes[at(i)].eigenvalues[0];
  double nearest = 1e300, second = 1e300;
  int place = -1;
  for (int j = 0; j < now_.mode_count; ++j) {
    const double apart = std::abs(now_.modes[at(j)].eigenvalues[0] - was);
    if (apart < nearest) {
      second = nearest;
      nearest = apart;
      place = j;
    } else {
      second = std::min(second, apart);
    }
  }
  const bool real = was.imag() == 0 || now_.modes[at(place)].eigenvalues[0].imag() == 0;
  separated = !real && second > 4 * nearest;
  return separated && place != i;
}

}  // namespace dashpot::testing
