#pragma once
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/latest.hpp>
#include <dashpot/controller/law/designed_damping.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/snapshot.hpp>
#include <dashpot/controller/vibration/closed_loop.hpp>

#include <atomic>
#include <thread>
#include <vector>

namespace dashpot::controller {

/// Returns dg/dq (n x n, N m/rad) of the gravity torque g(q), by central differences, with a
/// relative error of 1e-9. Allocates.
Eigen::MatrixXd gravity_gradient(const DynamicsKernel& kernel, const JointVector& q);

/// Motions slower than this, rad/s, do not count in a gain margin, because a self-motion fed by the
/// compensation of gravity through a zero-order hold is no vibration.
inline constexpr double kSlowestVibration = 1;

/// Returns the sampled loop that the settings describe, without gravity, and without elastic
/// joints; see analysis::SampledLoop::gears.
analysis::SampledLoop sampled_loop(const RobotModel& model, const Settings& settings);

/// Returns what designs the damping of springs for their ratios: as much of it as that loop bears
/// with Limits::gain_margin and a reserve.
DesignedDamping designed_damping(const RobotModel& model, const Settings& settings);

/// Returns the integral of springs with this K_I (n x n, N m/(rad s), symmetric positive
/// semidefinite; see integral_stiffness) as states of the loop, as many as its rank: with K_I = F
/// F',
///     w_k+1 = w_k + T F' q_k,   and the torque -F w_k.
analysis::ControllerMemory integral_memory(const Eigen::MatrixXd& K_I, double period);

/// Returns that of the springs of an impedance at a posture, with the K_I of integral_stiffness; no
/// states if `time` (Integral::time, s) is zero.
analysis::ControllerMemory integral_memory(const DynamicsResult& robot, const Impedance& springs,
                                           double time, double period);

/// Returns at which rates, 1/s, the slow modes decay that the integral makes, the slowest first;
/// negative: it grows.
std::vector<double> integral_decays(const analysis::SampledSpectrum& sampled, double period);

/// Finds, at intervals and on a thread of its own, the modes of the loop with its torque held over
/// a period (zero-order hold), delayed and filtered, by analysis::sample_loop and
/// analysis::gain_margin. The thread is needed because this takes milliseconds and allocates.
///
/// The real-time thread calls `due`, `task`, `hand_over` and `reset`. One other thread, always the
/// same, calls `latest`. None of these functions waits, allocates or calls the system.
class SampledAnalysis {
 public:
  /// A closed loop, as Controller::closed_loop sets it.
  struct Task {
    std::int64_t time = 0;
    std::uint64_t tick = 0;
    std::uint64_t resets = 0;  ///< filled in by `hand_over`
    JointVector position;
    analysis::System<kMaxJoints> system;
    PassivePart passive;   ///< of what the world adds
    JointMatrix integral;  ///< K_I of integral_stiffness; empty: none
    Attachment attachment;
  };

  SampledAnalysis(const RobotModel& model, const Settings& settings);
  ~SampledAnalysis();
  SampledAnalysis(const SampledAnalysis&) = delete;
  SampledAnalysis& operator=(const SampledAnalysis&) = delete;

  /// Returns true if it is time for the next task: once the gains have grown, and then at each
  /// interval. Ticks count from 1, and begin again after `reset`.
  bool due(std::uint64_t tick) const noexcept { return tick >= next_; }
  /// Returns the task that the caller fills in, and then hands over.
  Task& task() noexcept { return tasks_.slot(); }
  void hand_over() noexcept;
  void reset() noexcept;

  /// Returns the latest result; null as long as there is none since the last `reset`. The result is
  /// valid until the next call.
  const SampledVibration* latest() noexcept;

 private:
  void run() noexcept;
  void solve(const Task& task, SampledVibration& result);

  DynamicsKernel kernel_;
  const analysis::Gears elastic_;
  bool gravity_;  ///< whether gravity is compensated
  std::uint64_t interval_;
  std::uint64_t first_;  ///< tick
  std::uint64_t next_;
  std::atomic<std::uint64_t> resets_{1};  ///< from 1, so that an empty result never matches
  analysis::SampledLoop loop_;            ///< of the thread
  Latest<Task> tasks_;
  Latest<SampledVibration> results_;
  std::atomic<bool> stop_{false};
  std::thread thread_;  ///< the last member: it uses the others
};

}  // namespace dashpot::controller
