// Arms with gears of typical elasticity under default gains: at hundreds of
// postures the loop is calm, or the gains are refused before the first torque;
// and the brake stops such arms.
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/drives.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/support/dice.hpp>
#include <dashpot/tests/support/elastic_loop.hpp>
#include <dashpot/tests/support/elastic_prediction.hpp>
#include <dashpot/tests/support/places.hpp>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <numbers>
#include <stdexcept>
#include <string>

namespace dashpot::stress {
namespace {

using controller::JointVector;
using controller::Mode;
using Eigen::MatrixXd;

struct ElasticArm {
  const char* file;
  const char* base;
  const char* tip;
};

constexpr ElasticArm kElasticArms[] = {
    {"panda", "panda_link0", "panda_hand_tcp"},
    {"fr3", "fr3_link0", "fr3_hand_tcp"},
    {"iiwa7", "iiwa_link_0", "iiwa_link_ee_kuka"},
    {"iiwa14", "iiwa_link_0", "iiwa_link_ee_kuka"},
    {"gen3", "base_link", "end_effector_link"},
    {"xarm7", "link_base", "link_eef"},
    {"ur3e", "base_link", "tool0"},
    {"ur5e", "base_link", "tool0"},
    {"ur10e", "base_link", "tool0"},
    {"ur5", "base_link", "ee_link"},
    {"baxter_left", "left_arm_mount", "left_gripper"},
};

constexpr double kShoulder = 1e4,
                 kWrist = 5e3;       // N m/rad, typical of light arms
constexpr double kRotor = 0.1;       // kg m^2, where no figure is published
constexpr double kGearRatio = 0.01;  // damping of gear and rotor alone

/// An arm with gears, as the controller believes it to be and as it is
/// simulated.
struct Gears {
  controller::RobotModel model;
  sim::Robot robot;
  sim::ArmOptions options;

  Gears(const ElasticArm& arm, controller::PositionSensor sensor)
      : model(controller::RobotModel::from_urdf_file(path(arm), arm.base, arm.tip)),
        robot(sim::Robot::from_file(path(arm), arm.base, arm.tip)) {
    const Eigen::Index n = model.dof();
    controller::ModelOptions told;
    const controller::Drives* const drives = drives_like(model);
    told.reflected_inertia = drives != nullptr ? drives->values(drives->reflected_inertia)
                                               : JointVector(JointVector::Constant(n, kRotor));
    told.gear_stiffness = JointVector::Constant(n, kShoulder);
    told.gear_stiffness.tail(3).setConstant(kWrist);
    told.gear_damping =
        2 * kGearRatio * told.gear_stiffness.cwiseProduct(told.reflected_inertia).cwiseSqrt();
    told.position_sensor = sensor;
    model = controller::RobotModel::from_urdf_file(path(arm), arm.base, arm.tip, told);
    sim::RobotParameters parameters;
    parameters.reflected_inertia = told.reflected_inertia;
    parameters.gear_stiffness = told.gear_stiffness;
    parameters.gear_damping = told.gear_damping;
    robot = sim::Robot::from_file(path(arm), arm.base, arm.tip, parameters);
    options.coulomb_friction = false;  // it would calm what vibrates
    if (sensor == controller::PositionSensor::kLink) {
      options.position_sensor = sim::PositionSensor::kLink;
    }
  }

