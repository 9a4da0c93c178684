#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>

#include <pthread.h>
#include <sched.h>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <limits>

namespace dashpot::controller {
namespace {

constexpr std::chrono::milliseconds kLook{5};  // how often the thread looks for a task

}  // namespace

analysis::SampledLoop sampled_loop(const RobotModel& model, const Settings& settings) {
  const Analysis::Sampled& sampled = settings.analysis.sampled;
  analysis::SampledLoop loop;
  loop.period = settings.period;
  loop.delay = sampled.delay;
  loop.torque_cutoff = sampled.cutoff;
  loop.difference_velocity = sampled.difference_velocity;
  loop.friction = Eigen::VectorXd(model.joint_values(&Joint::viscous_friction)).asDiagonal();
  return loop;
}

Eigen::MatrixXd gravity_gradient(const DynamicsKernel& kernel, const JointVector& q) {
  constexpr double kStep = 1e-5;  // rad
  DynamicsResult after, before;
  const JointVector none = JointVector::Zero(q.size());
  Eigen::MatrixXd gradient(q.size(), q.size());
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const JointVector step = kStep * JointVector::Unit(q.size(), i);
    kernel.evaluate(q + step, none, after);
    kernel.evaluate(q - step, none, before);
    gradient.col(i) = (after.gravity - before.gravity) / (2 * kStep);
  }
  return gradient;
}

DesignedDamping designed_damping(const RobotModel& model, const Settings& settings) {
  constexpr double kReserve = 1.02;  // of the margin, for what couples modes
  JointVector subtracted = JointVector::Zero(model.dof());
  if (settings.subtract_friction) subtracted = friction_left(model, settings).cwiseMax(0);
  const double margin = settings.limits.gain_margin;
  if (margin == 1) return DesignedDamping(subtracted);
  return DesignedDamping(subtracted, {sampled_loop(model, settings), kReserve * margin});
}

analysis::ControllerMemory integral_memory(const Eigen::MatrixXd& K_I, double period) {
  constexpr double kNothing = 1e-12;  // of the largest eigenvalue
  const Eigen::Index n = K_I.rows();
  if (n == 0 || K_I.isZero(0)) return {};
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(K_I);
  const Eigen::VectorXd& values = eigen.eigenvalues();
  const Eigen::Index rank = (values.array() > kNothing * values[n - 1]).count();
  const Eigen::MatrixXd F =
      eigen.eigenvectors().rightCols(rank) * values.tail(rank).cwiseSqrt().asDiagonal();
  return {Eigen::MatrixXd::Identity(rank, rank), period * F.transpose(), F};
}

analysis::ControllerMemory integral_memory(const DynamicsResult& robot, const Impedance& springs,
                                           double time, double period) {
  if (time == 0) return {};
  return integral_memory(integral_stiffness(robot, springs, time), period);
}

std::vector<double> integral_decays(const analysis::SampledSpectrum& sampled, double period) {
  std::vector<double> decays;
  for (const analysis::Complex z : sampled.memory) {
    decays.push_back(-std::log(std::abs(z)) / period);
  }
  std::sort(decays.begin(), decays.end());
  return decays;
}

SampledAnalysis::SampledAnalysis(const RobotModel& model, const Settings& settings)
    : kernel_(model),
      elastic_(elastic_joints(model)),
      gravity_(settings.feed_forward.gravity),
      interval_(static_cast<std::uint64_t>(
          std::clamp(std::round(settings.analysis.sampled.interval / settings.period), 1.0, 1e15))),
      first_(1 + static_cast<std::uint64_t>(std::clamp(
                     std::ceil(settings.motion.gain_time / settings.period), 1.0, 1e15))),
      next_(first_),
      loop_(sampled_loop(model, settings)),
      thread_([this] { run(); }) {}

SampledAnalysis::~SampledAnalysis() {
  stop_.store(true, std::memory_order_relaxed);
  thread_.join();
}

void SampledAnalysis::hand_over() noexcept {
  next_ = task().tick + interval_;
  task().resets = resets_.load(std::memory_order_relaxed);
  tasks_.publish();
}

void SampledAnalysis::reset() noexcept {
  next_ = first_;
  resets_.fetch_add(1, std::memory_order_relaxed);
}

const SampledVibration* SampledAnalysis::latest() noexcept {
  results_.fetch();
  const SampledVibration& found = results_.value();
  return found.resets == resets_.load(std::memory_order_relaxed) ? &found : nullptr;
}

void SampledAnalysis::run() noexcept {
  // Whoever made the controller may be a real-time thread; this one must not delay it.
  const sched_param ordinary{};
  pthread_setschedparam(pthread_self(), SCHED_OTHER, &ordinary);
  while (!stop_.load(std::memory_order_relaxed)) {
    if (!tasks_.fetch()) {
      std::this_thread::sleep_for(kLook);
      continue;
    }
    SampledVibration& result = results_.slot();
    try {
      solve(tasks_.value(), result);
    } catch (const std::exception&) {
      result.count = 0;
      if (result.status == analysis::Status::kOk ||
          result.status == analysis::Status::kUncertified) {
        result.status = analysis::Status::kNotConverged;
      }
      result.spectral_radius = result.gain_margin = std::numeric_limits<double>::quiet_NaN();
    }
    results_.publish();
  }
}

void SampledAnalysis::solve(const Task& task, SampledVibration& result) {
  result = SampledVibration();
  result.time = task.time;
  result.tick = task.tick;
  result.resets = task.resets;
  result.position = task.position;
  analysis::System<> system(task.system.dof());
  system.mass = task.system.mass;
  system.damping = task.system.damping;
  system.stiffness = task.system.stiffness;
  system.stiffness_factor = task.system.stiffness_factor;
  const analysis::Spectrum<> continuous = analysis::analyze(system);
  result.status = continuous.status;
  analysis::SampledLoop loop = loop_;
  loop.friction += task.passive.damping;
  loop.passive_stiffness = task.passive.stiffness;
  loop.memory = integral_memory(task.integral, loop.period);
  kernel_.attach(task.attachment);
  if (gravity_) loop.gravity_gradient = gravity_gradient(kernel_, task.position);
  loop.gears = elastic_;
  loop = analysis::with_gears(loop);
  const analysis::SampledSpectrum sampled = analysis::sample_loop(system, continuous, loop);
  result.spectral_radius = sampled.spectral_radius;
  result.gain_margin = analysis::gain_margin(system, continuous, loop, 1e6, kSlowestVibration);
  const std::size_t slow = std::min(sampled.memory.size(), result.integrals.size());
  for (std::size_t i = 0; i < slow; ++i) {
    result.integrals[i] = std::log(sampled.memory[i]) / loop.period;
  }
  result.integral_count = static_cast<int>(slow);
  result.count = static_cast<int>(sampled.modes.size());
  for (std::size_t i = 0; i < sampled.modes.size(); ++i) {
    const analysis::SampledMode& from = sampled.modes[i];
    const auto& origin = continuous.modes[static_cast<int>(i)];
    result.modes[i] = {
        from.kind,          origin.natural_frequency, origin.damping_ratio, from.natural_frequency,
        from.damping_ratio, from.damped_frequency};
  }
}

}  // namespace dashpot::controller
