#include <dashpot/lcmtypes/command_filter.hpp>
#include <dashpot/lcmtypes/message_check.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

namespace dashpot::lcmtypes {

using controller::Gains;
using controller::JointMatrix;
using controller::JointVector;
using controller::Matrix6;
using controller::Setpoint;

using Verdict = CommandVerdict;

namespace {

using Verdict = CommandVerdict;

constexpr std::int32_t kAllParts = 2 * command_t::TOOL_FRAME - 1;
constexpr double kUnitTolerance = 1e-3;  // of the length of a quaternion
// Relative to the largest entry; no wider than what the controller accepts
constexpr double kSymmetryTolerance = 1e-9;
constexpr double kDefiniteTolerance = 1e-11;

Verdict first_fault(std::initializer_list<Verdict> verdicts) {
  for (const Verdict verdict : verdicts) {
    if (verdict != Verdict::kAccepted) return verdict;
  }
  return Verdict::kAccepted;
}

/// Says which number is beyond its limits; in the unit `other` it would be within them.
Verdict beyond(std::string& why, const std::string& name, double value, double least, double most,
               const char* other = "") {
  std::ostringstream text;
  text << name << " is " << value << ", the limits are " << least << " to " << most;
  if (*other != 0) text << ": is it in " << other << "?";
  if (why.empty()) why = text.str();
  return Verdict::kOutOfLimits;
}

/// Returns whether every entry is finite and within [least, most].
template <class Derived>
Verdict judge_entries(std::string& why, const char* name, const Eigen::MatrixBase<Derived>& values,
                      double least, double most) {
  if (!values.allFinite()) return Verdict::kNotFinite;
  for (const double value : values.reshaped()) {
    if (!(value >= least && value <= most)) return beyond(why, name, value, least, most);
  }
  return Verdict::kAccepted;
}

/// Also requires a symmetric positive semidefinite matrix, to rounding; makes it symmetric exactly.
template <class Matrix>
Verdict judge_gains(std::string& why, const char* name, Matrix& gains, double most) {
  const Verdict entries = judge_entries(why, name, gains, -most, most);
  if (entries != Verdict::kAccepted || gains.size() == 0) return entries;
  const double largest = gains.cwiseAbs().maxCoeff();
  const double skew = (gains - gains.transpose()).cwiseAbs().maxCoeff();
  if (skew > kSymmetryTolerance * largest) return Verdict::kIndefinite;
  gains = (0.5 * (gains + gains.transpose())).eval();
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(gains, Eigen::EigenvaluesOnly);
  if (solver.info() != Eigen::Success) return Verdict::kIndefinite;
  const bool semidefinite = solver.eigenvalues().minCoeff() >= -kDefiniteTolerance * largest;
  return semidefinite ? Verdict::kAccepted : Verdict::kIndefinite;
}

JointVector to_vector(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

JointMatrix to_matrix(const std::vector<std::vector<double>>& rows) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  JointMatrix result(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    result.row(i) = to_vector(rows[static_cast<std::size_t>(i)]).transpose();
  }
  return result;
}

Matrix6 to_matrix(const double (&rows)[6][6]) {
  return Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(&rows[0][0]);
}

Verdict copy_mode(const command_t& message, Setpoint& setpoint) {
  if (message.mode != command_t::JOINT && message.mode != command_t::CARTESIAN) {
    return Verdict::kUnknown;
  }
  setpoint.mode =
      message.mode == command_t::JOINT ? controller::Mode::kJoint : controller::Mode::kCartesian;
  return Verdict::kAccepted;
}

Verdict copy_joint_position(const command_t& message, const CommandLimits& limits,
                            Setpoint& setpoint, std::string& reason) {
  constexpr double kDegree = std::numbers::pi / 180;
  const JointVector position = to_vector(message.joint_position);
  if (!position.allFinite()) return Verdict::kNotFinite;
  for (Eigen::Index i = 0; i < position.size(); ++i) {
    const double q = position[i], lower = limits.position_lower[i],
                 upper = limits.position_upper[i];
    if (q >= lower && q <= upper) continue;
    const bool degrees = kDegree * q >= lower && kDegree * q <= upper;
    const std::string name = "joint_position[" + std::to_string(i) + "]";
    return beyond(reason, name, q, lower, upper, degrees ? "deg" : "");
  }
  setpoint.joint_position = position;
  return Verdict::kAccepted;
}

/// Requires a position no further than `most` from the origin, and a quaternion.
Verdict copy_pose(std::string& why, const char* name, const double (&given)[3],
                  const double (&quaternion)[4], double most, controller::Pose& pose) {
  const Eigen::Map<const Eigen::Vector3d> position(given);
  const Eigen::Map<const Eigen::Vector4d> wxyz(quaternion);
  if (!position.allFinite() || !wxyz.allFinite()) return Verdict::kNotFinite;
  // Not stableNorm: an overflow to infinity is out of limits as well.
  const double length = position.norm();
  if (!(length <= most))
    return beyond(why, name, length, 0, most, length <= 1000 * most ? "mm" : "");
  if (!(std::abs(wxyz.norm() - 1) <= kUnitTolerance)) return Verdict::kNotUnit;
  pose.position = position;
  pose.rotation =
      Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).normalized().toRotationMatrix();
  return Verdict::kAccepted;
}

Verdict copy_wrench(const command_t& message, const CommandLimits& limits, Setpoint& setpoint,
                    std::string& why) {
  setpoint.wrench = Eigen::Map<const controller::Vector6>(message.wrench);
  return first_fault(
      {judge_entries(why, "wrench's force", setpoint.wrench.head<3>(), -limits.force, limits.force),
       judge_entries(why, "wrench's torque", setpoint.wrench.tail<3>(), -limits.torque,
                     limits.torque)});
}

Verdict copy_joint_gains(const command_t& message, const CommandLimits& limits, Gains& gains,
                         std::string& why) {
  gains.joint_stiffness = to_matrix(message.joint_stiffness);
  gains.joint_damping = to_matrix(message.joint_damping);
  return first_fault(
      {judge_gains(why, "joint_stiffness", gains.joint_stiffness, limits.joint_stiffness),
       judge_gains(why, "joint_damping", gains.joint_damping, limits.joint_damping)});
}

Verdict copy_task_gains(const command_t& message, const CommandLimits& limits, Gains& gains,
                        std::string& why) {
  if (message.frame != command_t::BASE && message.frame != command_t::TOOL) {
    return Verdict::kUnknown;
  }
  gains.frame =
      message.frame == command_t::BASE ? controller::Frame::kBase : controller::Frame::kTool;
  for (std::size_t i = 0; i < gains.directions.size(); ++i) {
    gains.directions[i] = message.directions[i] != 0;
  }
  gains.task_stiffness = to_matrix(message.task_stiffness);
  gains.task_damping = to_matrix(message.task_damping);
  return first_fault(
      {judge_gains(why, "task_stiffness", gains.task_stiffness, limits.task_stiffness),
       judge_gains(why, "task_damping", gains.task_damping, limits.task_damping)});
}

/// Gains without a ratio end it.
Verdict copy_ratio(std::string& why, const char* name, bool given, double value, double most,
                   double& ratio) {
  ratio = given ? value : 0;
  if (!given) return Verdict::kAccepted;
  if (!std::isfinite(value)) return Verdict::kNotFinite;
  if (value > 0 && value <= most) return Verdict::kAccepted;
  if (value > 0) return beyond(why, name, value, 0, most, value <= 100 * most ? "%" : "");
  std::ostringstream text;
  text << name << " is " << value << ", it has to be above 0";
  if (why.empty()) why = text.str();
  return Verdict::kOutOfLimits;
}

/// The controller judges whether a body can have this inertia.
Verdict copy_payload(const command_t& message, const CommandLimits& limits,
                     controller::Payload& payload, std::string& why) {
  using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  payload = {message.payload_mass, Eigen::Map<const Eigen::Vector3d>(message.payload_center),
             Eigen::Map<const RowMajor3>(&message.payload_inertia[0][0])};
  const Eigen::Matrix<double, 1, 1> mass(payload.mass);
  // Inertia of the whole mass at the greatest distance.
  const double most = payload.mass * limits.payload_distance * limits.payload_distance;
  return first_fault({judge_entries(why, "payload_mass", mass, 0, limits.payload),
                      judge_entries(why, "payload_center", payload.center, -limits.payload_distance,
                                    limits.payload_distance),
                      judge_entries(why, "payload_inertia", payload.inertia, -most, most)});
}

Verdict copy_tip_speed(const command_t& message, const CommandLimits& limits,
                       controller::TipSpeed& speed, std::string& why) {
  speed = {};
  for (const auto& [name, given, most, value] :
       {std::tuple("linear_velocity", message.linear_velocity, limits.linear_velocity,
                   &speed.linear),
        {"angular_velocity", message.angular_velocity, limits.angular_velocity, &speed.angular},
        {"tip_velocity", message.tip_velocity, limits.tip_velocity, &speed.limit}}) {
    if (!std::isfinite(given)) return Verdict::kNotFinite;
    const bool fits = given >= controller::TipSpeed::kLeast && given <= most;
    if (given != 0 && !fits) return beyond(why, name, given, controller::TipSpeed::kLeast, most);
    if (given > 0) *value = given;
  }
  return Verdict::kAccepted;
}

Verdict copy_null_gains(const command_t& message, const CommandLimits& limits, Gains& gains,
                        std::string& why) {
  gains.null_stiffness = to_vector(message.null_stiffness);
  gains.null_damping = to_vector(message.null_damping);
  return first_fault(
      {judge_entries(why, "null_stiffness", gains.null_stiffness, 0, limits.joint_stiffness),
       judge_entries(why, "null_damping", gains.null_damping, 0, limits.joint_damping)});
}

/// Copies the parts that `message` sets into `command`, if their values are in order: sizes, finite
/// numbers, unit quaternion, `limits`, positive semidefinite gains. Otherwise `command` is left
/// half written, and `why` says which number is beyond which limits, if one is. Does not look at
/// time and sequence.
CommandVerdict copy_values(const command_t& message, const CommandLimits& limits, Command& command,
                           std::string& why) {
  if (message.n != limits.position_lower.size()) return Verdict::kWrongSize;
  if (message.parts <= 0 || (message.parts & ~kAllParts) != 0) return Verdict::kUnknown;
  Verdict verdict = Verdict::kAccepted;
  const auto judge = [&](std::int32_t part, auto&& copy) {
    if (verdict == Verdict::kAccepted && (message.parts & part) != 0) verdict = copy();
  };
  const auto judge_ratio = [&](std::int32_t gains, std::int32_t part, const char* name,
                               double value, double& ratio) {
    judge(gains | part, [&] {
      return copy_ratio(why, name, (message.parts & part) != 0, value, limits.damping_ratio, ratio);
    });
  };
  Setpoint& setpoint = command.setpoint;
  Gains& gains = setpoint.gains;
  judge(command_t::MODE, [&] { return copy_mode(message, setpoint); });
  judge(command_t::JOINT_POSITION,
        [&] { return copy_joint_position(message, limits, setpoint, why); });
  judge(command_t::TIP_POSE, [&] {
    return copy_pose(why, "tip_position's distance", message.tip_position, message.tip_quaternion,
                     limits.reach, setpoint.tip_pose);
  });
  judge(command_t::WRENCH, [&] { return copy_wrench(message, limits, setpoint, why); });
  judge(command_t::JOINT_GAINS, [&] { return copy_joint_gains(message, limits, gains, why); });
  judge(command_t::TASK_GAINS, [&] { return copy_task_gains(message, limits, gains, why); });
  judge_ratio(command_t::JOINT_GAINS, command_t::JOINT_RATIO, "joint_damping_ratio",
              message.joint_damping_ratio, gains.joint_damping_ratio);
  judge_ratio(command_t::TASK_GAINS, command_t::TASK_RATIO, "task_damping_ratio",
              message.task_damping_ratio, gains.task_damping_ratio);
  judge(command_t::PAYLOAD, [&] { return copy_payload(message, limits, command.payload, why); });
  judge(command_t::TOOL_FRAME, [&] {
    return copy_pose(why, "tool_position's distance", message.tool_position,
                     message.tool_quaternion, limits.tool_distance, command.tool);
  });
  judge(command_t::TIP_SPEED,
        [&] { return copy_tip_speed(message, limits, command.tip_speed, why); });
  judge(command_t::NULL_GAINS, [&] { return copy_null_gains(message, limits, gains, why); });
  if (verdict != Verdict::kOutOfLimits) why.clear();  // it is about a number after the first fault
  command.parts |= message.parts;
  ++command.accepted;
  for (std::size_t bit = 0; bit < command.set_by.size(); ++bit) {
    if ((message.parts >> bit & 1) != 0) command.set_by[bit] = command.accepted;
  }
  command.utime = message.utime;
  command.sequence = message.sequence;
  if ((message.parts & command_t::RELEASE) != 0) command.fault_tick = message.fault_tick;
  return verdict;
}

/// The parts that take long to judge, before they are accepted. Goals do not: the latest of a burst
/// counts.
constexpr std::int32_t kJudged = int{command_t::JOINT_GAINS} | int{command_t::TASK_GAINS} |
                                 int{command_t::NULL_GAINS} | int{command_t::TASK_RATIO} |
                                 int{command_t::JOINT_RATIO} | int{command_t::PAYLOAD} |
                                 int{command_t::TOOL_FRAME};

}  // namespace

