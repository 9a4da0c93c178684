// `dashpot command`: one command to a running loop, and the answer of the loop.
#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/lcmtypes/command_filter.hpp>
#include <dashpot/lcmtypes/command_t.hpp>
#include <dashpot/lcmtypes/command_verdict.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <array>
#include <chrono>
#include <cmath>
#include <lcm/lcm-cpp.hpp>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace dashpot::apps {
namespace {

struct CommandOptions {
  std::string url;
  double timeout = 2;  ///< s, for a first state, and then for the answer
  std::string mode, joint_position, tip_position, tip_quaternion, wrench;
  std::string stiffness, damping, joint_stiffness, joint_damping, null_stiffness, null_damping;
  std::optional<double> damping_ratio, joint_damping_ratio;
  std::string payload;
  bool release = false, anyway = false;
};

/// Fills an array or vector of the message.
template <class Values>
void take(const std::string& option, const std::string& text, const text::Units& units,
          Values& values) {
  const Eigen::VectorXd given = parse_quantities(option, text, units);
  for (Eigen::Index i = 0; i < given.size(); ++i) values[static_cast<std::size_t>(i)] = given[i];
}

/// Fills the diagonal of a matrix of the message.
template <class Rows>
void take_diagonal(const std::string& option, const std::string& text, const text::Units& units,
                   Rows& rows) {
  const Eigen::VectorXd given = quantities_per_joint(option, text, units);
  for (std::size_t i = 0; i < units.size(); ++i) {
    rows[i][i] = given[static_cast<Eigen::Index>(i)];
  }
}

const text::Units kTaskStiffnessUnits = {"N/m", "N/m", "N/m", "N m/rad", "N m/rad", "N m/rad"};
const text::Units kTaskDampingUnits = {"N s/m",     "N s/m",     "N s/m",
                                       "N m s/rad", "N m s/rad", "N m s/rad"};

/// The gains of the options, in `command`.
void take_gains(const CommandOptions& options, std::size_t n, command_t& command) {
  if (!options.stiffness.empty() || !options.damping.empty()) {
    if (options.stiffness.empty()) throw InputError("--damping", "needs --stiffness beside it");
    if (options.damping.empty() && !options.damping_ratio) {
      throw InputError("--stiffness", "needs --damping or --damping-ratio beside it");
    }
    command.parts |= command_t::TASK_GAINS;
    take_diagonal("--stiffness", options.stiffness, kTaskStiffnessUnits, command.task_stiffness);
    if (!options.damping.empty()) {
      take_diagonal("--damping", options.damping, kTaskDampingUnits, command.task_damping);
    }
    for (std::size_t i = 0; i < 6; ++i) command.directions[i] = command.task_stiffness[i][i] > 0;
  }
  if (options.damping_ratio && !options.damping.empty()) {
    throw InputError("--damping-ratio", "stands beside --damping; one of them is wanted");
  }
  if (options.damping_ratio) {
    command.parts |= command_t::TASK_RATIO;
    command.task_damping_ratio = *options.damping_ratio;
  }
  const text::Units stiffness(n, "N m/rad"), damping(n, "N m s/rad");
  if (!options.joint_stiffness.empty() || !options.joint_damping.empty()) {
    if (options.joint_stiffness.empty() ||
        (options.joint_damping.empty() && !options.joint_damping_ratio)) {
      throw InputError("--joint-stiffness", "goes with --joint-damping or --joint-damping-ratio");
    }
    command.parts |= command_t::JOINT_GAINS;
    take_diagonal("--joint-stiffness", options.joint_stiffness, stiffness, command.joint_stiffness);
    if (!options.joint_damping.empty()) {
      take_diagonal("--joint-damping", options.joint_damping, damping, command.joint_damping);
    }
  }
  if (options.joint_damping_ratio) {
    command.parts |= command_t::JOINT_RATIO;
    command.joint_damping_ratio = *options.joint_damping_ratio;
  }
  if (options.null_stiffness.empty() != options.null_damping.empty()) {
    throw InputError("--null-stiffness", "goes with --null-damping");
  }
  if (!options.null_stiffness.empty()) {
    command.parts |= command_t::NULL_GAINS;
    const auto fill = [n](const char* option, const std::string& text, const text::Units& units,
                          std::vector<double>& values) {
      const Eigen::VectorXd given = quantities_per_joint(option, text, units);
      values.assign(given.begin(), given.begin() + static_cast<std::ptrdiff_t>(n));
    };
    fill("--null-stiffness", options.null_stiffness, stiffness, command.null_stiffness);
    fill("--null-damping", options.null_damping, damping, command.null_damping);
  }
}

/// The command for the loop of this state. Throws InputError.
command_t make_command(const CommandOptions& options, const state_t& state) {
  const auto n = static_cast<std::size_t>(state.n);
  command_t command{};
  command.n = state.n;
  command.joint_position.assign(n, 0);
  command.tip_quaternion[0] = command.tool_quaternion[0] = 1;
  command.joint_stiffness.assign(n, std::vector<double>(n));
  command.joint_damping = command.joint_stiffness;
  command.null_stiffness.assign(n, 0);
  command.null_damping.assign(n, 0);
  const bool pose = !options.tip_position.empty() || !options.tip_quaternion.empty();
  if (options.mode == "joint" && pose) {
    throw InputError("--mode", "joint has no goal of the tip; cartesian has");
  }
  if (!options.mode.empty()) {
    command.parts |= command_t::MODE;
    command.mode = options.mode == "joint" ? command_t::JOINT : command_t::CARTESIAN;
  }
  if (!options.joint_position.empty()) {
    command.parts |= command_t::JOINT_POSITION;
    take("--joint-position", options.joint_position, text::Units(n, "rad"), command.joint_position);
  }
  if (pose) {
    command.parts |= command_t::TIP_POSE;  // omitted parts stay where the springs are fixed
    std::copy_n(state.reference_tip_position, 3, command.tip_position);
    std::copy_n(state.reference_tip_quaternion, 4, command.tip_quaternion);
    if (!options.tip_position.empty()) {
      take("--tip-position", options.tip_position, text::Units(3, "m"), command.tip_position);
    }
    if (!options.tip_quaternion.empty()) {
      take("--tip-quaternion", options.tip_quaternion, text::Units(4, ""), command.tip_quaternion);
    }
  }
  if (!options.wrench.empty()) {
    command.parts |= command_t::WRENCH;
    take("--wrench", options.wrench, {"N", "N", "N", "N m", "N m", "N m"}, command.wrench);
  }
  take_gains(options, n, command);
  if (!options.payload.empty()) {
    command.parts |= command_t::PAYLOAD;
    std::array<double, 4> body{};
    const bool center = options.payload.find(',') != std::string::npos;
    take("--payload", options.payload,
         center ? text::Units{"kg", "m", "m", "m"} : text::Units{"kg"}, body);
    command.payload_mass = body[0];
    std::copy_n(body.begin() + 1, 3, command.payload_center);
  }
  if (options.release) {
    if (state.fault_tick == 0) throw InputError("--release", "no fault is latched");
    command.parts |= command_t::RELEASE;
    command.fault_tick = state.fault_tick;
  }
  if (command.parts == 0) throw InputError("", "says nothing; see dashpot command --help");
  return command;
}

/// Refuses options that are wrong for any loop. Throws InputError.
void check(const CommandOptions& options) {
  state_t any{};
  any.fault_tick = 1;
  any.n = 1;
  for (const std::string* list :
       {&options.joint_position, &options.joint_stiffness, &options.joint_damping,
        &options.null_stiffness, &options.null_damping}) {
    const auto commas = std::count(list->begin(), list->end(), ',');
    any.n = std::max(any.n, 1 + static_cast<std::int32_t>(std::min<std::ptrdiff_t>(commas, 15)));
  }
  make_command(options, any);
}

/// rad, from one orientation to another, both w, x, y, z.
double turn(const double (&from)[4], const Eigen::Quaterniond& to) {
  const Eigen::Quaterniond begin(from[0], from[1], from[2], from[3]);
  return begin.normalized().angularDistance(to.normalized());
}

/// The judgement of a loop with the default limits but without limits of joint positions.
lcmtypes::CommandFilter judged(const command_t& command) {
  lcmtypes::CommandLimits usual;
  usual.position_upper.setConstant(command.n, std::numeric_limits<double>::infinity());
  usual.position_lower = -usual.position_upper;
  lcmtypes::CommandFilter filter(usual);
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(command.getEncodedSize()));
  command.encode(bytes.data(), 0, command.getEncodedSize());
  filter.judge(bytes.data(), bytes.size(), command.utime, 1);
  return filter;
}

