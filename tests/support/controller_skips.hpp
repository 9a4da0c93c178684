#pragma once
// Terms that the controller leaves out in some ticks, beside a controller that computes them.

#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/tests/support/constant_damping.hpp>
#include <dashpot/tests/support/hostile_ticks.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/skip_tally.hpp>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>

namespace dashpot::testing {

inline PlainModes plain_modes(const controller::Vibration& vibration) {
  return {vibration.modes.begin(), vibration.modes.begin() + vibration.count};
}

inline bool has_modes(const controller::Vibration& vibration) {
  return vibration.tick > 0 && (vibration.status == analysis::Status::kOk ||
                                vibration.status == analysis::Status::kUncertified);
}

/// Hostile input to controllers that analyse at every tick, now and then, without shapes, and not
/// at all: the torque is the same, and so are the modes.
class AnalysisSkips {
 public:
  using Where = controller::Analysis::Where;
  /// `on_a_thread`: there, too.
  AnalysisSkips(const controller::RobotModel& model, std::uint64_t seed, bool on_a_thread)
      : settings_(everything(model)),
        input_(model, settings_, seed, 0.02),
        full_(model, settings_) {
    const auto with = [&](const auto& change) {
      controller::Settings settings = settings_;
      change(settings.analysis);
      return std::make_unique<controller::Controller>(model, settings);
    };
    off_ = with([](auto& analysis) { analysis.where = Where::kOff; });
    rare_ = with([](auto& analysis) { analysis.every = kEvery; });
    plain_ = with([](auto& analysis) { analysis.shapes = false; });
    if (on_a_thread) thread_ = with([](auto& analysis) { analysis.where = Where::kBackground; });
  }

  void tick() {
    input_.next();
    full_.update(input_.state, input_.setpoint, torque_);
    for (const auto& other : {&off_, &rare_, &plain_, &thread_}) {
      if (!*other) continue;
      (*other)->update(input_.state, input_.setpoint, other_torque_);
      SkipTally& tally = other == &off_ ? off : other == &thread_ ? background : torque;
      tally.see_the_same(other_torque_, torque_);
      ++tally.left_out;
    }
    const controller::Vibration& modes = full_.vibration();
    if (modes.tick != full_.snapshot().tick || !has_modes(modes)) return;
    compare_bits(plain_modes(plain_->vibration()), plain_modes(modes), shapes);
    ++shapes.left_out;
    const controller::Vibration& rare = rare_->vibration();
    if (rare.tick != modes.tick) {
      ++every.left_out;
      return;
    }
    if (has_modes(rare))
      compare_bounded(plain_modes(rare), plain_modes(modes), modes.zero_modes, 0, every);
  }

  SkipTally off{"analysis off: torque"};
  SkipTally background{"analysis on a thread: torque"};
  SkipTally torque{"analysis in part: torque"};
  SkipTally shapes{"no shapes: modes in the tick"};
  SkipTally every{"modes every 7 ticks"};
  std::vector<const SkipTally*> tallies() const {
    return {&off, &background, &torque, &shapes, &every};
  }

 private:
  static constexpr int kEvery = 7;
  static controller::Settings everything(const controller::RobotModel& model) {
    controller::Settings settings = HostileTicks::everything_on(model);
    settings.analysis.every = 1;
    return settings;
  }

  controller::Settings settings_;
  HostileTicks input_;
  controller::Controller full_;
  std::unique_ptr<controller::Controller> off_, rare_, plain_, thread_;
  controller::JointVector torque_, other_torque_;
};

/// Two arms that are led through the same smooth motion, with halts, in which one joint after the
/// other makes a small step; what comes to one of them is changed so little that it cannot matter,
/// but enough that nothing may be left out.
struct LedPair {
  using Settings = controller::Settings;
  using Input = std::function<void(controller::RobotState&, controller::Setpoint&)>;

  LedPair(const controller::RobotModel& model, const Settings& of_lean, const Settings& of_full)
      : lean(model, quiet(of_lean), kSmallSwing), full(model, quiet(of_full), kSmallSwing) {}

  /// A halt in every other tenth of a second; `both` changes the input, `of_full` the second arm's
  /// alone.
  void tick(const Input& both, const Input& of_full) {
    const bool moves = ++ticks / 100 % 2 == 0;
    if (moves) t_ += 1e-3;
    for (LedArm* one : {&lean, &full}) {
      if (ticks % 10 == 0) one->center[ticks / 10 % one->center.size()] += 1e-5;
      one->swing(t_);
      if (!moves) one->state.velocity.setZero();
      both(one->state, one->setpoint);
      if (one == &full) of_full(one->state, one->setpoint);
      one->tick();
    }
  }
  /// The modes of the first, solved from nothing.
  const analysis::Spectrum<analysis::kMaxDof>& lean_anew() {
    lean.controller.closed_loop(system_);
    solver_.solve(system_, anew_);
    return anew_;
  }

  LedArm lean, full;
  std::int64_t ticks = 0;

 private:
  static Settings quiet(const Settings& settings) {
    return in_mode(without_limits(settings), controller::Mode::kCartesian);
  }