CommandFilter::CommandFilter(const CommandLimits& limits, CommandTaker take)
    : limits_(limits), take_(std::move(take)), tokens_(limits.burst) {
  const Eigen::Index n = limits.position_lower.size();
  if (n < 1 || limits.position_upper.size() != n) {
    throw std::invalid_argument(
        "limits of commands: position_lower and position_upper must be of one length, 1 to 16");
  }
}

CommandVerdict CommandFilter::judge(const void* data, std::size_t size, std::int64_t utime,
                                    std::int64_t steady) noexcept {
  notice_silence(steady);
  std::int64_t sender = 0;
  Verdict verdict = Verdict::kMalformed;
  try {
    reason_.clear();
    command_t message;
    if (read_sender(data, size, sender)) {
      verdict = judge_sender(sender);
      if (verdict == Verdict::kAccepted) {
        verdict = decode(data, size, message) ? judge_message(message, utime, steady)
                                              : Verdict::kMalformed;
      }
    }
    if (verdict != Verdict::kAccepted) {
      last_reason_ = to_text(verdict);
      if (!reason_.empty()) last_reason_ += ": " + reason_;
    }
  } catch (...) {  // out of memory
    verdict = Verdict::kMalformed;
  }
  ++tally_.verdicts[static_cast<std::size_t>(verdict)];
  if (verdict != Verdict::kAccepted) {
    tally_.last_refusal = verdict;
    tally_.last_refusal_utime = utime;
    tally_.last_refused_sender = sender;
  }
  return verdict;
}

