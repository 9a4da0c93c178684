#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/scene/scene.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/driver.hpp>

#include <CLI/CLI.hpp>
#include <Eigen/Cholesky>
#include <lcm/lcm-cpp.hpp>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <deque>
#include <exception>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>

namespace dashpot::apps {

using controller::JointMatrix;
using lcmtypes::DriverCommand;
using lcmtypes::DriverKind;

namespace {

using Seven = std::array<double, 7>;

constexpr std::int64_t kEarliest = 250'000;  // us from the first status to a command (iiwa)
constexpr std::int64_t kSilence = 50'000;    // us without a command (iiwa)
constexpr std::int64_t kExpiry = 100'000;    // us of a command's utime (Panda)
constexpr Seven kHoldStiffness = {1000, 1000, 1000, 500, 500, 500, 500};  // N m/rad (iiwa)
constexpr Seven kHoldDamping = {50, 50, 50, 50, 35, 35, 35};              // N m s/rad (iiwa)
constexpr double kVelocityCutoff = 40;                                    // Hz (iiwa)
constexpr double kTorqueCutoff = 30;                                      // Hz (Panda)
constexpr double kTorqueRate = 1000;                                      // N m/s (Panda)
constexpr std::int64_t kWithoutClock = 200;                               // statuses (iiwa)
constexpr Seven kDamping = {37.5, 50, 37.5, 25, 5, 3.75, 2.5};            // N m s/rad (Panda)

JointVector vector(const Seven& values) {
  return Eigen::Map<const Eigen::Matrix<double, 7, 1>>(values.data());
}

sim::PlantOptions plant_options(const Scene& scene) {
  sim::PlantOptions options = scene.plant;
  options.delay = 0;  // FakeDriver delays commands alone
  return options;
}

/// Returns the gain of both drivers' low-pass: y += gain (u - y) once a period.
double low_pass_gain(double cutoff, double period) {
  return period / (period + 1 / (2 * std::numbers::pi * cutoff));
}

/// A simulated arm behind a driver's messages. It behaves like the public drivers under torque
/// commands: their filters, their torque without commands, the commands that end them. A command
/// acts a period after its status, or later by the scene's `delay`.
///
/// iiwa (`--torque_only`): without a command for 0.05 s, and before the first, the driver's PD
/// controller holds the position of that moment; torques count again with the next command, without
/// blending. Velocities are differences through a low-pass of 40 Hz. utime is -1 for the first 200
/// statuses. It ends at a command within 0.25 s of the first status, and at arrays of another
/// length.
///
/// With `environment.joint_stiffness` or `joint_damping` in its scene, the iiwa is in KUKA's mode
/// Torque: these springs pull to the position commanded a period before, at first where it is.
///
/// Panda (`--control_mode torque`): a command whose utime is more than 0.1 s in the past or the
/// future does not count; without one that counts, joints are damped. Torques pass libfranka's
/// low-pass of 30 Hz and rate limit of 1000 N m/s. It ends at anything but seven torques, no
/// positions, and control mode 4.
///
/// The driver compensates gravity, so the scene's robot has none.
class FakeDriver {
 public:
  /// `scene` has to outlive it. Throws InputError.
  FakeDriver(const Scene& scene, DriverKind kind) : scene_(scene), kind_(kind) {
    if (scene.dof() != 7) throw InputError("robot", "an arm of seven joints is wanted");
    if (!scene.arm->config.robot.options.gravity.isZero(0)) {
      throw InputError("robot.gravity",
                       "must be [0, 0, 0]: the driver compensates gravity, so that none is left");
    }
    arm_.emplace(scene.arm->robot, scene.arm->options);
    plant_.emplace(*arm_, plant_options(scene), scene.start, scene.velocity);
    last_position_ = spring_rest_ = scene.start;
    velocity_ = last_torque_ = JointVector::Zero(scene.dof());
    due_.assign(static_cast<std::size_t>(std::max(scene.plant.delay, 1)), last_torque_);
  }