/// Refuses a command that is likely to be a mistake in view of the loop's state. Throws InputError.
void doubt(const command_t& command, const state_t& state) {
  constexpr const char* kAnyway = "; --anyway sends it";
  const double reach = Eigen::Map<const Eigen::Vector3d>(state.tip_position).norm();
  const controller::Gains gains = judged(command).command().setpoint.gains;
  const std::string soft = controller::soft_stiffness(gains);
  for (const std::string& said : controller::doubtful_gains(std::max(1.0, reach), gains)) {
    // Softer springs are safe, and perhaps urgent.
    if (said != soft) throw InputError("", said + kAnyway);
    print_error("warning: " + said);
  }
  if ((command.parts & command_t::TIP_POSE) == 0) return;
  constexpr double kFar = 1, kShare = 0.25;  // rad; of the turn
  const double(&q)[4] = command.tip_quaternion;
  const double told = turn(state.reference_tip_quaternion, {q[0], q[1], q[2], q[3]});
  const double other = turn(state.reference_tip_quaternion, {q[3], q[0], q[1], q[2]});
  if (told < kFar || other > kShare * told) return;
  std::ostringstream text;
  text.precision(3);
  text << "turns the tip by " << 180 / std::numbers::pi * told << " deg, as x,y,z,w by "
       << 180 / std::numbers::pi * other << " deg: w comes first" << kAnyway;
  throw InputError("--tip-quaternion", text.str());
}

