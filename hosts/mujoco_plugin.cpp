// The engine plugin dashpot.impedance of MuJoCo: an arm of the model under the controller.
// docs/mujoco.md has its attributes.

#include <dashpot/controller/plugin.h>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/plugin_samples.hpp>
#include <dashpot/lcmtypes/publisher.hpp>
#include <dashpot/lcmtypes/sink.hpp>

#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace dashpot::hosts {
namespace {

constexpr std::array<const char*, 6> kAttributes = {"config", "prefix",  "goal",
                                                    "base",   "lcm_url", "release"};

std::string attribute(const mjModel* model, int instance, const char* name) {
  const char* const text = mj_getPluginConfig(model, instance, name);
  return text != nullptr ? text : "";
}

/// One controller with the arm of one mjData.
class Arm {
 public:
  /// Throws std::runtime_error for an arm that the model does not have.
  Arm(const mjModel* model, int instance) {
    const std::string config = attribute(model, instance, "config");
    if (config.empty()) throw std::runtime_error("config: is missing");
    controller_.reset(dashpot_create(config.c_str()));
    if (!controller_) throw std::runtime_error(dashpot_last_error());
    find_joints(model, attribute(model, instance, "prefix"));
    find_bodies(model, instance);
    find_release(model, attribute(model, instance, "release"));
    if (model->opt.integrator == mjINT_RK4) {
      throw std::runtime_error("integrator: RK4 has states between steps, without a tick");
    }
    const double steps = dashpot_period(controller_.get()) / model->opt.timestep;
    every_ = std::max(std::llround(steps), 1LL);
    if (std::abs(steps - static_cast<double>(every_)) > 1e-6 * steps) {
      throw std::runtime_error("control.period: is not a multiple of the model's timestep");
    }
    snapshot_.struct_size = sizeof snapshot_;
    modes_.struct_size = sizeof modes_;
    sampled_.struct_size = sizeof sampled_;
    std::string url = attribute(model, instance, "lcm_url");
    if (url.empty()) return;
    if (url == "default") url.clear();
    std::vector<std::unique_ptr<lcmtypes::Sink>> sinks;
    sinks.push_back(lcmtypes::make_bus_sink(lcmtypes::open_bus(url)));
    publisher_ = std::make_unique<lcmtypes::Publisher>(std::move(sinks));
    publisher_->start();
  }

  /// Number of values before the modes: status, fault, gain margin of the sampled loop and number
  /// of modes. Frequencies, rad/s, and damping ratios of n modes follow; unknown values are zero.
  static constexpr int kSensed = 4;

  /// Makes the next tick begin at rest.
  void restart() noexcept {
    started_ = false;
    std::fill(torque_.begin(), torque_.end(), 0.0);
  }

  /// Adds the torque to the passive forces. Returns false, with `reason`, if it must not start.
  bool act(const mjModel* model, mjData* data, std::string& reason) {
    const std::int64_t step = std::llround(data->time / model->opt.timestep);
    // The time was set back, or the arm was moved after a first step at the start.
    if (started_ && (step < step_ || (step == begin_ && moved(model, data)))) restart();
    if (!started_ || step >= step_ + every_) {
      for (std::size_t i = 0; i < joints_.size(); ++i) {
        position_[i] = data->qpos[model->jnt_qposadr[joints_[i]]];
        velocity_[i] = data->qvel[model->jnt_dofadr[joints_[i]]];
      }
      const std::int32_t begun =
          started_ ? DASHPOT_OK : dashpot_start(controller_.get(), position_.data(), nullptr);
      // MuJoCo tries one step when it compiles a model, wherever the arm then is.
      if (begun == DASHPOT_WRONG_VALUE && data->time == 0) return true;
      if (begun != DASHPOT_OK) {
        reason = dashpot_last_error();
        return false;
      }
      if (!started_) begin_ = step;
      step_ = step;
      started_ = true;
      take_release(data);
      tick(data);
    }
    for (std::size_t i = 0; i < joints_.size(); ++i) {
      data->qfrc_passive[model->jnt_dofadr[joints_[i]]] += torque_[i];
    }
    return true;
  }

  void tell(mjtNum* sensed) const noexcept {
    const auto n = static_cast<std::uint32_t>(joints_.size());
    sensed[0] = snapshot_.status;
    sensed[1] = snapshot_.fault;
    sensed[2] = std::isfinite(sampled_.gain_margin) ? sampled_.gain_margin : mjMAXVAL;
    sensed[3] = modes_.count;
    for (std::uint32_t i = 0; i < n; ++i) {
      sensed[kSensed + i] = i < modes_.count ? modes_.modes[i].natural_frequency : 0;
      sensed[kSensed + n + i] = i < modes_.count ? modes_.modes[i].damping_ratio : 0;
    }
  }

 private:
  bool moved(const mjModel* model, const mjData* data) const noexcept {
    for (std::size_t i = 0; i < joints_.size(); ++i) {
      if (data->qpos[model->jnt_qposadr[joints_[i]]] != position_[i]) return true;
    }
    return false;
  }

