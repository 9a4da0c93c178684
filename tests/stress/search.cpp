// Looks for the start, gains, goals, pushes and gaps that make an arm fastest, give it the most
// kinetic energy, or drive a joint on longest while it is too fast, under a plugin.
// Cross-entropy method (R. Rubinstein, 1999): samples of a normal distribution for each parameter,
// whose mean and width follow the best of them. The same arguments give the same result.
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/stress/safety_rig.hpp>
#include <dashpot/tests/support/places.hpp>

#include <random>

namespace {

using namespace dashpot::stress;  // NOLINT(google-build-using-namespace)
using Eigen::VectorXd;

/// Numbers from 0 to 1, taken one after the other.
class Numbers {
 public:
  explicit Numbers(const VectorXd& values) : values_(values) {}
  double next(double low, double high) { return low + (high - low) * values_[at_++]; }
  double log(double low, double high) { return std::pow(10, next(low, high)); }
  JointVector vector(const JointVector& low, const JointVector& high) {
    JointVector result = low;
    for (Eigen::Index i = 0; i < low.size(); ++i) result[i] = next(low[i], high[i]);
    return result;
  }

 private:
  const VectorXd& values_;
  Eigen::Index at_ = 0;
};

/// A run of 1.2 s.
struct Attack {
  static constexpr double kDuration = 1.2;  // s
  static Eigen::Index parameters(Eigen::Index n) { return 4 * n + 19; }

  Attack(const TestArm& arm, const VectorXd& values) {
    const dashpot::sim::Robot robot = simulated_robot(arm);
    const int n = robot.dof();
    JointVector lower(n), upper(n), fastest(n);
    for (int i = 0; i < n; ++i) {
      const dashpot::sim::Joint& joint = robot.joints()[static_cast<std::size_t>(i)];
      lower[i] = std::max(joint.lower, -3.0);
      upper[i] = std::min(joint.upper, 3.0);
      fastest[i] = 0.9 * joint.velocity;
    }
    Numbers numbers(values);
    options_.start = numbers.vector(lower, upper);
    options_.velocity = numbers.vector(-fastest, fastest);
    cartesian_ = numbers.next(0, 1) < 0.5;
    stiffness_ = numbers.log(0, 5);
    damping_ = numbers.log(-1, 4);
    turning_stiffness_ = numbers.log(-1, 3.5);
    turning_damping_ = numbers.log(-2, 3);
    for (JointVector& goal : joint_goals_) goal = numbers.vector(lower, upper);
    for (Eigen::Vector3d& goal : tip_goals_) goal = numbers.vector(kNear, -kNear);
    switch_every_ = numbers.next(0.02, 0.5);
    const JointVector push = numbers.vector(100 * kNear, -100 * kNear);
    const double begin = numbers.next(0, 1);
    dashpot::controller::Vector6 wrench = dashpot::controller::Vector6::Zero();
    wrench.head<3>() = push;
    options_.world.wrenches = {{begin, begin + numbers.next(0.001, 0.05), wrench}};
    gap_at_ = numbers.next(0, 1);
    gap_ = numbers.next(-0.05, 0.1);
    options_.config = cartesian_ ? "control: {mode: cartesian}\n" : "";
  }

  /// Returns what the run measured; null if the simulation could not follow.
  std::optional<Measures> run(const PluginFile& plugin, const TestArm& arm) const try {
    Rig rig(plugin, arm, options_);
    const Eigen::Vector3d tip = rig.tip_at(rig.position()).position;
    if (cartesian_) {
      Eigen::MatrixXd K = Eigen::MatrixXd::Zero(6, 6), D = K;
      K.diagonal() << stiffness_, stiffness_, stiffness_, VectorXd::Constant(3, turning_stiffness_);
      D.diagonal() << damping_, damping_, damping_, VectorXd::Constant(3, turning_damping_);
      rig.set_task_gains(K, D);
    } else {
      const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(rig.n(), rig.n());
      rig.set_joint_gains(turning_stiffness_ * one, turning_damping_ * one);
    }
    bool gone = false;
    for (int part = 0; rig.plant().time() < kDuration; ++part) {
      const auto which = static_cast<std::size_t>(part % 2);
      rig.goal =
          cartesian_ ? Goal::at(rig.tip_at(options_.start)) : Goal::joints(joint_goals_[which]);
      if (cartesian_) rig.goal->tip.position = tip + tip_goals_[which];
      rig.run(switch_every_);
      if (gap_ <= 0 || gone || rig.plant().time() < gap_at_) continue;
      gone = true;
      rig.every = 0;
      rig.run(gap_);
      rig.every = 1;
    }
    return rig.at_the_end();
  } catch (const std::runtime_error&) {
    return {};
  }

