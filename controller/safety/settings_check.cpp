#include <dashpot/controller/base/settings_table.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/controller/model/moved_links.hpp>
#include <dashpot/controller/safety/brake.hpp>
#include <dashpot/controller/safety/safety_filter.hpp>
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/text/printable.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <numbers>
#include <sstream>
#include <string_view>
#include <tuple>

namespace dashpot::controller {
namespace {

constexpr double kLongStop = 0.5;  // s, ten times as long as by default

[[noreturn]] void fail(const std::string& key, double value, const std::string& unit,
                       const std::string& reason) {
  throw InvalidSettings(
      key, "is " + text::number(value) + (unit.empty() ? "" : " ") + unit + ", " + reason);
}

/// Checks the sizes and ranges of the settings that the table has.
class RangeCheck {
 public:
  explicit RangeCheck(Eigen::Index n) : n_(n) {}

  void operator()(const Setting& setting, double value) const {
    check(setting, setting.key, value);
  }
  void operator()(const Setting& setting, int value) const { check(setting, setting.key, value); }
  void operator()(const Setting& setting, const JointVector& values) const {
    if (values.size() != n_) {
      throw InvalidSettings(setting.key, "has " + std::to_string(values.size()) +
                                             " entries, the robot has " + std::to_string(n_) +
                                             " joints");
    }
    for (Eigen::Index i = 0; i < n_; ++i) {
      check(setting, std::string(setting.key) + "[" + std::to_string(i) + "]", values[i]);
    }
  }
  void operator()(const Setting& setting, const Vector6& values) const {
    for (Eigen::Index i = 0; i < 6; ++i) {
      check(setting, std::string(setting.key) + "[" + std::to_string(i) + "]", values[i]);
    }
  }
  template <class Choice>
  void operator()(const Setting& /*setting*/, Choice /*value*/) const {}

 private:
  static void check(const Setting& setting, const std::string& key, double value) {
    if (value == setting.none || setting.range.has(value)) return;
    throw InvalidSettings(key, text::complaint(setting.range, value, setting.unit));
  }

  Eigen::Index n_;
};

/// The unit in which a number that is too large in `unit` was probably meant, and its size there.
struct OtherUnit {
  std::string_view unit, meant;
  double size;
};
constexpr std::array<OtherUnit, 8> kOtherUnits = {{{"rad", "deg", std::numbers::pi / 180},
                                                   {"rad/s^2", "deg/s^2", std::numbers::pi / 180},
                                                   {"m/s^2", "mm/s^2", 1e-3},
                                                   {"", "%", 1e-2},
                                                   {"rad/s", "deg/s", std::numbers::pi / 180},
                                                   {"m", "mm", 1e-3},
                                                   {"m/s", "mm/s", 1e-3},
                                                   {"s", "ms", 1e-3}}};

/// Refuses values beyond the model's limits, and values that no arm of its size needs.
class ScaleCheck {
 public:
  explicit ScaleCheck(const RobotModel& model) : model_(model) {
    double along = 0, around = 0, power = 0;  // m/s, rad/s, W, with all joints at their limits
    const double reach = reach_of(kdl_chain(model), model.joints());
    for (const Joint& joint : model.joints()) {
      const bool slides = joint.type == JointType::kPrismatic;
      along += slides ? joint.velocity : reach * joint.velocity;
      around += slides ? 0 : joint.velocity;
      power += joint.effort * joint.velocity;
    }
    const char* fastest = "the fastest that the model's joints move the tip, ";
    const char* span = "twice the arm's reach, ";
    const char* times = "a reasonable time, ";
    const char* motion = "what an arm may need, ";
    most_ = {{"limits.tip_velocity", along, fastest},
             {"motion.linear_velocity", along, fastest},
             {"motion.angular_velocity", around, fastest},
             {"limits.linear_error", 2 * reach, span},
             {"limits.angular_error", std::numbers::pi, "half a turn, "},
             {"limits.power", power, "what the model's joints give, "},
             {"limits.external_force", 5000, motion},
             {"motion.linear_acceleration", 100, motion},
             {"motion.angular_acceleration", 200, motion},
             {"integral.force", 2000, motion},
             {"integral.moment", 1000, motion},
             {"watchdog.start_torque", 5, "a share that is of use, "},
             {"control.period", 0.1, times},
             {"limits.stopping_time", 5, times},
             {"motion.gain_time", 60, times},
             {"integral.time", 60, times},
             {"watchdog.longest_gap", 1, times},
             {"watchdog.setpoint_hold", 60, times},
             {"watchdog.setpoint_damp", 60, times},
             {"watchdog.feedback", 10, times},
             {"watchdog.release_after", 600, times}};
  }

