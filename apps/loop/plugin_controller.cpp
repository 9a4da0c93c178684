#include <dashpot/apps/loop/loop_controller.hpp>

#include <dlfcn.h>
#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

namespace dashpot::apps {
namespace {

constexpr const char* kLibraryName = "libdashpot_plugin.so";

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor,
                               controller::kMaxJoints, controller::kMaxJoints>;

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

class PluginController : public LoopController {
 public:
  PluginController(const dashpot_plugin& plugin, const std::string& config_path, int joints)
      : plugin_(plugin), handle_(plugin.create(config_path.c_str()), plugin.destroy) {
    if (!handle_) throw InputError("", plugin.last_error());
    if (plugin.joints(handle_.get()) != static_cast<std::uint32_t>(joints)) {
      throw InputError("robot", "the plugin finds another number of joints");
    }
    snapshot_.struct_size = sizeof snapshot_;
    modes_.struct_size = sizeof modes_;
    sampled_modes_.struct_size = sizeof sampled_modes_;
  }

  std::int32_t update(std::int64_t time, const JointVector& q, const JointVector& qd,
                      const controller::Setpoint* setpoint, JointVector& torque) noexcept override {
    const dashpot_state state = {sizeof(dashpot_state), n(), time, q.data(), qd.data(), nullptr};
    dashpot_output output = {sizeof(dashpot_output), n(), torque.data()};
    if (setpoint == nullptr) return plugin_.update(handle_.get(), &state, nullptr, &output);
    const RowMajor3 rotation = setpoint->tip_pose.rotation;
    const dashpot_setpoint wanted = in_c(*setpoint, setpoint->time, rotation);
    return plugin_.update(handle_.get(), &state, &wanted, &output);
  }

  void stop() noexcept override { plugin_.stop(handle_.get()); }
  bool needs_brakes() const noexcept override { return plugin_.needs_brakes(handle_.get()) != 0; }

  const dashpot_snapshot& snapshot() noexcept override {
    plugin_.read_snapshot(handle_.get(), &snapshot_);
    return snapshot_;
  }

  const dashpot_modes* new_modes() noexcept override {
    const std::uint64_t last = modes_.tick;
    const std::int32_t status = modes_.status;  // unfinished until a thread has solved them
    if (plugin_.read_modes(handle_.get(), &modes_) != DASHPOT_OK) return nullptr;
    return modes_.tick == last && modes_.status == status ? nullptr : &modes_;
  }

  const dashpot_sampled_modes* new_sampled_modes() noexcept override {
    const std::uint64_t last = sampled_modes_.tick;
    if (plugin_.read_sampled_modes(handle_.get(), &sampled_modes_) != DASHPOT_OK) return nullptr;
    return sampled_modes_.tick == last ? nullptr : &sampled_modes_;
  }

  std::int32_t start(const JointVector& q, std::string& reason) override {
    return explain(plugin_.start(handle_.get(), q.data(), nullptr), reason);
  }

  std::int32_t set_gains(const controller::Gains& gains, std::string& reason) override {
    const GainArrays arrays(gains);
    const dashpot_gains wanted = arrays.gains(n());
    return explain(plugin_.set_gains(handle_.get(), &wanted), reason);
  }

  std::int32_t set_payload(const controller::Payload& payload, const controller::Pose& tool,
                           const controller::Gains* gains, std::string& reason) override {
    dashpot_payload wanted{};
    std::optional<GainArrays> arrays;
    dashpot_gains with{};
    if (gains != nullptr) {
      with = arrays.emplace(*gains).gains(n());
      wanted.gains = &with;
    }
    wanted.struct_size = sizeof wanted;
    wanted.mass = payload.mass;
    Eigen::Map<Eigen::Vector3d>(wanted.center) = payload.center;
    Eigen::Map<RowMajor3>(wanted.inertia) = payload.inertia;
    const RowMajor3 rotation = tool.rotation;
    wanted.tool_position = tool.position.data();
    wanted.tool_rotation = rotation.data();
    return explain(plugin_.set_payload(handle_.get(), &wanted), reason);
  }

  std::int32_t limit_tip_speed(const controller::TipSpeed& speed, std::string& reason) override {
    return explain(plugin_.limit_tip_speed(handle_.get(), speed.linear, speed.angular, speed.limit),
                   reason);
  }