/// The reason for a refusal: the loop's verdict, and the judgement by the default limits.
std::string refusal(const command_t& command, lcmtypes::CommandVerdict verdict) {
  const lcmtypes::CommandFilter usual = judged(command);
  if (usual.tally().last_refusal == verdict) return usual.last_reason();
  std::string text = lcmtypes::to_text(verdict);
  if (verdict == lcmtypes::CommandVerdict::kOutOfLimits) {
    text += (command.parts & command_t::JOINT_POSITION) != 0
                ? ": --joint-position is beyond limits.position_lower, _upper, or in deg without "
                  "its unit"
                : ": beyond limits that its configuration sets under commands";
  }
  return text + "; the summary of the loop says more";
}

void send(const CommandOptions& options) {
  check(options);
  const std::string url = options.url.empty() ? lcmtypes::default_url() : options.url;
  std::shared_ptr<lcm::LCM> bus;
  try {
    bus = lcmtypes::open_bus(url);
  } catch (const std::runtime_error& error) {
    throw InputError("--lcm-url", error.what());
  }
  lcmtypes::MessageHandlers handlers;
  std::optional<state_t> state;
  int backward = 0;  // ticks of one loop rise
  handlers.on_state = [&](const state_t& message) {
    if (state && message.tick < state->tick) ++backward;
    state = message;
  };
  lcmtypes::BusReader reader(bus, handlers);
  const auto until = [&](double seconds, const auto& done) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (!done() && std::chrono::steady_clock::now() < end) reader.wait(50);
    return done();
  };
  if (!until(options.timeout, [&] { return state.has_value(); })) {
    throw std::runtime_error("no loop publishes states on " + url +
                             "; is one running, and with this --lcm-url?");
  }
  constexpr double kListened = 0.1;  // s
  constexpr int kInterleaved = 3;
  if (until(kListened, [&] { return backward >= kInterleaved; })) {
    throw std::runtime_error("several loops publish states on " + url +
                             ", and each would take the command: give each a bus of its own");
  }
  command_t command = make_command(options, *state);
  std::random_device random;
  command.sender = 1 + static_cast<std::int64_t>(random());
  if (!options.anyway) doubt(command, *state);
  const auto publish = [&] {
    ++command.sequence;
    command.utime = std::chrono::duration_cast<std::chrono::microseconds>(
                        std::chrono::system_clock::now().time_since_epoch())
                        .count();
    bus->publish(lcmtypes::kCommandChannel, &command);
  };
  publish();
  // Only the sender of an accepted command commands the arm: counters include others' commands.
  const auto commands = [&] { return state->commander == command.sender; };
  const auto refused = [&] { return state->last_refused_sender == command.sender; };
  if (!until(options.timeout, [&] { return refused() || commands(); })) {
    command.parts = command_t::GIVE_UP;  // a late answer must not leave the arm commanded
    publish();
    throw std::runtime_error(
        "no answer; does the loop take commands (dashpot run --commands)? If it does, "
        "the command may still act");
  }
  if (!commands()) {
    throw std::runtime_error(
        "refused: " + refusal(command, static_cast<lcmtypes::CommandVerdict>(state->last_refusal)));
  }
  // The next sender may be another call of this program. If this message is lost, the loop's
  // time limit on silence ends the command of this sender.
  command.parts = command_t::GIVE_UP;
  for (int i = 0; i < 10 && commands(); ++i) {
    publish();
    until(0.2, [&] { return !commands(); });
  }
  print("accepted\n");
}

}  // namespace