  static std::string path(const ElasticArm& arm) {
    return std::string(DASHPOT_SOURCE_DIR "/sim/models/") + arm.file + ".urdf";
  }
  JointVector weight(const JointVector& q) const {
    return controller::evaluate(model, q, JointVector::Zero(q.size())).gravity;
  }
};

/// A posture within the limits, and within a turn.
JointVector posture(const controller::Limits& limits, testing::Dice& dice) {
  JointVector q(limits.position_lower.size());
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    q[i] = dice.uniform(std::max(limits.position_lower[i], -3.0) + 0.15,
                        std::min(limits.position_upper[i], 3.0) - 0.15);
  }
  return q;
}

constexpr double kGrowth = 1e-6;  // of |z|, within the errors of the differences

struct Calm {
  int postures = 0, refused = 0, unstable = 0;
  int drifting = 0;          ///< with motions too slow to be vibrations that grow
  double worst = 0;          ///< largest growth of a motion in a tick, |z|
  double margin = 0;         ///< that the judge gave the worst posture
  std::string status = "-";  ///< of a controller that does not act linearly
  bool refused_all = false;  ///< when the controller is made
};

/// The loop that holds the arm at q in a mode, from tick to tick.
MatrixXd loop_of(const Gears& gears, const controller::Settings& settings,
                 const testing::ArmMap& map, const JointVector& q, Mode mode,
                 controller::Status& status) {
  controller::Controller controller(gears.model, settings);
  controller::Setpoint setpoint = settings.initial;
  setpoint.mode = mode;
  setpoint.joint_position = q;
  const auto there = controller::evaluate(gears.model, q, JointVector::Zero(q.size()));
  setpoint.tip_pose = {there.p_BT_B, there.R_BT};
  const MatrixXd F = testing::feedback(controller, setpoint, q, there.gravity, 0.7, status);
  return map.closed(F, settings.period, 0, 0);
}

/// One arm and sensor: how many postures the judge refuses, and in how many
/// others a motion grows, in either mode. Where the drives cannot hold the
/// weight, there is no posture.
Calm calm_of(const ElasticArm& arm, controller::PositionSensor sensor, long postures,
             std::uint64_t seed) {
  const Gears gears(arm, sensor);
  controller::Settings settings = controller::default_settings(gears.model);
  settings.watchdog.feedback = 0;
  settings.analysis.where = controller::Analysis::Where::kOff;
  const controller::Gains& gains = settings.initial.gains;
  controller::GainJudge judge(gears.model, settings);
  testing::Dice dice(seed);
  sim::Arm body(gears.robot, gears.options);
  Calm calm;
  calm.refused_all = judge.judge_anywhere(gains).margin < settings.limits.gain_margin;
  try {
    (void)controller::Controller(gears.model, settings);
  } catch (const controller::InvalidSettings&) {  // the brake is too stiff for the gears
    calm.refused_all = true;
  }
  while (calm.postures < postures && !calm.refused_all) {
    const JointVector q = posture(settings.limits, dice);
    const JointVector weight = gears.weight(q);
    if ((weight.array().abs() > 0.9 * settings.limits.torque.array()).any()) continue;
    ++calm.postures;
    const double margin = judge.judge(q, gains).margin;
    if (margin < settings.limits.gain_margin) {
      ++calm.refused;
      continue;
    }
    const testing::ArmMap map(body, q, settings.period,
                              [&](const JointVector& at) { return gears.weight(at); });
    double worst = 0;
    bool drifts = false;
    for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
      controller::Status status{};
      const MatrixXd loop = loop_of(gears, settings, map, q, mode, status);
      const double T = settings.period;
      worst = std::max(worst, testing::spectral_radius(loop, T, controller::kSlowestVibration));
      drifts = drifts || testing::spectral_radius(loop, T) > 1 + kGrowth;
      if (status != controller::Status::kOk) calm.status = to_text(status);
    }
    if (worst > 1 + kGrowth) {
      ++calm.unstable;
    } else if (drifts) {
      ++calm.drifting;
    }
    if (worst <= calm.worst) continue;
    calm.worst = worst;
    calm.margin = margin;
  }
  return calm;
}

const char* side_of(controller::PositionSensor sensor) {
  return sensor == controller::PositionSensor::kLink ? "link" : "motor";
}
constexpr controller::PositionSensor kSides[] = {controller::PositionSensor::kMotor,
                                                 controller::PositionSensor::kLink};

void print_gears() {
  std::printf(
      "gears of %.0e N m/rad, %.0e in the last three joints, ratio "
      "%.2f; published rotors or %.1f "
      "kg "
      "m^2\n\n",
      kShoulder, kWrist, kGearRatio, kRotor);
}

bool stay_calm(const Request& request) {
  print_gears();
  std::printf("default gains, seed %llu\n%-12s %-6s %9s %8s %9s %7s %12s %8s  %s\n",
              static_cast<unsigned long long>(request.seed), "arm", "sensor", "postures", "refused",
              "unstable", "drifts", "worst |z|-1", "margin", "status");
  int unstable = 0;
  for (const ElasticArm& arm : kElasticArms) {
    for (const controller::PositionSensor sensor : kSides) {
      const Calm calm = calm_of(arm, sensor, request.whole(), request.seed);
      unstable += calm.unstable;
      if (calm.refused_all) {
        std::printf("%-12s %-6s refused when the controller is made\n", arm.file, side_of(sensor));
      } else {
        std::printf("%-12s %-6s %9d %8d %9d %7d %12.2e %8.3g  %s\n", arm.file, side_of(sensor),
                    calm.postures, calm.refused, calm.unstable, calm.drifting, calm.worst - 1,
                    calm.margin, calm.status.c_str());
      }
      std::fflush(stdout);
    }
    if (request.brief) break;
  }
  std::printf("\n%d loops that are not refused are unstable\n", unstable);
  return unstable == 0;
}

/// Measures of a stop, of the links.
struct Stop {
  double tenth = -1;   ///< s, until a tenth of the speed is left for good; -1: never
  double way = 0;      ///< of joint 1, degrees
  double fastest = 0;  ///< joint speed over its limit, from 0.1 s on
  double last = 0;     ///< the same in the last 0.3 s: what chatters
  controller::Status status = controller::Status::kOk;
};

