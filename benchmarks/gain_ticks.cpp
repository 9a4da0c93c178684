// Control ticks with the most expensive gains that are accepted, which instruction_count.sh counts.
//     gain_ticks JOINTS followed TICKS     ticks of a swinging arm whose modes are tracked
//     gain_ticks JOINTS search TRIALS      looks for gains that make an analysis long, and writes
//                                          these and others to standard output, one line each
//     gain_ticks JOINTS replay             reads such lines, does some ticks with each, and reports
//                                          the analysis of each tick
// JOINTS is 7, a Panda, or another number, a random chain. The search starts from random gains of
// every kind and changes the best so far, by the work that the analysis counts, with all of a
// period to spend and with the default share. Each line is run twice, without and with
// the terms that make stiffness and damping nonsymmetric.
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <unistd.h>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <random>
#include <string>
#include <vector>

/// Where callgrind writes down what a tick took.
extern "C" [[gnu::noinline]] void end_of_tick() {
  asm volatile("");
}

namespace {

using namespace dashpot::controller;  // NOLINT(google-build-using-namespace)
using dashpot::testing::RandomRobot;

class Random {
 public:
  explicit Random(int seed) : engine_(static_cast<std::uint64_t>(seed)) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Eigen::MatrixXd matrix(Eigen::Index n) {
    return Eigen::MatrixXd::NullaryExpr(n, n, [&] { return uniform(-1, 1); });
  }

 private:
  std::mt19937_64 engine_;
};

RobotModel model_of(int joints) {
  if (joints == 7) {
    return RobotModel::from_urdf_file(DASHPOT_SOURCE_DIR "/sim/models/panda.urdf", "panda_link0",
                                      "panda_hand_tcp");
  }
  return RobotModel::from_urdf_text(RandomRobot(16).chain(joints, 0), "link0", "tip");
}

Settings settings_for(const RobotModel& model, double share, bool all_terms) {
  Settings settings = default_settings(model);
  settings.analysis.share = share;
  if (all_terms) settings.task_terms = {Load::kToolWrench, true};
  settings.limits.beyond_model = true;
  settings.limits.velocity.setConstant(1e6);  // so that states may jump ...
  settings.limits.tip_velocity = 1e6;
  settings.watchdog.feedback = 0;
  settings.limits.torque *= 1e6;  // ... and nothing that they do is a fault
  settings.limits.torque_rate *= 1e9;
  settings.motion.gain_time = settings.period;
  settings.watchdog.setpoint_hold = settings.watchdog.setpoint_damp = 0;
  return settings;
}

/// Gains, and where the arm is.
struct Case {
  enum Kind { kFree, kProportional, kCritical, kRatio, kKinds };
  int kind = kFree;  ///< C free, or in the axes of K, or near critical in all modes, or designed
  bool task = false;
  int K_axes = 0, C_axes = 0;  ///< 0: diagonal matrices; else the seed of a rotation
  int posture = 0;             ///< its seed; every fourth is singular
  double ratio = 1;            ///< of kCritical and kRatio
  double noise = -12;          ///< log10, of kCritical: what modes differ by
  double null_stiffness = 0, null_damping = 0;  ///< log10
  std::array<double, 16> K{}, C{};              ///< log10 of the eigenvalues; 0 from -9.5 down