  double period() const noexcept { return scene_.plant.period; }
  /// Takes a command that arrived at `utime` of the driver's clock, us.
  /// Throws std::runtime_error with the reason if the command ends the driver.
  void take(const void* data, std::size_t size, std::int64_t utime) {
    DriverCommand command;
    const bool iiwa = kind_ == DriverKind::kIiwa;
    if (!decode(kind_, data, size, command)) throw std::runtime_error("a command cannot be read");
    if (iiwa && (first_ == 0 || utime - first_ < kEarliest)) {
      throw std::runtime_error("a command came within 0.25 s of the first status");
    }
    if (command.torque.size() != 7 || command.position.size() != (iiwa ? 7 : 0)) {
      throw std::runtime_error("a command has " + std::to_string(command.torque.size()) +
                               " torques and " + std::to_string(command.position.size()) +
                               " positions");
    }
    if (!command.torque.allFinite() || !command.position.allFinite()) {
      throw std::runtime_error("a command has NaN or infinity");
    }
    if (!iiwa && command.control_mode != 4) {
      throw std::runtime_error("a command expects control mode " +
                               std::to_string(command.control_mode));
    }
    if (iiwa && command_) spring_rest_ = command_->position;
    command_ = command;
    arrived_ = utime;
    ++commands_;
  }
  /// Moves the robot by one period, which ends at `utime`.
  void step(std::int64_t utime) {
    const sim::Status moved = plant_->step(torque(utime));
    if (moved != sim::Status::kOk) {
      throw std::runtime_error(std::string("the simulation ended: ") + sim::to_text(moved));
    }
    const JointVector& q = plant_->measured().position;
    velocity_ +=
        low_pass_gain(kVelocityCutoff, period()) * ((q - last_position_) / period() - velocity_);
    last_position_ = q;
    if (first_ == 0) first_ = utime;
    ++statuses_;
  }
  /// Returns the present status.
  lcmtypes::DriverStatus status(std::int64_t utime) const {
    lcmtypes::DriverStatus status;
    const bool iiwa = kind_ == DriverKind::kIiwa;
    status.utime = iiwa && statuses_ <= kWithoutClock ? -1 : utime;
    status.position = plant_->measured().position;
    if (has_springs()) status.commanded = spring_rest_;
    status.velocity = iiwa ? velocity_ : plant_->measured().velocity;
    status.torque = plant_->torque();
    status.external = JointVector::Zero(7);
    status.robot_mode = iiwa ? 0 : 2;
    return status;
  }

  double time() const noexcept { return plant_->time(); }
  std::int64_t statuses() const noexcept { return statuses_; }
  std::int64_t commands() const noexcept { return commands_; }
  /// Periods in which no command counted.
  std::int64_t uncommanded() const noexcept { return uncommanded_; }

 private:
  /// Returns the torque of this period: a command acts `delay` periods after the status that it
  /// answers.
  JointVector torque(std::int64_t utime) {
    const bool iiwa = kind_ == DriverKind::kIiwa;
    const bool counts = command_ && (iiwa ? utime - arrived_ <= kSilence
                                          : std::abs(utime - command_->utime) <= kExpiry);
    if (!counts) ++uncommanded_;
    if (!counts && !has_springs()) {
      due_.assign(due_.size(), iiwa ? resting_torque() : filtered(resting_torque()));
      return due_.front();
    }
    held_.reset();
    due_.push_back(iiwa ? torque_of_iiwa(counts) : filtered(command_->torque));
    JointVector due = due_.front();
    due_.pop_front();
    return due;
  }
  JointVector torque_of_iiwa(bool counts) const {
    if (!has_springs()) return command_->torque;
    const sim::Measurement& now = plant_->measured();
    const controller::Environment& own = scene_.arm->config.settings.environment;
    const JointVector pull = own.joint_stiffness.cwiseProduct(spring_rest_ - now.position) -
                             own.joint_damping.cwiseProduct(now.velocity);
    return counts ? JointVector(command_->torque + pull) : pull;
  }
  /// Returns the torque behind the Panda's low-pass and rate limit.
  JointVector filtered(const JointVector& torque) {
    const double most = kTorqueRate * period();
    const JointVector change = low_pass_gain(kTorqueCutoff, period()) * (torque - last_torque_);
    last_torque_ += change.cwiseMin(most).cwiseMax(-most);
    return last_torque_;
  }
  /// Returns the torque of a driver without commands: it holds, or damps.
  JointVector resting_torque() {
    const JointVector& q = plant_->measured().position;
    const JointVector& qd = plant_->measured().velocity;
    if (!held_) held_ = q;
    const bool iiwa = kind_ == DriverKind::kIiwa;
    const double h = period();
    const JointVector K = iiwa ? vector(kHoldStiffness) : JointVector(JointVector::Zero(7));
    const JointVector D = vector(iiwa ? kHoldDamping : kDamping);
    JointMatrix M = controller::evaluate(scene_.arm->config.model, q, qd).M;
    const JointVector impulse = M * qd + h * K.cwiseProduct(*held_ - q);
    M.diagonal() += h * D + h * h * K;
    const JointVector next = M.llt().solve(impulse);
    return K.cwiseProduct(*held_ - q - h * next) - D.cwiseProduct(next);
  }
  bool has_springs() const noexcept {
    const controller::Environment& own = scene_.arm->config.settings.environment;
    return kind_ == DriverKind::kIiwa &&
           !(own.joint_stiffness.isZero(0) && own.joint_damping.isZero(0));
  }