  std::int32_t check(const controller::Setpoint& setpoint, const JointVector& q,
                     std::string& reason) override {
    const GainArrays arrays(setpoint.gains);
    const dashpot_gains gains = arrays.gains(n());
    std::int32_t code = plugin_.judge_gains(handle_.get(), &gains, q.data(), nullptr);
    if (code == DASHPOT_OK) code = plugin_.set_gains(handle_.get(), &gains);
    if (code != DASHPOT_OK) return explain(code, reason);
    const RowMajor3 rotation = setpoint.tip_pose.rotation;
    const dashpot_setpoint wanted = in_c(setpoint, DASHPOT_ON_ARRIVAL, rotation);
    return explain(plugin_.set_setpoint(handle_.get(), &wanted), reason);
  }

  std::int32_t release() override { return plugin_.release(handle_.get()); }

 private:
  /// Gains in the form of plugin.h.
  struct GainArrays {
    explicit GainArrays(const controller::Gains& from)
        : given(from),
          joint_stiffness(from.joint_stiffness),
          joint_damping(from.joint_damping),
          task_stiffness(from.task_stiffness),
          task_damping(from.task_damping),
          frame(from.frame == controller::Frame::kTool ? DASHPOT_FRAME_TOOL : DASHPOT_FRAME_BASE),
          projector(static_cast<std::int32_t>(from.null_projector)) {
      for (std::size_t i = 0; i < 6; ++i) directions[i] = from.directions[i] ? 1 : 0;
    }
    dashpot_gains gains(std::uint32_t n) const noexcept {
      return {sizeof(dashpot_gains),
              n,
              joint_stiffness.data(),
              given.joint_damping_ratio > 0 ? nullptr : joint_damping.data(),
              task_stiffness.data(),
              given.task_damping_ratio > 0 ? nullptr : task_damping.data(),
              &given.task_damping_ratio,
              given.null_stiffness.data(),
              given.null_damping_ratio > 0 ? nullptr : given.null_damping.data(),
              &frame,
              directions.data(),
              &given.joint_damping_ratio,
              &given.null_damping_ratio,
              &projector};
    }

    const controller::Gains& given;
    RowMajor joint_stiffness, joint_damping, task_stiffness, task_damping;
    std::int32_t frame, projector;
    std::array<std::uint8_t, 6> directions{};
  };

  std::uint32_t n() const noexcept { return plugin_.joints(handle_.get()); }

  std::int32_t explain(std::int32_t code, std::string& reason) const {
    reason = plugin_.last_error();
    return code;
  }

  /// Refers to `setpoint` and `rotation`.
  dashpot_setpoint in_c(const controller::Setpoint& setpoint, std::int64_t time,
                        const RowMajor3& rotation) const noexcept {
    return {
        sizeof(dashpot_setpoint),
        n(),
        time,
        setpoint.mode == controller::Mode::kCartesian ? DASHPOT_MODE_CARTESIAN : DASHPOT_MODE_JOINT,
        setpoint.joint_position.data(),
        setpoint.tip_pose.position.data(),
        rotation.data(),
        setpoint.wrench.data()};
  }

  const dashpot_plugin& plugin_;
  std::unique_ptr<dashpot_controller, void (*)(dashpot_controller*)> handle_;
  dashpot_snapshot snapshot_{};
  dashpot_modes modes_{};
  dashpot_sampled_modes sampled_modes_{};
};

/// The places of the library, in the order of the search.
std::vector<std::string> places(const std::string& path) {
  if (!path.empty()) return {std::filesystem::absolute(path)};
  std::error_code ignored;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path();
  return {program / kLibraryName, program / ".." / DASHPOT_LIBRARY_DIR / kLibraryName,
          kLibraryName};
}

}  // namespace

PluginLibrary::PluginLibrary(const std::string& path) {
  void* library = nullptr;
  std::string reason;
  for (const std::string& place : places(path)) {
    library = dlopen(place.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library != nullptr) break;
    if (reason.empty()) reason = dlerror();
  }
  if (library == nullptr) throw InputError("--plugin", "cannot load the controller: " + reason);
  using Interface = const dashpot_plugin* (*)(std::uint32_t);
  const auto interface = reinterpret_cast<Interface>(dlsym(library, "dashpot_plugin_interface"));
  if (interface == nullptr) throw InputError("--plugin", "is not a controller plugin of Dashpot");
  functions_ = interface(DASHPOT_PLUGIN_VERSION);
  if (functions_ == nullptr || functions_->struct_size != sizeof(dashpot_plugin)) {
    throw InputError("--plugin", "is of another version than this program");
  }
}

std::unique_ptr<LoopController> PluginLibrary::create(const std::string& config_path,
                                                      int joints) const {
  return std::make_unique<PluginController>(*functions_, config_path, joints);
}

}  // namespace dashpot::apps