  void write(std::ostream& out) const {
    out.precision(17);
    out << kind << ' ' << task << ' ' << K_axes << ' ' << C_axes << ' ' << posture << ' ' << ratio
        << ' ' << noise << ' ' << null_stiffness << ' ' << null_damping;
    for (const auto* list : {&K, &C}) {
      for (const double x : *list) out << ' ' << x;
    }
    out << '\n';
  }
  bool read(std::istream& in) {
    in >> kind >> task >> K_axes >> C_axes >> posture >> ratio >> noise >> null_stiffness >>
        null_damping;
    for (auto* list : {&K, &C}) {
      for (double& x : *list) in >> x;
    }
    return static_cast<bool>(in);
  }
};

double power(double exponent) {
  return exponent > -9.5 ? std::pow(10, std::min(exponent, 9.0)) : 0;
}

/// A random case; values of one matrix are alike as often as not.
Case random_case(Random& random) {
  const auto pick = [&](int count) { return static_cast<int>(random.uniform(0, count - 1e-9)); };
  Case c;
  c.kind = pick(Case::kKinds);
  c.task = pick(2) == 0;
  c.K_axes = pick(2) == 0 ? 0 : 1 + pick(1000);
  c.C_axes = pick(2) == 0 ? c.K_axes : 1 + pick(1000);
  c.posture = pick(1000);
  c.ratio = pick(2) == 0 ? random.uniform(0.05, 2)
                         : 1 + random.uniform(-1, 1) * power(random.uniform(-9, 0));
  c.noise = random.uniform(-16, -1);
  c.null_stiffness = random.uniform(-10, 9);
  c.null_damping = random.uniform(-10, 9);
  for (auto* list : {&c.K, &c.C}) {
    const double middle = random.uniform(-10, 9), spread = pick(2) == 0 ? 0 : random.uniform(0, 10);
    for (double& x : *list) x = middle + random.uniform(-spread, spread);
  }
  return c;
}

Case changed(Case c, Random& random) {
  const double size = power(random.uniform(-4, 0.5));
  const Case other = random_case(random);
  const auto often = [&](double share) { return random.uniform(0, 1) < share; };
  if (often(0.05)) c.kind = other.kind;
  if (often(0.05)) c.task = !c.task;
  if (often(0.1)) c.K_axes = other.K_axes;
  if (often(0.1)) c.C_axes = often(0.5) ? c.K_axes : other.C_axes;
  if (often(0.2)) c.posture = other.posture;
  if (often(0.3)) c.ratio = std::clamp(1 + (c.ratio - 1) * random.uniform(0, 2), 0.01, 2.0);
  if (often(0.3)) c.noise = std::min(c.noise + size * random.uniform(-1, 1), -1.0);
  if (often(0.3)) c.null_stiffness += size * random.uniform(-1, 1);
  if (often(0.3)) c.null_damping += size * random.uniform(-1, 1);
  for (auto* list : {&c.K, &c.C}) {
    const double shift = often(0.3) ? size * random.uniform(-1, 1) : 0;
    for (double& x : *list) x += shift + (often(0.2) ? size * random.uniform(-1, 1) : 0);
  }
  return c;
}

class Bench {
 public:
  Bench(const RobotModel& model, double share, bool all_terms)
      : model_(model),
        settings_(settings_for(model, share, all_terms)),
        controller_(model, settings_) {
    state_.position = settings_.initial.joint_position;
    state_.velocity = JointVector::Zero(model.dof());
    setpoint_ = settings_.initial;
    if (all_terms) state_.external_wrench << 30, -20, 10, 3, 2, -1;
  }

  /// The most work of a tick.
  template <class Report>
  std::int64_t run(const Case& c, const Report& report) {
    place(c);
    setpoint_.mode = c.task ? Mode::kCartesian : Mode::kJoint;
    setpoint_.gains = settings_.initial.gains;
    std::int64_t most = 0;
    for (int k = 0; k < 10; ++k) {
      if (k == 4) setpoint_.gains = gains(c);  // into the running loop
      move();
      tick();
      const Vibration& modes = controller_.vibration();
      most = std::max(most, modes.work);
      report(modes);
      wait_for_thread(report);
    }
    return most;
  }
  Status worst() const { return worst_; }
  void swing(int k) {
    setpoint_.mode = Mode::kCartesian;
    for (Eigen::Index i = 0; i < state_.position.size(); ++i) {
      const double phase = (2 + 0.3 * static_cast<double>(i)) * 1e-3 * k;
      state_.position[i] =
          settings_.initial.joint_position[i] + 0.4 * std::sin(phase + static_cast<double>(i));
    }
    tick();
    usleep(2000);  // the work beyond a tick is done before the next one
  }
  const Vibration& modes() const { return controller_.vibration(); }

 private:
  static constexpr auto kUnfinished = dashpot::analysis::Status::kUnfinished;

  void tick() {
    setpoint_.time = state_.time += 1'000'000;
    worst_ = worse(worst_, controller_.update(state_, setpoint_, torque_));
    end_of_tick();
  }
  /// The thread finishes its task, so that the next tick is tried.
  template <class Report>
  void wait_for_thread(const Report& report) {
    for (int wait = 1; controller_.vibration().status == kUnfinished && wait < 1'000'000;
         wait *= 2) {
      usleep(static_cast<useconds_t>(200 * wait));
      tick();
      report(controller_.vibration());
    }
  }
  void move() { state_.position += 1e-3 * state_.velocity; }

  void place(const Case& c) {
    Random random(c.posture);
    const Limits& limits = settings_.limits;
    for (Eigen::Index i = 0; i < state_.position.size(); ++i) {
      const double low = std::max(limits.position_lower[i], -3.0) + 0.1;
      const double high = std::min(limits.position_upper[i], 3.0) - 0.1;
      state_.position[i] = random.uniform(low, high);
      state_.velocity[i] = random.uniform(-1, 1);
    }
    if (c.posture % 4 == 0) state_.position[1] = state_.position[2] = 1e-5;
    setpoint_.joint_position = state_.position;
    controller_.reset(JointVector::Zero(model_.dof()));
  }