  analysis::System<analysis::kMaxDof> system_;
  analysis::SpectrumSolver<analysis::kMaxDof> solver_;
  analysis::Spectrum<analysis::kMaxDof> anew_;
  double t_ = 0;
};

/// Rounding errors of the loop's matrices, which are formed in another way where nothing is left
/// out: of modes beyond their bounds, relative; and of torques, relative to the largest.
inline constexpr double kSameModes = 1e-9, kSameTorque = 1e-12;
/// Not zero, but without effect.
inline constexpr double kTiny = std::numeric_limits<double>::denorm_min();

inline void compare_torques(const LedPair& pair, SkipTally& tally) {
  const controller::JointVector &lean = pair.lean.torque, &full = pair.full.torque;
  const double size = 1e-300 + full.cwiseAbs().maxCoeff();
  for (Eigen::Index i = 0; i < full.size(); ++i) tally.see(lean[i], full[i], kSameTorque * size);
}

inline void compare_modes(LedPair& pair, SkipTally& tally) {
  const controller::Vibration &lean = pair.lean.modes(), &full = pair.full.modes();
  if (!has_modes(lean) || !has_modes(full)) {
    if (has_modes(lean) != has_modes(full)) tally.fail();
    return;
  }
  const auto& again = pair.lean_anew();
  if (again.status == analysis::Status::kOk) {
    compare_bounded(plain_modes(lean), {again.modes.begin(), again.modes.end()}, lean.zero_modes,
                    kSameModes, tally);
  }
  compare_bounded(plain_modes(lean), plain_modes(full), full.zero_modes, kSameModes, tally);
}

/// A term that a tick leaves out: `lean` input allows it, the adjacent `full` input does not.
struct TermSkip {
  SkipTally tally;
  std::function<void(controller::Settings& lean, controller::Settings& full)> settings;
  LedPair::Input both, of_full;
  /// How often it was left out, by counters of the first controller.
  std::function<std::uint64_t(const LedPair&)> left_out;
};

inline std::vector<TermSkip> term_skips() {
  using controller::RobotState;
  using controller::Setpoint;
  using controller::Settings;
  const auto nothing = [](RobotState&, Setpoint&) {};
  const auto still = [](RobotState& state, Setpoint&) { state.velocity.setZero(); };
  // The rotation of the null space only counts with a load, or under way.
  const auto without_posture = [](controller::Gains& gains) {
    gains.null_stiffness.setZero();
    gains.null_damping.setZero();
  };
  const auto free_posture = [=](RobotState&, Setpoint& setpoint) {
    without_posture(setpoint.gains);
  };
  const auto every_tick = [](const LedPair& pair) {
    return static_cast<std::uint64_t>(pair.ticks);
  };
  std::vector<TermSkip> all;
  all.push_back({{"K_G without a wrench"},
                 [=](Settings& a, Settings& b) {
                   a.task_terms.load = b.task_terms.load = controller::Load::kJointTorques;
                   for (Settings* one : {&a, &b}) without_posture(one->initial.gains);
                 },
                 free_posture,
                 [](RobotState& state, Setpoint&) { state.external_wrench[2] = kTiny; },
                 [](const LedPair& pair) { return pair.lean.modes().counters.no_wrench; }});
  all.push_back({{"J' C_C Jdot at rest"},
                 [=](Settings& a, Settings& b) {
                   a.task_terms.jacobian_rate = b.task_terms.jacobian_rate = true;
                   for (Settings* one : {&a, &b}) without_posture(one->initial.gains);
                 },
                 [=](RobotState& state, Setpoint& setpoint) {
                   still(state, setpoint);
                   free_posture(state, setpoint);
                 },
                 [](RobotState& state, Setpoint&) { state.velocity.setConstant(kTiny); },
                 [](const LedPair& pair) { return pair.lean.modes().counters.at_rest; }});
  all.push_back({{"nothing computed standing still"},
                 [](Settings&, Settings&) {},
                 nothing,
                 [last = 0.0](RobotState& state, Setpoint&) mutable {
                   const double there = state.position[0];
                   if (there == last) state.position[0] = std::nextafter(there, 10.0);
                   last = state.position[0];
                 },
                 [](const LedPair& pair) { return pair.lean.modes().counters.unchanged; }});
  all.push_back(
      {{"no null space: gains of zero"},
       [=](Settings& a, Settings& b) {
         for (Settings* one : {&a, &b}) without_posture(one->initial.gains);
         b.initial.gains.null_damping.setConstant(1e-14);
       },
       free_posture,
       [](RobotState&, Setpoint& setpoint) { setpoint.gains.null_damping.setConstant(1e-14); },
       every_tick});
  const auto feed_forward = [&](const char* what, bool controller::FeedForward::*term,
                                const LedPair::Input& both) {
    all.push_back({{what},
                   [term](Settings& a, Settings&) { a.feed_forward.*term = false; },
                   both,
                   nothing,
                   every_tick});
  };
  feed_forward("feed-forward of no wrench", &controller::FeedForward::wrench, nothing);
  feed_forward("Coriolis torque at rest", &controller::FeedForward::coriolis, still);
  return all;
}

/// Runs one for this many ticks.
inline void run_skip(const controller::RobotModel& model, int ticks, TermSkip& skip) {
  controller::Settings lean = constant_damping(model), full = lean;
  skip.settings(lean, full);
  LedPair pair(model, lean, full);
  for (int k = 0; k < ticks; ++k) {
    pair.tick(skip.both, skip.of_full);
    compare_torques(pair, skip.tally);
    compare_modes(pair, skip.tally);
  }
  skip.tally.left_out += static_cast<std::int64_t>(skip.left_out(pair));
}

}  // namespace dashpot::testing
