// The input as calls of the plugin's C interface, with pointers, sizes and numbers that a broken
// host could pass. Whatever the calls, every torque is finite and within its limit.
#include <dashpot/controller/plugin.h>
#include <dashpot/tests/fuzz/fuzz_input.hpp>

#include <memory>

namespace {

using dashpot::fuzz::Bytes;
using dashpot::fuzz::require;

constexpr unsigned kJoints = 7;
constexpr std::array<double, kJoints> kStart = {0, -0.785, 0, -2.356, 0, 1.571, 0.785};
constexpr double kTorque = 87;  // N m, of the strongest joint

/// A host that calls what the bytes say.
class Host {
 public:
  Host(dashpot_controller* controller, Bytes bytes) : controller_(controller), bytes_(bytes) {}

  void run() {
    constexpr int kMostCalls = 200;
    for (int call = 0; call < kMostCalls && !bytes_.empty(); ++call) {
      const unsigned choice = bytes_.up_to(15);
      if (choice < 8) {
        update();
      } else if (choice < 11) {
        set_gains();
      } else if (choice < 13) {
        const dashpot_setpoint setpoint = make_setpoint();
        dashpot_set_setpoint(controller(), bytes_.flag() ? &setpoint : nullptr);
      } else if (choice == 13) {
        const double* torque = numbers(7, 0);
        dashpot_reset(controller(), torque);
      } else {
        read();
      }
      require(dashpot_last_error() != nullptr, "there is always a text");
    }
  }

 private:
  using Array = std::array<double, 64>;

  dashpot_controller* controller() { return bytes_.up_to(63) == 1 ? nullptr : controller_; }
  std::uint32_t odd(std::size_t right) {
    return bytes_.up_to(63) == 1 ? bytes_.take<std::uint32_t>() : static_cast<std::uint32_t>(right);
  }
  /// Null, or `count` numbers around `middle` times the identity (by rows, of `width`).
  const double* numbers(unsigned count, double middle, unsigned width = 1) {
    if (bytes_.up_to(15) == 1) return nullptr;
    Array& values = arrays_[next_++ % arrays_.size()];
    const bool plain = bytes_.flag();
    for (unsigned i = 0; i < count; ++i) {
      const bool diagonal = i % (width + 1) == 0;
      values[i] = (diagonal || width == 1 ? middle : 0.0) + (plain ? 0.0 : bytes_.number());
    }
    return values.data();
  }

  dashpot_setpoint make_setpoint() {
    dashpot_setpoint setpoint{};
    setpoint.struct_size = odd(sizeof setpoint);
    setpoint.joints = odd(kJoints);
    setpoint.time = bytes_.flag() ? DASHPOT_ON_ARRIVAL : time_ + bytes_.take<std::int16_t>();
    setpoint.mode = static_cast<std::int32_t>(odd(bytes_.up_to(1)));
    setpoint.joint_position = numbers(kJoints, 0);
    setpoint.tip_position = numbers(3, 0.3);
    setpoint.tip_rotation = numbers(9, 1, 3);
    setpoint.wrench = numbers(6, 0);
    return setpoint;
  }

  void set_gains() {
    const double ratio = bytes_.number();
    const auto frame = static_cast<std::int32_t>(odd(bytes_.up_to(1)));
    std::array<std::uint8_t, 6> directions{};
    for (std::uint8_t& direction : directions) direction = bytes_.take<std::uint8_t>();
    dashpot_gains gains{};
    gains.struct_size = odd(sizeof gains);
    gains.joints = odd(kJoints);
    gains.joint_stiffness = numbers(49, 100, kJoints);
    gains.joint_damping = numbers(49, 10, kJoints);
    gains.task_stiffness = numbers(36, 500, 6);
    if (bytes_.flag()) gains.task_damping = numbers(36, 30, 6);
    if (bytes_.flag()) gains.task_damping_ratio = &ratio;
    gains.null_stiffness = numbers(kJoints, 10);
    gains.null_damping = numbers(kJoints, 1);
    if (bytes_.flag()) gains.frame = &frame;
    if (bytes_.flag()) gains.directions = directions.data();
    dashpot_set_gains(controller(), bytes_.up_to(15) == 1 ? nullptr : &gains);
  }

  void update() {
    std::array<double, kJoints> position = position_, torque{};
    position[bytes_.up_to(6)] += bytes_.flag() ? 0 : bytes_.number();
    time_ += bytes_.up_to(15) == 1 ? bytes_.take<std::int64_t>() % (std::int64_t{1} << 60)
                                   : std::int64_t{1'000'000};
    time_ %= std::int64_t{1} << 61;
    if (bytes_.flag()) position_[bytes_.up_to(6)] += 1e-5 * bytes_.take<std::int8_t>();
    const dashpot_state state = {odd(sizeof state),
                                 odd(kJoints),
                                 bytes_.up_to(63) == 1 ? bytes_.take<std::int64_t>() : time_,
                                 bytes_.up_to(63) == 1 ? nullptr : position.data(),
                                 numbers(kJoints, 0),
                                 numbers(6, 0)};
    dashpot_output output = {odd(sizeof output), odd(kJoints),
                             bytes_.up_to(63) == 1 ? nullptr : torque.data()};
    const dashpot_setpoint setpoint = make_setpoint();
    const std::int32_t status = dashpot_update(
        controller(), bytes_.up_to(31) == 1 ? nullptr : &state, bytes_.flag() ? &setpoint : nullptr,
        bytes_.up_to(31) == 1 ? nullptr : &output);
    require(dashpot_status_text(status) != nullptr, "every status has a text");
    for (const double value : torque) {
      require(std::isfinite(value) && std::abs(value) <= kTorque,
              "every torque is finite and within its limit");
    }
  }

  void read() {
    snapshot_->struct_size = odd(sizeof *snapshot_);
    modes_->struct_size = odd(sizeof *modes_);
    dashpot_read_snapshot(controller(), snapshot_.get());
    if (dashpot_read_modes(controller(), modes_.get()) == DASHPOT_OK) {
      require(modes_->count + modes_->zero_modes <= kJoints, "no more modes than joints");
      for (unsigned i = 0; i < modes_->count; ++i) dashpot_kind_text(modes_->modes[i].kind);
    }
    dashpot_joint_name(controller(), bytes_.take<std::uint32_t>());
    dashpot_kind_text(bytes_.take<std::int32_t>());
    dashpot_plugin_interface(bytes_.take<std::uint32_t>());
  }

  dashpot_controller* controller_;
  Bytes bytes_;
  std::array<Array, 16> arrays_{};
  std::size_t next_ = 0;
  std::array<double, kJoints> position_ = kStart;
  std::int64_t time_ = 0;
  std::unique_ptr<dashpot_snapshot> snapshot_ = std::make_unique<dashpot_snapshot>();
  std::unique_ptr<dashpot_modes> modes_ = std::make_unique<dashpot_modes>();
};

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  dashpot_controller* controller =
      dashpot_create(DASHPOT_SOURCE_DIR "/controller/examples/panda.yaml");
  require(controller != nullptr, dashpot_last_error());
  Host(controller, Bytes(data, size)).run();
  dashpot_destroy(controller);
  return 0;
}
