#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/fake_driver/fake_driver.hpp>
#include <dashpot/lcmtypes/bus.hpp>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <ctime>
#include <exception>
#include <lcm/lcm-cpp.hpp>
#include <limits>
#include <map>
#include <memory>
#include <optional>

namespace dashpot::apps {
namespace {

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
  StatusOutlet(lcm::LCM& bus, lcmtypes::DriverKind kind, const FakeOptions& options)
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
  lcmtypes::DriverKind kind_;
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
  const auto kind = options.iiwa ? lcmtypes::DriverKind::kIiwa : lcmtypes::DriverKind::kPanda;
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