  Gains gains(const Case& c) const {
    Gains gains = settings_.initial.gains;
    const Eigen::Index n = model_.dof(), size = c.task ? 6 : n;
    const auto matrix = [&](const std::array<double, 16>& values, int axes) {
      Eigen::MatrixXd A = Eigen::MatrixXd::Zero(size, size);
      for (Eigen::Index i = 0; i < size; ++i) A(i, i) = power(values[static_cast<std::size_t>(i)]);
      if (axes == 0) return A;
      const Eigen::MatrixXd Q =
          Eigen::HouseholderQR<Eigen::MatrixXd>(Random(axes).matrix(size)).householderQ();
      A = Q * A * Q.transpose();
      return Eigen::MatrixXd(0.5 * (A + A.transpose()));
    };
    Eigen::MatrixXd K = matrix(c.K, c.K_axes);
    Eigen::MatrixXd C = matrix(c.C, c.kind == Case::kProportional ? c.K_axes : c.C_axes);
    if (c.kind == Case::kCritical) near_critical(c, K, C);
    (c.task ? gains.task_damping_ratio : gains.joint_damping_ratio) =
        c.kind == Case::kRatio ? c.ratio : 0;
    if (c.task) {
      gains.task_stiffness = K;
      gains.task_damping = C;
      gains.null_stiffness.setConstant(n, power(c.null_stiffness));
      gains.null_damping.setConstant(n, power(c.null_damping));
      gains.null_damping_ratio = 0;
    } else {
      gains.joint_stiffness = K;
      gains.joint_damping = C;
    }
    return gains;
  }

  /// K = k H and C = 2 ratio sqrt(k) H for the inertia H there, but for noise.
  void near_critical(const Case& c, Eigen::MatrixXd& K, Eigen::MatrixXd& C) const {
    const auto robot = evaluate(model_, state_.position, state_.velocity);
    Eigen::MatrixXd H = robot.M;
    if (c.task) {
      const Eigen::MatrixXd J = robot.J, A = J * H.inverse() * J.transpose();
      H = (A + 1e-9 * Eigen::MatrixXd::Identity(6, 6)).inverse();
      H = (0.5 * (H + H.transpose())).eval();
    }
    const double k = std::clamp(power(c.K[0]), 1e-9, 1e6);
    const Eigen::MatrixXd noise = Random(1 + c.C_axes).matrix(H.rows());
    K = k * H;
    C = 2 * c.ratio * std::sqrt(k) * H +
        power(c.noise + 9) * 1e-9 * std::sqrt(k) * H.norm() * (noise * noise.transpose());
  }

  const RobotModel& model_;
  Settings settings_;
  Controller controller_;
  RobotState state_;
  Setpoint setpoint_;
  JointVector torque_;
  Status worst_ = Status::kOk;
};

void search(const RobotModel& model, int trials) {
  Random random(42);
  const auto silent = [](const Vibration&) {};
  struct Found {
    Case gains;
    std::int64_t work = 0;
  };
  for (const double share : {1.0, Analysis().share}) {
    for (const bool all_terms : {false, true}) {
      Bench bench(model, share, all_terms);
      constexpr std::size_t kClimbers = 12;
      std::vector<Found> best(kClimbers);
      for (int trial = 0; trial < trials / 4; ++trial) {
        Found& climber = best[static_cast<std::size_t>(trial) % kClimbers];
        const bool fresh = climber.work == 0 || trial < trials / 16;
        Found next{fresh ? random_case(random) : changed(climber.gains, random)};
        next.work = bench.run(next.gains, silent);
        if (next.work > climber.work) climber = next;
      }
      for (const Found& found : best) found.gains.write(std::cout);
    }
  }
  for (int k = 0; k < 60; ++k) random_case(random).write(std::cout);
}

void replay(const RobotModel& model) {
  std::vector<Case> cases;
  for (Case next; next.read(std::cin);) cases.push_back(next);
  for (const bool all_terms : {false, true}) {
    Bench bench(model, Analysis().share, all_terms);
    int line = 0;
    for (const Case& c : cases) {
      ++line;
      bench.run(c, [&](const Vibration& modes) {
        const char* kinds[] = {"free C", "C along K", "near critical", "ratio"};
        std::printf("line %d%s, %s, %s: %lld units, %s\n", line, all_terms ? ", all terms" : "",
                    c.task ? "task" : "joint", kinds[c.kind], static_cast<long long>(modes.work),
                    to_text(modes.status));
      });
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const RobotModel model = model_of(std::atoi(argv[1]));
  const std::string what = argv[2];
  if (what == "replay") {
    replay(model);
  } else if (what == "search" && argc == 4) {
    search(model, std::atoi(argv[3]));
  } else if (what == "followed" && argc == 4) {
    Bench bench(model, Analysis().share, false);
    for (int k = 0; k < std::atoi(argv[3]); ++k) bench.swing(k);
    std::printf("%llu tracked, %s\n",
                static_cast<unsigned long long>(bench.modes().counters.tracked),
                to_text(bench.worst()));
    return bench.modes().counters.tracked > 0 && bench.worst() <= Status::kNearJointLimit ? 0 : 1;
  } else {
    return 2;
  }
}