void CommandFilter::notice_silence(std::int64_t steady) noexcept {
  if (steady - heard_at_ > limits_.silence) tally_.commander = 0;
}

CommandVerdict CommandFilter::judge_sender(std::int64_t sender) const noexcept {
  if (sender == 0) return Verdict::kNoSender;
  const bool free = tally_.commander == 0 || tally_.commander == sender;
  return free ? Verdict::kAccepted : Verdict::kOtherSender;
}

CommandVerdict CommandFilter::judge_message(const command_t& message, std::int64_t utime,
                                            std::int64_t steady) {
  Last* last = place_of(message.sender, steady);
  if (last == nullptr) return Verdict::kTooMany;
  const Verdict time = judge_time(message, utime, *last);
  if (time != Verdict::kAccepted) return time;
  Command next = command_;
  const Verdict values = copy_values(message, limits_, next, reason_);
  if (values != Verdict::kAccepted) return values;
  const bool releases = (message.parts & command_t::RELEASE) != 0;
  if (releases && (fault_tick_ == 0 || message.fault_tick != fault_tick_)) {
    return Verdict::kNoSuchFault;
  }
  if ((message.parts & kJudged) != 0 && !take_token(steady)) return Verdict::kTooMany;
  if (take_ && !take_(next, reason_)) return Verdict::kUnstable;
  accept(message, next, steady, *last);
  return Verdict::kAccepted;
}