  const Scene& scene_;
  DriverKind kind_;
  std::optional<sim::Arm> arm_;
  std::optional<sim::Plant> plant_;
  std::optional<DriverCommand> command_;
  std::int64_t arrived_ = 0;              ///< when the command did, us
  std::int64_t first_ = 0;                ///< utime of the first status
  std::optional<JointVector> held_;       ///< the position that the PD holds
  JointVector spring_rest_;               ///< where KUKA's springs are fixed
  std::deque<JointVector> due_;           ///< torques that will act
  JointVector last_torque_;               ///< of the Panda's low-pass
  JointVector last_position_, velocity_;  ///< through the iiwa's low-pass
  std::int64_t statuses_ = 0, commands_ = 0, uncommanded_ = 0;
};

enum class Trouble { kNone, kStall, kDie, kNotANumber, kRepeat, kReorder, kUserStop };

struct FakeOptions {
  std::string scene, url;
  std::optional<double> duration;
  bool iiwa = false;
  bool panda = false;
  bool lock_step = false;
  std::string trouble_name;
  Trouble trouble = Trouble::kNone;
  double from = 1, lasts = 0.1;  // s
};

std::int64_t fake_utime() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::microseconds>(now).count();
}

/// What arrives on the command channel.
struct CommandInbox {
  FakeDriver& driver;
  std::int64_t now = 0;        ///< us
  std::exception_ptr failure;  ///< must not pass through LCM, which is C
  void take(const lcm::ReceiveBuffer* buffer, const std::string&) noexcept {
    try {
      driver.take(buffer->data, buffer->data_size, now);
    } catch (...) {
      failure = std::current_exception();
    }
  }
};

/// The robot's clock.
class Pace {
 public:
  explicit Pace(double period) : period_(std::llround(1e9 * period)) {
    clock_gettime(CLOCK_MONOTONIC, &deadline_);
  }
  /// Until the next period.
  void wait() {
    constexpr std::int64_t kNanoseconds = 1'000'000'000;
    const std::int64_t next = deadline_.tv_nsec + period_;
    deadline_.tv_sec += next / kNanoseconds;
    deadline_.tv_nsec = next % kNanoseconds;
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline_, nullptr) == EINTR) {
    }
  }

 private:
  std::int64_t period_;  ///< ns
  timespec deadline_{};
};

/// Publishes a status as the trouble changes it.
class StatusOutlet {
 public:
  StatusOutlet(lcm::LCM& bus, DriverKind kind, const FakeOptions& options)
      : bus_(bus), kind_(kind), options_(options) {}

  /// Returns true if anything was published.
  bool publish(lcmtypes::DriverStatus status, double time) {
    const bool troubled = time >= options_.from && time < options_.from + options_.lasts;
    const Trouble now = troubled ? options_.trouble : Trouble::kNone;
    if (now == Trouble::kStall) return false;
    if (now == Trouble::kUserStop) status.robot_mode = 5;
    if (now == Trouble::kNotANumber) {
      status.position.setConstant(std::numeric_limits<double>::quiet_NaN());
    }
    if (now == Trouble::kReorder && !kept_) {  // the next one goes first
      kept_ = status;
      return false;
    }
    send(status);
    if (now == Trouble::kRepeat) send(status);
    if (kept_) send(*kept_);
    kept_.reset();
    return true;
  }

 private:
  void send(const lcmtypes::DriverStatus& status) {
    encode(kind_, status, bytes_);
    bus_.publish(lcmtypes::profile_of(kind_).status_channel, bytes_.data(),
                 static_cast<unsigned>(bytes_.size()));
  }

  lcm::LCM& bus_;
  DriverKind kind_;
  const FakeOptions& options_;
  std::optional<lcmtypes::DriverStatus> kept_;
  std::vector<std::uint8_t> bytes_;
};

