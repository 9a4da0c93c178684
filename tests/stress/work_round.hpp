#pragma once
// The tasks of an arm in a round of ordinary work, and its disturbances.

#include <dashpot/tests/stress/safety_arms.hpp>
#include <dashpot/tests/support/places.hpp>

#include <cmath>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

namespace dashpot::stress {

using Eigen::Vector3d;

constexpr double kRound = 33;   ///< s, after which other bodies and places follow
constexpr double kTable = 0.2;  ///< m below where the tip starts
// Seconds of a round:
constexpr double kHeld = 5, kPutDown = 12, kTapped = 26, kPushed[] = {1, 30.5};
constexpr double kPush = 40;  ///< N, for 0.7 s, by a hand that takes 0.1 s to press so hard

/// The random values of a round.
struct Round {
  Vector3d pick, place;    ///< from where the tip starts, m; z is not used
  Vector3d wipe;           ///< along the table, m
  Vector3d guide;          ///< by the hand, m
  Vector3d shake;          ///< amplitude of the hand at 4 Hz, m
  Vector3d tap;            ///< for 10 ms, N
  Vector3d push;           ///< for 0.7 s, N
  double mass, told_late;  ///< of the payload as set, kg; s after it is held or put down
  double stiffer;          ///< than the default, a factor
  JointVector away;        ///< rad, a move of the joints
};

inline Round draw_round(std::mt19937_64& engine, int n) {
  const auto uniform = [&engine](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine);
  };
  const auto vector = [&uniform](double x, double y, double z) {
    const double a = uniform(-x, x), b = uniform(-y, y), c = uniform(-z, z);
    return Vector3d(a, b, c);
  };
  Round round{};
  round.pick = vector(0.1, 0.2, 0);
  round.place = vector(0.1, 0.2, 0);
  round.wipe = vector(0.1, 0.1, 0);
  round.guide = vector(0.15, 0.15, 0.1);
  round.shake = vector(0.015, 0.015, 0.015);
  round.tap = vector(40, 40, 40);
  round.mass = uniform(0.3, 2);
  round.told_late = std::round(uniform(0, 200)) / 1000;
  round.stiffer = uniform(0.5, 1.2);
  round.away.resize(n);
  for (double& q : round.away) q = uniform(-0.4, 0.4);
  round.push = kPush * vector(1, 1, 1).normalized();
  return round;
}

inline sim::Inertia body_of(double mass) {
  return {mass, Vector3d(0, 0, 0.05), 1e-3 * mass * Eigen::Matrix3d::Identity()};
}

/// The arm of a file with links that weigh so many times as much.
inline sim::Robot weighed(const TestArm& arm, double factor, const JointVector& friction) {
  const std::string path = DASHPOT_SOURCE_DIR "/sim/models/" + std::string(arm.file) + ".urdf";
  std::ifstream file(path);
  std::string urdf(std::istreambuf_iterator<char>(file), {});
  const std::string key = "<mass value=\"";
  for (std::size_t at = 0; (at = urdf.find(key, at)) != std::string::npos;) {
    at += key.size();
    const std::size_t size = urdf.find('"', at) - at;
    urdf.replace(at, size, std::to_string(factor * std::stod(urdf.substr(at, size))));
  }
  sim::RobotParameters parameters;
  parameters.reflected_inertia.setConstant(friction.size(), arm.reflected_inertia);
  parameters.coulomb_friction = friction;
  return sim::Robot::from_text(urdf, arm.base, arm.tip, parameters, path);
}

/// The table, and what these rounds bring, for a tip that starts at `start`.
inline sim::ArmOptions scene(const std::vector<Round>& rounds, const Vector3d& start,
                             double factor) {
  const auto force = [](const Vector3d& value) {
    sim::Vector6 result = sim::Vector6::Zero();
    result.head<3>() = value;
    return result;
  };
  sim::ArmOptions world;
  sim::Wall table;
  table.point = start - kTable * Vector3d::UnitZ();
  table.contact = {2e4, 200};
  world.wall = table;
  double begin = 0;
  for (const Round& round : rounds) {
    world.loads.push_back({begin + kHeld, begin + kPutDown, body_of(factor * round.mass)});
    world.wrenches.push_back({begin + kTapped, begin + kTapped + 0.01, force(round.tap)});
    for (const double at : kPushed) {
      for (int step = 0; step < 5; ++step) {
        const double rise = 0.02 * step;
        world.wrenches.push_back(
            {begin + at + rise, begin + at + 0.7 - rise, force(0.2 * round.push)});
      }
    }
    begin += kRound;
  }
  return world;
}

}  // namespace dashpot::stress