  struct Destroy {
    void operator()(dashpot_controller* one) const { dashpot_destroy(one); }
  };

  void find_joints(const mjModel* model, const std::string& prefix) {
    const std::uint32_t n = dashpot_joints(controller_.get());
    position_.assign(n, 0);
    velocity_.assign(n, 0);
    torque_.assign(n, 0);
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::string name = prefix + dashpot_joint_name(controller_.get(), i);
      const int joint = mj_name2id(model, mjOBJ_JOINT, name.c_str());
      if (joint < 0) throw std::runtime_error("prefix: the model has no joint '" + name + "'");
      if (model->jnt_type[joint] != mjJNT_HINGE && model->jnt_type[joint] != mjJNT_SLIDE) {
        throw std::runtime_error("joint '" + name + "' is neither a hinge nor a slide");
      }
      joints_.push_back(joint);
      if (!pulled(model, joint)) continue;
      std::fprintf(stderr,
                   "dashpot.impedance: an actuator of the model pulls joint '%s' as well; <option> "
                   "<flag actuation=\"disable\"/> </option> leaves them all out\n",
                   name.c_str());
    }
  }

  /// True if an actuator of the model acts on the joint, even if its control is zero.
  static bool pulled(const mjModel* model, int joint) {
    if ((model->opt.disableflags & mjDSBL_ACTUATION) != 0) return false;
    for (int i = 0; i < model->nu; ++i) {
      if (model->actuator_trntype[i] != mjTRN_JOINT || model->actuator_trnid[2 * i] != joint) {
        continue;
      }
      if (model->actuator_biastype[i] != mjBIAS_NONE) return true;
    }
    return false;
  }

  void find_bodies(const mjModel* model, int instance) {
    for (auto [body, name] : {std::pair{&goal_, "goal"}, std::pair{&base_, "base"}}) {
      const std::string wanted = attribute(model, instance, name);
      if (wanted.empty()) continue;
      *body = mj_name2id(model, mjOBJ_BODY, wanted.c_str());
      if (*body < 0) {
        throw std::runtime_error(std::string(name) + ": the model has no body '" + wanted + "'");
      }
    }
  }

  void find_release(const mjModel* model, const std::string& index) {
    if (index.empty()) return;
    const char* const end = index.data() + index.size();
    const auto [rest, error] = std::from_chars(index.data(), end, release_);
    if (error == std::errc() && rest == end && release_ >= 0 && release_ < model->nuserdata) return;
    throw std::runtime_error("release: '" + index + "' is not an index of userdata, which has " +
                             std::to_string(model->nuserdata) + " numbers");
  }

  /// A number that is not zero releases a fault once, and is zero again.
  void take_release(mjData* data) const noexcept {
    if (release_ < 0 || data->userdata[release_] == 0) return;
    data->userdata[release_] = 0;
    dashpot_release(controller_.get());
  }

  void tick(const mjData* data) {
    const auto n = static_cast<std::uint32_t>(joints_.size());
    const std::int64_t time = std::llround(1e9 * data->time);
    const dashpot_state state{sizeof state, n, time, position_.data(), velocity_.data(), nullptr};
    dashpot_output output{sizeof output, n, torque_.data()};
    std::array<mjtNum, 3> position{};
    std::array<mjtNum, 9> rotation{};
    dashpot_setpoint setpoint{};
    if (goal_ >= 0) {
      const mjtNum* const from = data->xmat + 9 * base_;
      std::array<mjtNum, 3> way{};
      mju_sub3(way.data(), data->xpos + 3 * goal_, data->xpos + 3 * base_);
      mju_mulMatTVec3(position.data(), from, way.data());
      mju_mulMatTMat(rotation.data(), from, data->xmat + 9 * goal_, 3, 3, 3);
      setpoint = {sizeof setpoint, n,      time, DASHPOT_MODE_CARTESIAN, nullptr, position.data(),
                  rotation.data(), nullptr};
    }
    const std::int32_t status =
        dashpot_update(controller_.get(), &state, goal_ >= 0 ? &setpoint : nullptr, &output);
    if (status < DASHPOT_OK) std::fill(torque_.begin(), torque_.end(), 0.0);
    read();
  }

  void read() {
    const std::uint64_t modes = modes_.tick, sampled = sampled_.tick;
    if (dashpot_read_snapshot(controller_.get(), &snapshot_) != DASHPOT_OK) return;
    tell_of_brakes();
    state_.utime = snapshot_.time / 1000;  // by the simulation's clock
    lcmtypes::fill(snapshot_, state_.snapshot);
    const bool faulty = snapshot_.fault != DASHPOT_OK;
    if (!faulty || state_.health.fault_tick == 0) {
      state_.health.fault_tick = faulty ? static_cast<std::int64_t>(snapshot_.tick) : 0;
    }
    if (publisher_) publisher_->offer(state_);
    if (dashpot_read_modes(controller_.get(), &modes_) == DASHPOT_OK && modes_.tick != modes) {
      found_.utime = modes_.time / 1000;
      lcmtypes::fill(modes_, found_);
      if (publisher_) publisher_->offer(found_);
    }
    if (dashpot_read_sampled_modes(controller_.get(), &sampled_) == DASHPOT_OK &&
        sampled_.tick != sampled) {
      found_sampled_.utime = sampled_.time / 1000;
      lcmtypes::fill(sampled_, found_sampled_);
      if (publisher_) publisher_->offer(found_sampled_);
    }
  }