void fake_driver(const FakeOptions& options) {
  constexpr int kTry = 10, kPatience = 100;  // ms, and tries
  if (options.iiwa == options.panda) throw InputError("--iiwa, --panda", "one of them is wanted");
  if (options.iiwa && options.trouble == Trouble::kUserStop) {
    throw InputError("--trouble",
                     "user-stop is for --panda: an iiwa's status says nothing of a stop");
  }
  const auto kind = options.iiwa ? DriverKind::kIiwa : DriverKind::kPanda;
  const Scene scene = load_scene(options.scene);
  FakeDriver driver(scene, kind);
  std::shared_ptr<lcm::LCM> bus;
  try {
    bus = lcmtypes::open_bus(options.url);
  } catch (const std::runtime_error& error) {
    throw InputError("--lcm-url", error.what());
  }
  CommandInbox inbox{driver, 0, nullptr};
  bus->subscribe(lcmtypes::profile_of(kind).command_channel, &CommandInbox::take, &inbox);
  StatusOutlet outlet(*bus, kind, options);
  const StopSignal stop;
  // In lock-step not the time of day, because a period may take longer.
  const std::int64_t start = options.lock_step ? 1'000'000 : fake_utime();
  Pace pace(driver.period());
  int patience = kPatience;
  while (!StopSignal::given() && !(options.duration && driver.time() >= *options.duration)) {
    const bool in_step = options.lock_step && driver.commands() > 0;
    if (!in_step) pace.wait();
    while (bus->handleTimeout(0) > 0) {
    }
    if (inbox.failure) std::rethrow_exception(inbox.failure);
    if (options.trouble == Trouble::kDie && driver.time() >= options.from) {
      throw std::runtime_error("died, as asked for");
    }
    // In lock-step a period takes as long as its answer, so the clock shows simulated time.
    const auto simulated = static_cast<std::int64_t>(std::llround(1e6 * driver.time()));
    inbox.now = options.lock_step ? start + simulated : fake_utime();
    driver.step(inbox.now);
    const std::int64_t answered = driver.commands();
    if (!outlet.publish(driver.status(inbox.now), driver.time()) || !in_step) continue;
    for (int tries = 0; tries < patience && driver.commands() == answered; ++tries) {
      bus->handleTimeout(kTry);
      if (StopSignal::given()) break;
    }
    patience = driver.commands() == answered ? 1 : kPatience;  // silent: may stay so
  }
  print("statuses: " + std::to_string(driver.statuses()) +
        ", commands: " + std::to_string(driver.commands()) +
        ", periods in which none counted: " + std::to_string(driver.uncommanded()) + "\n");
}

}  // namespace

void add_fake_driver(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "fake-driver", "A simulated arm behind the messages of a public LCM driver");
  const auto options = std::make_shared<FakeOptions>();
  command->add_option("scene", options->scene, "Scene file: sim/scenes/drivers has examples")
      ->required()
      ->option_text("FILE");
  CLI::Option* iiwa = command->add_flag("--iiwa", options->iiwa, "As drake-iiwa-driver");
  command->add_flag("--panda", options->panda, "As drake-franka-driver")->excludes(iiwa);
  command
      ->add_option("--lcm-url", options->url,
                   "Bus; by default LCM_DEFAULT_URL, or multicast within this machine")
      ->option_text("URL");
  command->add_flag("--lock-step", options->lock_step,
                    "After the first command, each period waits for its answer, for a second at "
                    "most, whatever the clock says");
  command->add_option("--duration", options->duration, "Ends after this time, s")
      ->transform(quantity("s", 1e-3, 1e7, "a time from 1e-3 to 1e7 s"))
      ->option_text("S");
  const std::map<std::string, Trouble> troubles = {
      {"stall", Trouble::kStall},     {"die", Trouble::kDie},
      {"nan", Trouble::kNotANumber},  {"repeat", Trouble::kRepeat},
      {"reorder", Trouble::kReorder}, {"user-stop", Trouble::kUserStop}};
  CLI::Option* trouble = command
                             ->add_option("--trouble", options->trouble_name,
                                          "What goes wrong; user-stop with --panda only")
                             ->check(CLI::IsMember(troubles))
                             ->option_text("stall|die|nan|repeat|reorder|user-stop");
  command->add_option("--from", options->from, "When it begins, s (1)")
      ->needs(trouble)
      ->transform(quantity("s", 0, 1e7, "a time from 0 to 1e7 s"))
      ->option_text("S");
  command->add_option("--lasts", options->lasts, "How long it lasts, s (0.1)")
      ->needs(trouble)
      ->transform(quantity("s", 0, 1e7, "a time from 0 to 1e7 s"))
      ->option_text("S");
  command->footer("Ctrl-C ends it.\n" + std::string(kExitStatusHelp));
  command->callback([options, trouble, troubles] {
    if (trouble->count() > 0) options->trouble = troubles.at(options->trouble_name);
    fake_driver(*options);
  });
}

}  // namespace dashpot::apps