  void operator()(const Setting& setting, double value) const {
    for (const Most& most : most_) {
      if (most.key != setting.key || value == setting.none) continue;
      check(most.key, value, most.value, setting.unit, most.what);
    }
  }
  void operator()(const Setting& setting, const JointVector& values) const {
    const std::string_view key = setting.key;
    for (int i = 0; i < model_.dof(); ++i) {
      const Joint& joint = model_.joints()[static_cast<std::size_t>(i)];
      const std::string entry = std::string(key) + "[" + std::to_string(i) + "]";
      const std::string unit =
          joint.type == JointType::kPrismatic ? setting.prismatic : setting.unit;
      const std::string what = "the model's limit of joint '" + joint.name + "', ";
      if (key == "limits.torque" || key == "integral.torque" || key == "limits.external_torque") {
        if (values[i] != setting.none) check(entry, values[i], joint.effort, unit, what);
      } else if (key == "limits.torque_rate") {  // all of the torque within a millisecond
        check(entry, values[i], 1000 * joint.effort, unit, "1000/s times " + what);
      } else if (key == "motion.acceleration") {
        check(entry, values[i], 200, unit, "what an arm may need, ");
      } else if (key == "limits.velocity" || key == "motion.velocity") {
        check(entry, values[i], joint.velocity, unit, what);
      } else if (key == "limits.position_upper") {
        check(entry, values[i], joint.upper, unit, what, kPositions);
      } else if (key == "limits.position_lower") {
        check(entry, -values[i], -joint.lower, unit, what, kPositions, -1);
      }
    }
  }
  template <class Other>
  void operator()(const Setting& /*setting*/, const Other& /*value*/) const {}

 private:
  struct Most {
    std::string_view key;
    double value;
    const char* what;
  };
  static constexpr double kPositions = 0.01;  // rad, m: limits are written with few digits
  static constexpr double kShare = 1.01;      // likewise

  static void check(std::string_view key, double value, double most, std::string_view unit,
                    const std::string& what, double more = 0, int sign = 1) {
    const bool stated = std::isfinite(most) && (more > 0 || most > 0);
    if (!stated || value <= (more > 0 ? most + more : kShare * most)) return;
    const std::string in = unit.empty() ? "" : " " + std::string(unit);
    std::string text = "is " + text::number(sign * value) + in + ", beyond " + what +
                       text::number(sign * most) + in;
    for (const OtherUnit& other : kOtherUnits) {
      if (other.unit != unit || !(other.size * std::abs(value) <= 2 * std::abs(most))) {
        continue;
      }
      text += "; is it in " + std::string(other.meant) + "? Write '" +
              (other.meant == "%" ? text::number(other.size * value)
                                  : text::number(sign * value) + " " + std::string(other.meant)) +
              "'";
    }
    throw InvalidSettings(std::string(key), text + "; limits.beyond_model: true accepts it");
  }

  const RobotModel& model_;
  std::vector<Most> most_;
};

void need_at_most(const char* key, double value, double periods, double period) {
  if (value <= periods * period) return;
  fail(key, value, "s",
       "must be at most " + text::number(periods) + " periods, " + text::number(periods * period) +
           " s");
}

void check_walls(const std::vector<Wall>& walls) {
  if (walls.size() > kMaxWalls) {
    fail("limits.walls", static_cast<double>(walls.size()), "walls", "must be at most 8");
  }
  for (const Wall& wall : walls) {
    if (!wall.point.allFinite() || !(std::abs(wall.normal.norm() - 1) < 1e-6)) {
      throw InvalidSettings("limits.walls", "a point is not finite, or a normal not of length 1");
    }
  }
}

void check_initial(const Setpoint& initial, int n) {
  for (const auto& [key, ratio] :
       {std::pair("task_damping_ratio", initial.gains.task_damping_ratio),
        {"joint_damping_ratio", initial.gains.joint_damping_ratio}}) {
    if (!(ratio >= 0 && ratio <= kLargestDampingRatio)) {
      fail(std::string("initial.gains.") + key, ratio, "", "must be between 0 and 2");
    }
  }
  if (const SetpointFault fault = check_gains(initial.gains, initial.mode, n)) {
    throw InvalidSettings(std::string("initial.gains.") + fault.key, fault.reason);
  }
  if (!initial.wrench.allFinite()) throw InvalidSettings("initial.wrench", "is not finite");
}

/// Asks whether a damping without a number above 2 is a ratio.
std::string little_damping(const std::string& of, const std::string& unit,
                           const Eigen::VectorXd& stiffness, const Eigen::VectorXd& damping) {
  constexpr double kMostRatio = 2, kLeast = 0.1;
  const double d = damping.head(stiffness.size()).maxCoeff(), k = stiffness.maxCoeff();
  const bool ratios = damping.minCoeff() > 0 && damping.maxCoeff() <= kMostRatio;
  if (!ratios || d >= kLeast * 2 * std::sqrt(k)) return "";
  return of + " damping: " + text::number(d) + " is little beside a stiffness of " +
         text::number(k) + " " + unit + ": is it a damping ratio?";
}

}  // namespace

std::string soft_stiffness(const Gains& gains) {
  constexpr double kSlack = 5;  // N/m
  const double k = gains.task_stiffness.diagonal().head<3>().maxCoeff();
  if (!(k > 0 && k < kSlack)) return "";
  return "task stiffness: " + text::number(k) + " N/m hardly holds a tip: is it in N/mm?";
}

std::vector<std::string> doubtful_gains(const RobotModel& model, const Gains& gains) {
  return doubtful_gains(reach_of(kdl_chain(model), model.joints()), gains, model.joints());
}

std::vector<std::string> doubtful_gains(double reach, const Gains& gains,
                                        const std::vector<Joint>& joints) {
  constexpr double kFirm = 100;  // N m/rad: weaker joints may carry little
  const Vector6 K = gains.task_stiffness.diagonal(), D = gains.task_damping.diagonal();
  const bool damped = gains.task_damping_ratio == 0;
  std::vector<std::string> said;
  for (const auto& [name, of, entries] :
       {std::tuple("stiffness", "N", &K), {"damping", "N s", &D}}) {
    const double move = entries->head<3>().maxCoeff(), turn = entries->tail<3>().maxCoeff();
    if (!(move > 0) || turn <= 4 * reach * reach * move || (entries == &D && !damped)) continue;
    said.push_back(std::string("task ") + name + ": " + text::number(turn) + " " + of +
                   " m/rad against rotation is much beside " + text::number(move) + " " + of +
                   "/m against translation, which stands first: is the order another?");
  }
  said.push_back(soft_stiffness(gains));
  if (damped && gains.task_damping.isDiagonal(0)) {
    said.push_back(little_damping("task", "N/m", K.head(3), D));
  }
  for (const bool slides : {false, true}) {
    std::vector<double> k, d;
    const Eigen::Index n = gains.joint_damping_ratio == 0 ? gains.joint_stiffness.rows() : 0;
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto j = static_cast<std::size_t>(i);
      if ((j < joints.size() && joints[j].type == JointType::kPrismatic) != slides) continue;
      k.push_back(gains.joint_stiffness(i, i));
      d.push_back(gains.joint_damping(i, i));
    }
    const auto size = static_cast<Eigen::Index>(k.size());
    const Eigen::Map<const Eigen::VectorXd> stiffness(k.data(), size), damping(d.data(), size);
    if (size == 0 || (!slides && stiffness.maxCoeff() < kFirm)) continue;
    said.push_back(little_damping("joint", slides ? "N/m" : "N m/rad", stiffness, damping));
  }
  std::erase(said, "");
  return said;
}