  void print() const {
    std::printf("    start %s, velocity %s\n", yaml_list(options_.start).c_str(),
                yaml_list(options_.velocity).c_str());
    if (cartesian_) {
      std::printf("    springs of the tip %.4g N/m, %.4g N m/rad, dampers %.4g, %.4g\n", stiffness_,
                  turning_stiffness_, damping_, turning_damping_);
      for (const Eigen::Vector3d& goal : tip_goals_) {
        std::printf("    goal %s m from the start\n", yaml_list(goal).c_str());
      }
    } else {
      std::printf("    springs of the joints %.4g N m/rad, dampers %.4g\n", turning_stiffness_,
                  turning_damping_);
      for (const JointVector& goal : joint_goals_) {
        std::printf("    goal %s\n", yaml_list(goal).c_str());
      }
    }
    const auto& push = options_.world.wrenches.front();
    std::printf("    the other goal every %.3f s; push %s N from %.3f to %.3f s; ", switch_every_,
                yaml_list(JointVector(push.value.head<3>())).c_str(), push.begin, push.end);
    if (gap_ > 0) std::printf("gap of %.3f s after %.3f s\n", gap_, gap_at_);
    if (gap_ <= 0) std::printf("no gap\n");
  }

 private:
  static inline const JointVector kNear = JointVector::Constant(3, -0.5);  // m

  RigOptions options_;
  bool cartesian_;
  double stiffness_, damping_, turning_stiffness_, turning_damping_;
  std::array<JointVector, 2> joint_goals_;
  std::array<Eigen::Vector3d, 2> tip_goals_;
  double switch_every_;  // s
  double gap_at_, gap_;  // s
};

struct Found {
  double value = 0;
  int evaluation = 0;
  VectorXd values;
};

/// The worst of so many runs.
Found search(const PluginFile& plugin, const TestArm& arm, double Measures::*objective,
             int evaluations, std::uint64_t seed) {
  constexpr int kPopulation = 30, kBest = 6;
  constexpr double kAtRandom = 0.2;  // this share of the samples stays uniform
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  const Eigen::Index d = Attack::parameters(start_of(arm).size());
  VectorXd mean = VectorXd::Constant(d, 0.5), width = VectorXd::Constant(d, 0.4);
  Found worst;
  std::vector<Found> population;
  for (int k = 0; k < evaluations; ++k) {
    const bool at_random = uniform(engine) < kAtRandom;
    Found sample{0, k, VectorXd(d)};
    for (Eigen::Index i = 0; i < d; ++i) {
      sample.values[i] =
          at_random ? uniform(engine) : std::clamp(mean[i] + width[i] * normal(engine), 0.0, 1.0);
    }
    if (const auto seen = Attack(arm, sample.values).run(plugin, arm))
      sample.value = *seen.*objective;
    if (sample.value > worst.value) worst = sample;
    population.push_back(sample);
    if (static_cast<int>(population.size()) < kPopulation) continue;
    std::sort(population.begin(), population.end(),
              [](const Found& a, const Found& b) { return a.value > b.value; });
    VectorXd sum = VectorXd::Zero(d), squares = sum;
    for (int i = 0; i < kBest; ++i) {
      const VectorXd& values = population[static_cast<std::size_t>(i)].values;
      sum += values;
      squares += values.cwiseAbs2();
    }
    const VectorXd new_mean = sum / kBest;
    const VectorXd spread = (squares / kBest - new_mean.cwiseAbs2()).cwiseMax(0).cwiseSqrt();
    mean = 0.3 * mean + 0.7 * new_mean;
    width = (0.3 * width + 0.7 * spread).cwiseMax(0.03);
    population.clear();
  }
  return worst;
}

void report(const PluginFile& plugin, const TestArm& arm, const Found& found, const char* what) {
  std::printf("%s, %s:", arm.name, what);
  if (found.values.size() == 0) {
    std::printf(" none found\n");
    return;
  }
  const Attack attack(arm, found.values);
  const auto seen = attack.run(plugin, arm);
  std::printf(
      " joint at %.2f of its limit, tip %.2f m/s, %.2f J, driven on while too fast %.0f ms "
      "(evaluation %d)\n",
      seen->speed_share, seen->tip_speed, seen->kinetic_energy, 1e3 * seen->driven,
      found.evaluation);
  attack.print();
  std::fflush(stdout);
}

bool search_all(const Request& request) {
  const PluginFile plugin("", request.plugins.empty() ? DASHPOT_PLUGIN : request.plugins.back());
  const auto evaluations = static_cast<int>(request.count);
  std::printf("The worst of %d runs of %.1f s each for each arm and aim, seed %lu\n", evaluations,
              Attack::kDuration, request.seed);
  struct Aim {
    double Measures::*objective;
    const char* name;
  };
  for (const TestArm& arm : test_arms()) {
    for (const Aim& aim : {Aim{&Measures::speed_share, "fastest"},
                           {&Measures::kinetic_energy, "most energy"},
                           {&Measures::driven, "driven longest"}}) {
      report(plugin, arm, search(plugin, arm, aim.objective, evaluations, request.seed), aim.name);
    }
  }
  return true;
}

const AddPart part({"search",
                    0,
                    "Look for the state, gains, goals and timing that make each arm fastest",
                    "EVALUATIONS",
                    {{300, 2}},
                    search_all,
                    {"SEED", "PLUGIN"}});

}  // namespace