  /// Prints once for each fault.
  void tell_of_brakes() noexcept {
    const bool needed = dashpot_needs_brakes(controller_.get()) != 0;
    if (needed && !told_) {
      std::fprintf(stderr, "dashpot.impedance: %s: a robot would have to engage its brakes\n",
                   dashpot_status_text(snapshot_.status));
    }
    told_ = needed || (told_ && snapshot_.fault != DASHPOT_OK);
  }

  std::unique_ptr<dashpot_controller, Destroy> controller_;
  std::vector<int> joints_;  ///< of the model, from the base to the tip
  int goal_ = -1;            ///< body whose pose is the set-point; -1: none
  int base_ = 0;             ///< body that is the base link; 0: the world
  int release_ = -1;         ///< index in userdata; -1: none
  bool told_ = false;        ///< the need of brakes was printed
  std::int64_t every_ = 1;   ///< steps of the model from tick to tick
  std::int64_t begin_ = 0;   ///< step of the first tick
  std::int64_t step_ = 0;    ///< of the last tick
  bool started_ = false;
  std::vector<double> position_, velocity_, torque_;
  dashpot_snapshot snapshot_{};
  dashpot_modes modes_{};
  dashpot_sampled_modes sampled_{};
  lcmtypes::StateSample state_;
  lcmtypes::ModesSample found_;
  lcmtypes::SampledModesSample found_sampled_;
  std::unique_ptr<lcmtypes::Publisher> publisher_;
};

Arm* arm_of(const mjData* data, int instance) {
  return reinterpret_cast<Arm*>(data->plugin_data[instance]);
}

int init(const mjModel* model, mjData* data, int instance) {
  try {
    auto arm = std::make_unique<Arm>(model, instance);
    data->plugin_data[instance] = reinterpret_cast<std::uintptr_t>(arm.release());
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "dashpot.impedance: %s\n", error.what());
    return -1;
  }
}

void destroy(mjData* data, int instance) {
  const std::unique_ptr<Arm> gone(arm_of(data, instance));
  data->plugin_data[instance] = 0;
}

void reset(const mjModel*, mjtNum*, void* arm, int) {
  if (arm != nullptr) static_cast<Arm*>(arm)->restart();
}

/// Returns why the arm must not be moved; "" if it may. A separate function, so that no destructor
/// is skipped when MuJoCo's error jumps out.
const char* act(const mjModel* model, mjData* data, int instance) {
  static thread_local std::string reason;
  reason.clear();
  arm_of(data, instance)->act(model, data, reason);
  return reason.c_str();
}

void compute(const mjModel* model, mjData* data, int instance, int capability) {
  if ((capability & mjPLUGIN_PASSIVE) != 0) {
    const char* const reason = act(model, data, instance);
    if (*reason != '\0') mju_error("dashpot.impedance: %s", reason);
    return;
  }
  for (int i = 0; i < model->nsensor; ++i) {
    if (model->sensor_type[i] != mjSENS_PLUGIN || model->sensor_plugin[i] != instance) continue;
    arm_of(data, instance)->tell(data->sensordata + model->sensor_adr[i]);
  }
}

/// Returns the number of values. MuJoCo asks before there is an mjData, and so an arm.
int sensed_by(const mjModel* model, int instance, int) {
  const std::string config = attribute(model, instance, "config");
  const std::unique_ptr<dashpot_controller, void (*)(dashpot_controller*)> controller(
      dashpot_create(config.c_str()), dashpot_destroy);
  return Arm::kSensed + 2 * static_cast<int>(dashpot_joints(controller.get()));
}

}  // namespace
}  // namespace dashpot::hosts

mjPLUGIN_LIB_INIT(dashpot) {
  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = "dashpot.impedance";
  plugin.nattribute = static_cast<int>(dashpot::hosts::kAttributes.size());
  plugin.attributes = dashpot::hosts::kAttributes.data();
  plugin.capabilityflags = mjPLUGIN_PASSIVE | mjPLUGIN_SENSOR;
  plugin.needstage = mjSTAGE_VEL;
  plugin.nstate = [](const mjModel*, int) { return 0; };
  plugin.nsensordata = dashpot::hosts::sensed_by;
  plugin.init = dashpot::hosts::init;
  plugin.destroy = dashpot::hosts::destroy;
  plugin.reset = dashpot::hosts::reset;
  plugin.compute = dashpot::hosts::compute;
  mjp_registerPlugin(&plugin);
}