void validate(const Settings& settings, const RobotModel& model) {
  const int n = model.dof();
  const JointVector& torque = settings.limits.torque;
  if (torque.size() == n && torque.isZero(0) && lacks_efforts(model)) {
    throw InvalidSettings("limits.torque",
                          "missing: no joint of the model has a limit of effort (0 means no "
                          "limit); set the torque of each joint, N m");
  }
  for_each_setting(settings, RangeCheck(n));
  if (!settings.limits.beyond_model) for_each_setting(settings, ScaleCheck(model));
  need_at_most("motion.smoothing", settings.motion.smoothing, kMostSmoothing, settings.period);
  need_at_most("motion.gain_time", settings.motion.gain_time, 1e6, settings.period);
  const Limits& limits = settings.limits;
  for (int i = 0; i < n; ++i) {
    if (!(limits.position_lower[i] < limits.position_upper[i])) {
      fail("limits.position_lower[" + std::to_string(i) + "]", limits.position_lower[i], "rad",
           "has to be below the upper limit");
    }
  }
  check_walls(limits.walls);
  const double far = std::max(10.0, 4 * reach_of(kdl_chain(model), model.joints()));
  for (const Wall& wall : limits.walls) {
    const double distance = wall.distance(Eigen::Vector3d::Zero());
    if (limits.beyond_model || std::abs(distance) <= far) continue;
    fail("limits.walls", std::abs(distance), "m",
         "from the base, beyond the arm's reach; is its point in mm? "
         "limits.beyond_model: true accepts it");
  }
  const Watchdog& watchdog = settings.watchdog;
  if (watchdog.setpoint_damp > 0 && watchdog.setpoint_damp < watchdog.setpoint_hold) {
    fail("watchdog.setpoint_damp", watchdog.setpoint_damp, "s",
         "before setpoint_hold, " + text::number(watchdog.setpoint_hold) +
             " s, so that hold would never act");
  }
  if (!(settings.watchdog.longest_gap > settings.period)) {
    fail("watchdog.longest_gap", settings.watchdog.longest_gap, "s", "has to exceed the period");
  }
  const double stopping = Brake(settings).stopping_time();
  const bool late = loop_lag(settings) > 2 * settings.period;  // not only a slow loop
  if (late && stopping > std::max(kLongStop, 1.01 * limits.stopping_time)) {
    fail("limits.stopping_time", limits.stopping_time, "s",
         "but a loop whose torque is " + text::number(loop_lag(settings)) +
             " s late (analysis.sampled) needs " + text::number(stopping) +
             " s: set that, or less delay and a higher cutoff");
  }
  if (settings.energy.from == Energy::From::kTank && model.elastic_joints() > 0 &&
      model.position_sensor() == PositionSensor::kLink) {
    throw InvalidSettings("control.energy",
                          "tank: needs the positions of motors, whose work it "
                          "counts; robot.position_sensor is link");
  }
  check_initial(settings.initial, n);
}

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