CommandVerdict CommandFilter::judge_time(const command_t& message, std::int64_t utime,
                                         const Last& last) const noexcept {
  if (message.utime < utime - limits_.oldest) return Verdict::kStale;
  if (message.utime > utime + limits_.furthest) return Verdict::kFromFuture;
  const bool rises = message.utime > last.utime && message.sequence > last.sequence;
  return last.sender == message.sender && !rises ? Verdict::kReplayed : Verdict::kAccepted;
}

void CommandFilter::accept(const command_t& message, const Command& next, std::int64_t steady,
                           Last& last) {
  command_ = next;
  last = {message.sender, message.utime, message.sequence, steady};
  heard_at_ = steady;
  // A new commander finds the bucket full, however much other senders took out of it.
  if (tally_.commander != message.sender) tokens_ = limits_.burst - 1;
  tally_.commander = (message.parts & command_t::GIVE_UP) != 0 ? 0 : message.sender;
}

CommandFilter::Last* CommandFilter::place_of(std::int64_t sender, std::int64_t steady) noexcept {
  Last* unused = nullptr;
  for (Last& last : last_) {
    if (steady - last.accepted_at > limits_.oldest + limits_.furthest) last.sender = 0;
    if (last.sender == sender) return &last;
    if (last.sender == 0) unused = &last;
  }
  return unused;
}

bool CommandFilter::take_token(std::int64_t steady) noexcept {
  const double elapsed = 1e-6 * static_cast<double>(steady - tokens_at_);
  tokens_ = std::min(limits_.burst, tokens_ + limits_.most_per_second * std::max(0.0, elapsed));
  tokens_at_ = steady;
  if (tokens_ < 1) return false;
  tokens_ -= 1;
  return true;
}

}  // namespace dashpot::lcmtypes
