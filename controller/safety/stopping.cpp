#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/safety/safety_filter.hpp>
#include <dashpot/controller/settings_check.hpp>

#include <algorithm>
#include <cmath>
#include <deque>
#include <sstream>

namespace dashpot::controller {
namespace {

constexpr double kStopBegins = 0.9;     // of a velocity limit
constexpr double kStopEnds = 0.1;       // of the initial velocity
constexpr double kLongestStop = 2;      // s
constexpr double kPromisedStop = 0.25;  // s: docs/safety.md
constexpr double kSlowerStop = 1.5;     // times the stop with faster torques
constexpr double kFastestRate = 32;     // times a torque rate: no robot follows a faster one

}  // namespace

Stopping stopping(const RobotModel& model, const Settings& settings, const JointVector& q) {
  const Eigen::Index n = q.size();
  const double T = settings.period;
  const DynamicsResult robot = evaluate(model, q, JointVector::Zero(n));
  const JointVector zero = JointVector::Zero(n);
  const JointVector weight = settings.feed_forward.gravity ? robot.gravity : zero;
  const Eigen::LLT<Eigen::MatrixXd> mass(robot.M);
  Stopping result{zero, zero};
  for (Eigen::Index i = 0; i < n; ++i) {
    SafetyFilter filter(settings);
    filter.reset(weight);
    const double begin = kStopBegins * settings.limits.velocity[i];
    JointVector position = q, velocity = zero, torque = weight;
    velocity[i] = begin;
    std::deque<JointVector> late(
        static_cast<std::size_t>(std::ceil(settings.analysis.sampled.delay)), weight);
    while (velocity.cwiseAbs().maxCoeff() > kStopEnds * begin && result.time[i] < kLongestStop) {
      result.time[i] += T;
      filter.apply({position, velocity, robot, weight, nullptr}, 0, SafetyFilter::Aim::kStop, zero,
                   torque);
      late.push_back(torque);
      velocity += T * mass.solve(late.front() - weight);
      position += T * velocity;
      late.pop_front();
      result.way[i] = std::max(result.way[i], std::abs(position[i] - q[i]));
    }
  }
  return result;
}

std::string slow_stop(const RobotModel& model, const Settings& settings, const JointVector& q) {
  Eigen::Index slowest = 0;
  const double time = stopping(model, settings, q).time.maxCoeff(&slowest);
  if (time <= kPromisedStop) return "";
  const auto with_rate = [&](double times) {
    Settings faster = settings;
    faster.limits.torque_rate *= times;
    return stopping(model, faster, q).time[slowest];
  };
  const double best = with_rate(kFastestRate);
  if (time <= kSlowerStop * best) return "";  // limited by torque, or by a soft brake
  double times = 2;
  while (times < kFastestRate && with_rate(times) > std::max(kPromisedStop, kSlowerStop * best))
    times *= 2;
  std::ostringstream line;
  line.precision(3);
  line << "limits.torque_rate: " << settings.limits.torque_rate[slowest]
       << " lets the brake stop joint '" << model.joints()[static_cast<std::size_t>(slowest)].name
       << "' in " << time << " s; " << times * settings.limits.torque_rate[slowest]
       << " would do it in " << with_rate(times) << " s";
  return line.str();
}

}  // namespace dashpot::controller