void add_command(CLI::App& program) {
  CLI::App* command = program.add_subcommand("command", "A command to a loop that runs, over LCM");
  const auto options = std::make_shared<CommandOptions>();
  const auto add = [&](const char* name, std::string CommandOptions::*member, const char* help,
                       const char* words) {
    return command->add_option(name, (*options).*member, help)->option_text(words);
  };
  add("--mode", &CommandOptions::mode, "Where springs are fixed", "joint|cartesian")
      ->check(CLI::IsMember({"joint", "cartesian"}));
  add("--joint-position", &CommandOptions::joint_position,
      "Goal of the joints, or the posture in mode cartesian, rad or m", "a,b,...");
  add("--tip-position", &CommandOptions::tip_position, "Goal of the tip, m", "x,y,z");
  add("--tip-quaternion", &CommandOptions::tip_quaternion, "Its orientation", "w,x,y,z");
  add("--wrench", &CommandOptions::wrench, "Additional wrench of the tip, N and N m",
      "x,y,z,rx,ry,rz");
  add("--stiffness,--task-stiffness", &CommandOptions::stiffness, "Diagonal, N/m and N m/rad",
      "x,y,z,rx,ry,rz");
  add("--damping,--task-damping", &CommandOptions::damping, "Diagonal, N s/m and N m s/rad",
      "x,y,z,rx,ry,rz");
  command
      ->add_option("--damping-ratio", options->damping_ratio,
                   "Damping ratio of every mode of the task")
      ->transform(damping_ratio())
      ->option_text("Z");
  add("--joint-stiffness", &CommandOptions::joint_stiffness, "Stiffness of the joints, N m/rad",
      "a,b,...|x");
  add("--joint-damping", &CommandOptions::joint_damping, "Damping of the joints, N m s/rad",
      "a,b,...|x");
  command
      ->add_option("--joint-damping-ratio", options->joint_damping_ratio,
                   "Damping ratio of every mode of the joint springs")
      ->transform(damping_ratio())
      ->option_text("Z");
  add("--null-stiffness", &CommandOptions::null_stiffness,
      "Toward the posture, in the motions that the task leaves free", "a,b,...|x");
  add("--null-damping", &CommandOptions::null_damping, "Damping of the same motions", "a,b,...|x");
  add("--payload", &CommandOptions::payload,
      "What the arm carries: mass, and center in the tip's axes; kg, m", "m[,x,y,z]");
  command->add_flag("--release", options->release, "Release the latched fault");
  command->add_flag(
      "--anyway", options->anyway,
      "Send values that look like another order, or like a ratio instead of a damping");
  add("--lcm-url", &CommandOptions::url,
      "Bus; by default LCM_DEFAULT_URL, or multicast within this machine", "URL");
  command->add_option("--timeout", options->timeout, "For a state, and for the answer, s")
      ->transform(quantity("s", 0.01, 3600, "a time from 0.01 to 3600 s"))
      ->option_text("S (2)");
  command->footer(std::string("The loop has to take commands: dashpot run --commands, dashpot "
                              "drive --commands.\n") +
                  kUnitsHelp + "\n" + kExitStatusHelp);
  command->callback([options] { send(*options); });
}

}  // namespace dashpot::apps