/// Joint 1 at 0.9 of its velocity limit, in the middle of the others' ranges; a
/// gap of 20 ms.
Stop stop_of(const Gears& gears, double stopping_time) {
  const int kTicks = stopping_time < 0.1 ? 2500 : 6000;
  controller::Settings settings = controller::default_settings(gears.model);
  settings.limits.beyond_model = true;
  settings.limits.stopping_time = stopping_time;
  settings.analysis.where = controller::Analysis::Where::kOff;
  const controller::Limits& limits = settings.limits;
  JointVector q = 0.5 * (limits.position_lower.cwiseMax(-3) + limits.position_upper.cwiseMin(3));
  q.tail(q.size() - 1).array() += 0.3;  // not stretched
  JointVector v = JointVector::Zero(q.size());
  v[0] = 0.9 * limits.velocity[0];
  sim::Arm body(gears.robot, gears.options);
  sim::PlantOptions options = testing::exact_steps(settings.period);
  options.integrator.absolute_tolerance = options.integrator.relative_tolerance = 1e-9;
  options.delay = 1;
  options.initial_torque = gears.weight(q);
  sim::Plant plant(body, options, q, v);
  controller::Controller controller(gears.model, settings);
  controller.reset(options.initial_torque);
  controller::RobotState state;
  JointVector torque = options.initial_torque;
  Stop stop;
  const JointVector start = plant.position();
  for (int tick = 0; tick < kTicks; ++tick) {
    state.time = 1'000'000 * tick + (tick > 0 ? 20'000'000 : 0);
    state.position = plant.measured().position;
    state.velocity = plant.measured().velocity;
    stop.status = controller.update(state, torque);
    if (plant.step(torque) != sim::Status::kOk) throw std::runtime_error("the simulation failed");
    const double share = plant.velocity().cwiseAbs().cwiseQuotient(limits.velocity).maxCoeff();
    stop.way =
        std::max(stop.way, std::abs(plant.position()[0] - start[0]) * 180 / std::numbers::pi);
    if (tick >= 100) stop.fastest = std::max(stop.fastest, share);
    if (tick >= kTicks - 300) stop.last = std::max(stop.last, share);
    if (share > 0.09) {
      stop.tenth = -1;
    } else if (stop.tenth < 0) {
      stop.tenth = 0.001 * tick;
    }
  }
  return stop;
}

bool stop_all(const Request& request) {
  constexpr double kStill = 0.05;
  print_gears();
  std::printf(
      "joint 1 at 0.9 of its velocity limit, a gap, a tick of "
      "delay\n%-12s %-6s %6s %7s %8s "
      "%9s %9s  %s\n",
      "arm", "sensor", "T, s", "tenth, s", "way, deg", "after 0.1", "at last", "status");
  int chatter = 0;
  for (const ElasticArm& arm : kElasticArms) {
    for (const controller::PositionSensor sensor : kSides) {
      const Gears gears(arm, sensor);
      // A brake on the links needs time.
      const bool link = sensor == controller::PositionSensor::kLink;
      for (const double T : {link ? 0.2 : 0.05, link ? 1.2 : 0.2}) {
        Stop stop;
        try {
          stop = stop_of(gears, T);
        } catch (const controller::InvalidSettings& refused) {
          std::printf("%-12s %-6s %6.2f refused: %s\n", arm.file, side_of(sensor), T,
                      refused.what());
          continue;
        }
        chatter += stop.last > kStill;
        std::printf("%-12s %-6s %6.2f %7.3f %8.1f %9.3f %9.3f  %s%s\n", arm.file, side_of(sensor),
                    T, stop.tenth, stop.way, stop.fastest, stop.last, to_text(stop.status),
                    stop.last > kStill ? " (chatters)" : "");
        std::fflush(stdout);
      }
    }
    if (request.brief) break;
  }
  std::printf("\n%d stops chatter\n", chatter);
  return chatter == 0;
}

bool predict(const Request& request) {
  testing::ElasticDifferences all;
  long off = 0;
  for (long k = 0; k < request.whole(); ++k) {
    const std::uint64_t seed = request.seed + static_cast<std::uint64_t>(k);
    const testing::ElasticDifference seen = testing::DrawnElasticLoop(seed).compare();
    all.add(seen);
    if (seen.agrees()) continue;
    ++off;
    std::cout << "seed " << seed << ": " << seen << std::endl;
  }
  all.print();
  return off == 0;
}

bool run(const Request& request) {
  if (request.kind == "modes") return predict(request);
  return request.kind == "calm" ? stay_calm(request) : stop_all(request);
}

const AddPart part({"elastic",
                    13,
                    "Arms whose gears bend: calm at every posture with default gains, or "
                    "refused; and stopped by the brake",
                    "COUNT",
                    {{400, 12, "modes", "predicted modes and margins of so many loops, simulated"},
                     {500, 3, "calm", "default gains, at so many postures of each arm"},
                     {1, 1, "stop", "the brake, from 0.9 of a velocity limit", false}},
                    run,
                    {"SEED"}});

}  // namespace
}  // namespace dashpot::stress
