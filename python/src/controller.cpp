// The controller behind the plugin's C functions, so that Python drives what other hosts load.

#include <dashpot/lcmtypes/plugin_publisher.h>
#include <dashpot/controller/plugin/hosted_controller.hpp>
#include <dashpot/controller/plugin/plugin_data.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/python/src/shared.hpp>

#include <algorithm>
#include <array>
#include <memory>
#include <mutex>
#include <tuple>

namespace dashpot::python {
namespace {

/// A controller. Long calls run without the interpreter's lock; these mutexes serialise them
/// between threads, as plugin.h requires. The remaining calls hold the lock.
class Host {
 public:
  explicit Host(dashpot_controller* controller) : controller_(controller) {}

  dashpot_controller* get() const { return controller_.get(); }
  std::size_t joints() const { return dashpot_joints(get()); }

  /// Publishes every tick on buses, one URL a line, by a thread that needs no interpreter.
  void publish(const std::string& urls) {
    publisher_.reset();  // before another one reads the same results
    publisher_.reset(dashpot_publisher_create(get(), urls.empty() ? nullptr : urls.c_str()));
    if (!publisher_) throw std::invalid_argument(dashpot_publisher_error());
  }
  void stop_publishing() { publisher_.reset(); }
  /// For reading results: while there is a publisher, only it may read them.
  dashpot_controller* readable() const {
    if (publisher_) throw std::invalid_argument("publish: results are read by the publisher");
    return get();
  }

  std::mutex loop;   ///< of update, start and reset
  std::mutex other;  ///< of set_setpoint, set_gains, set_payload, ...

 private:
  struct Destroy {
    void operator()(dashpot_controller* one) const { dashpot_destroy(one); }
  };
  struct DestroyPublisher {
    void operator()(dashpot_publisher* one) const { dashpot_publisher_destroy(one); }
  };
  std::unique_ptr<dashpot_controller, Destroy> controller_;
  std::unique_ptr<dashpot_publisher, DestroyPublisher> publisher_;
};

void check(std::int32_t code) {
  if (code < DASHPOT_OK) throw std::invalid_argument(dashpot_last_error());
}

std::unique_ptr<Host> from_text(const std::string& text, const std::string& directory) {
  const text::YamlNode document = text::parse_made_yaml(text);
  return std::make_unique<Host>(create_controller(controller::read_config(document, directory)));
}

std::unique_ptr<Host> from_file(const std::string& path) {
  dashpot_controller* const controller = dashpot_create(path.c_str());
  if (controller == nullptr) throw std::invalid_argument(dashpot_last_error());
  return std::make_unique<Host>(controller);
}

/// Entries of a set-point or of gains, which have to live until the call is over.
class Numbers {
 public:
  /// Returns the entries by rows; null if nothing is given. Throws InvalidSystem for another size.
  const double* add(const char* name, const OptionalMatrix& given, Eigen::Index rows,
                    Eigen::Index cols) {
    if (!given) return nullptr;
    analysis::check_size(name, *given, rows, cols);
    std::vector<double>& row_major = kept_.emplace_back();
    for (const auto& row : given->rowwise())
      row_major.insert(row_major.end(), row.begin(), row.end());
    return row_major.data();
  }

 private:
  std::vector<std::vector<double>> kept_;
};

/// A set-point of the C interface, with the data that it points to.
class SetpointData {
 public:
  SetpointData(const Host& host, bool cartesian, const OptionalMatrix& joint_position,
               const OptionalMatrix& tip_pose, const OptionalMatrix& wrench,
               std::optional<std::int64_t> time) {
    const auto n = static_cast<Eigen::Index>(host.joints());
    given.struct_size = sizeof given;
    given.joints = static_cast<std::uint32_t>(n);
    given.time = time.value_or(DASHPOT_ON_ARRIVAL);
    given.mode = cartesian ? DASHPOT_MODE_CARTESIAN : DASHPOT_MODE_JOINT;
    given.joint_position = numbers_.add("joint_position", joint_position, n, 1);
    if (tip_pose) {
      analysis::check_size("tip_pose", *tip_pose, 4, 4);
      given.tip_position = numbers_.add("", tip_pose->topRightCorner(3, 1), 3, 1);
      given.tip_rotation = numbers_.add("", tip_pose->topLeftCorner(3, 3), 3, 3);
    }
    given.wrench = numbers_.add("wrench", wrench, 6, 1);
  }

  dashpot_setpoint given{};

 private:
  Numbers numbers_;
};

using OptionalSetpoint = std::optional<
    std::tuple<bool, OptionalMatrix, OptionalMatrix, OptionalMatrix, std::optional<std::int64_t>>>;

/// Gains of the C interface, with the data that they point to.
class GainsData {
 public:
  GainsData(const Host& host, const nb::dict& keys) : n_(static_cast<Eigen::Index>(host.joints())) {
    given.struct_size = sizeof given;
    given.joints = static_cast<std::uint32_t>(n_);
    given.joint_stiffness = matrix(keys, "joint_stiffness", n_, n_);
    given.joint_damping = matrix(keys, "joint_damping", n_, n_);
    given.joint_damping_ratio = matrix(keys, "joint_damping_ratio", 1, 1);
    given.task_stiffness = matrix(keys, "task_stiffness", 6, 6);
    given.task_damping = matrix(keys, "task_damping", 6, 6);
    given.task_damping_ratio = matrix(keys, "task_damping_ratio", 1, 1);
    given.null_stiffness = matrix(keys, "null_stiffness", n_, 1);
    given.null_damping = matrix(keys, "null_damping", n_, 1);
    given.null_damping_ratio = matrix(keys, "null_damping_ratio", 1, 1);
    if (keys.contains("tool_frame")) {
      frame_ = nb::cast<bool>(keys["tool_frame"]) ? DASHPOT_FRAME_TOOL : DASHPOT_FRAME_BASE;
      given.frame = &frame_;
    }
    if (keys.contains("null_projector")) {
      const auto name = nb::cast<std::string>(keys["null_projector"]);
      projector_ = static_cast<std::int32_t>(controller::null_projector_of(name));
      given.null_projector = &projector_;
    }
    if (keys.contains("directions")) {
      const auto selected = nb::cast<std::vector<bool>>(keys["directions"]);
      if (selected.size() != directions_.size()) {
        throw std::invalid_argument("directions: six are wanted");
      }
      for (std::size_t i = 0; i < selected.size(); ++i) directions_[i] = selected[i] ? 1 : 0;
      given.directions = directions_.data();
    }
  }
  GainsData(const GainsData&) = delete;
  GainsData& operator=(const GainsData&) = delete;

  dashpot_gains given{};

 private:
  const double* matrix(const nb::dict& keys, const char* key, Eigen::Index rows,
                       Eigen::Index cols) {
    if (!keys.contains(key)) return nullptr;
    return numbers_.add(key, nb::cast<Eigen::MatrixXd>(keys[key]), rows, cols);
  }

  Eigen::Index n_;
  Numbers numbers_;
  std::int32_t frame_ = 0, projector_ = 0;
  std::array<std::uint8_t, 6> directions_{};
};

nb::tuple update(Host& host, std::int64_t time, const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                 const OptionalSetpoint& wanted, const OptionalVector& wrench) {
  if (wrench && wrench->size() != 6) {
    throw std::invalid_argument("external_wrench: six numbers are wanted");
  }
  const bool fits = q.size() == qd.size();  // stopping the arm is safer than an exception
  const dashpot_state state{sizeof state, static_cast<std::uint32_t>(fits ? q.size() : 0),
                            time,         q.data(),
                            qd.data(),    wrench ? wrench->data() : nullptr};
  std::optional<SetpointData> setpoint;
  if (wanted) {
    std::apply([&](const auto&... parts) { setpoint.emplace(host, parts...); }, *wanted);
  }
  Eigen::VectorXd torque = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(host.joints()));
  dashpot_output output{sizeof output, dashpot_joints(host.get()), torque.data()};
  std::int32_t status = 0;
  {
    const nb::gil_scoped_release release;
    const std::lock_guard lock(host.loop);
    status = dashpot_update(host.get(), &state, setpoint ? &setpoint->given : nullptr, &output);
  }
  if (status < DASHPOT_OK) throw std::invalid_argument(dashpot_status_text(status));
  return nb::make_tuple(torque, status);
}

/// Returns the warning, or "".
std::string start(Host& host, const Eigen::MatrixXd& q, const OptionalMatrix& torque) {
  const auto n = static_cast<Eigen::Index>(host.joints());
  Numbers numbers;
  const double* const position = numbers.add("q", q, n, 1);
  const double* const acting = numbers.add("torque", torque, n, 1);
  const nb::gil_scoped_release release;
  const std::scoped_lock lock(host.loop, host.other);
  check(dashpot_start(host.get(), position, acting));
  return dashpot_last_error();
}

void reset(Host& host, const OptionalMatrix& torque) {
  Numbers numbers;
  const double* const acting =
      numbers.add("torque", torque, static_cast<Eigen::Index>(host.joints()), 1);
  const nb::gil_scoped_release release;
  const std::lock_guard lock(host.loop);
  const std::int32_t code = dashpot_reset(host.get(), acting);
  if (code < DASHPOT_OK) {
    throw std::invalid_argument("torque: " + std::string(dashpot_status_text(code)));
  }
}

/// Raises for an impossible set-point.
void check_setpoint(const Host& host, bool cartesian, const OptionalMatrix& joint_position,
                    const OptionalMatrix& tip_pose, const OptionalMatrix& wrench) {
  const SetpointData setpoint(host, cartesian, joint_position, tip_pose, wrench, 0);
  const controller::Settings& settings = host.get()->settings;
  controller::Setpoint wanted = settings.initial;
  const std::int32_t code = controller::to_setpoint(&setpoint.given, host.get()->n, 0, wanted);
  if (code != DASHPOT_OK) throw std::invalid_argument(dashpot_status_text(code));
  const controller::SetpointFault fault = controller::check_setpoint(wanted, settings.limits, true);
  if (fault) throw std::invalid_argument(std::string(fault.key) + " " + fault.reason);
}

void stop(Host& host) {
  const nb::gil_scoped_release release;
  const std::lock_guard lock(host.loop);
  dashpot_stop(host.get());
}

bool needs_brakes(Host& host) {
  const nb::gil_scoped_release release;
  const std::lock_guard lock(host.loop);
  return dashpot_needs_brakes(host.get()) != 0;
}

void set_setpoint(Host& host, bool cartesian, const OptionalMatrix& joint_position,
                  const OptionalMatrix& tip_pose, const OptionalMatrix& wrench,
                  std::optional<std::int64_t> time) {
  const SetpointData setpoint(host, cartesian, joint_position, tip_pose, wrench, time);
  const nb::gil_scoped_release release;
  const std::lock_guard lock(host.other);
  check(dashpot_set_setpoint(host.get(), &setpoint.given));
}

/// Returns the warning, or "", as set_payload does.
std::string set_gains(Host& host, const nb::dict& keys) {
  const GainsData gains(host, keys);
  const nb::gil_scoped_release release;
  const std::lock_guard lock(host.other);
  check(dashpot_set_gains(host.get(), &gains.given));
  return dashpot_last_error();
}

double judge_gains(Host& host, const OptionalMatrix& position, const nb::dict& keys) {
  const GainsData gains(host, keys);
  Numbers numbers;
  const double* const at =
      numbers.add("position", position, static_cast<Eigen::Index>(host.joints()), 1);
  const nb::gil_scoped_release release;
  double margin = 0;
  const std::int32_t code = dashpot_judge_gains(host.get(), &gains.given, at, &margin);
  if (code != DASHPOT_UNSTABLE_GAINS) check(code);
  return margin;
}

/// The modes at rest at a posture, without a running loop; the tip's Jacobian and place there.
nb::tuple modes_at(Host& host, const Eigen::VectorXd& position, bool cartesian,
                   const nb::dict& keys) {
  analysis::check_size("q", position, static_cast<Eigen::Index>(host.joints()), 1);
  const GainsData gains(host, keys);
  dashpot_modes modes{};
  dashpot_dynamics dynamics{};
  modes.struct_size = sizeof modes;
  dynamics.struct_size = sizeof dynamics;
  {
    const nb::gil_scoped_release release;
    check(dashpot_analyze(host.get(), position.data(),
                          cartesian ? DASHPOT_MODE_CARTESIAN : DASHPOT_MODE_JOINT, &gains.given,
                          nullptr, &modes));
    check(dashpot_evaluate(host.get(), position.data(), nullptr, &dynamics));
  }
  using Rows =
      Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  return nb::make_tuple(to_dict(modes),
                        Eigen::MatrixXd(Rows(dynamics.jacobian, 6, position.size())),
                        Eigen::VectorXd(Eigen::Map<const Eigen::Vector3d>(dynamics.tip_position)));
}

std::string set_payload(Host& host, double mass, const Eigen::MatrixXd& center,
                        const Eigen::MatrixXd& inertia, const OptionalMatrix& tool,
                        const std::optional<nb::dict>& keys) {
  std::optional<GainsData> gains;
  if (keys) gains.emplace(host, *keys);
  Numbers numbers;
  dashpot_payload payload{};
  payload.struct_size = sizeof payload;
  payload.mass = mass;
  std::copy_n(numbers.add("center", center, 3, 1), 3, payload.center);
  std::copy_n(numbers.add("inertia", inertia, 3, 3), 9, payload.inertia);
  if (tool) {
    analysis::check_size("tool", *tool, 4, 4);
    payload.tool_position = numbers.add("", tool->topRightCorner(3, 1), 3, 1);
    payload.tool_rotation = numbers.add("", tool->topLeftCorner(3, 3), 3, 3);
  }
  if (gains) payload.gains = &gains->given;
  const nb::gil_scoped_release release;
  const std::lock_guard lock(host.other);
  check(dashpot_set_payload(host.get(), &payload));
  return dashpot_last_error();
}

void limit_tip_speed(Host& host, double linear, double angular, double limit) {
  const nb::gil_scoped_release release;
  const std::lock_guard lock(host.other);
  check(dashpot_limit_tip_speed(host.get(), linear, angular, limit));
}

void release(Host& host) {
  const nb::gil_scoped_release no_lock;
  const std::lock_guard lock(host.other);
  check(dashpot_release(host.get()));
}

/// Data that a host compares with the robot.
nb::dict loop_of(const Host& host) {
  const controller::Settings& settings = host.get()->settings;
  const controller::Analysis::Sampled& sampled = settings.analysis.sampled;
  nb::dict loop;
  loop["gravity"] = settings.feed_forward.gravity;
  loop["base_gravity"] = Eigen::VectorXd(host.get()->model.gravity());
  loop["delay"] = sampled.delay;
  loop["cutoff"] = sampled.cutoff;
  loop["difference_velocity"] = sampled.difference_velocity;
  loop["torque"] = Eigen::VectorXd(settings.limits.torque);
  loop["torque_rate"] = Eigen::VectorXd(settings.limits.torque_rate);
  loop["gain_margin"] = settings.limits.gain_margin;
  loop["missing_rotors"] = controller::missing_rotors_text(host.get()->model);
  loop["cartesian"] = settings.initial.mode == controller::Mode::kCartesian;
  return loop;
}

}  // namespace

void add_controller(nb::module_& m) {
  m.def("status_text", [](int status) { return dashpot_status_text(status); });
  nb::class_<Host>(m, "Controller", "dashpot_controller of controller/plugin.h")
      .def_static("from_text", &from_text, nb::call_guard<nb::gil_scoped_release>())
      .def_static("from_file", &from_file, nb::call_guard<nb::gil_scoped_release>())
      .def_prop_ro("joints", &Host::joints)
      .def("joint_names",
           [](const Host& host) {
             nb::list names;
             for (std::uint32_t i = 0; i < host.joints(); ++i) {
               names.append(dashpot_joint_name(host.get(), i));
             }
             return names;
           })
      .def_prop_ro("period", [](const Host& host) { return dashpot_period(host.get()); })
      .def("update", &update, nb::arg("time"), nb::arg("q"), nb::arg("qd"),
           nb::arg("setpoint").none(), nb::arg("external_wrench").none())
      .def("start", &start, nb::arg("q"), nb::arg("torque").none())
      .def("reset", &reset, nb::arg("torque").none())
      .def("stop", &stop)
      .def("needs_brakes", &needs_brakes)
      .def("check_setpoint", &check_setpoint, nb::arg("cartesian"),
           nb::arg("joint_position").none(), nb::arg("tip_pose").none(), nb::arg("wrench").none())
      .def("set_setpoint", &set_setpoint, nb::arg("cartesian"), nb::arg("joint_position").none(),
           nb::arg("tip_pose").none(), nb::arg("wrench").none(), nb::arg("time").none())
      .def("set_gains", &set_gains, nb::arg("gains"))
      .def("judge_gains", &judge_gains, nb::arg("position").none(), nb::arg("gains"))
      .def("modes_at", &modes_at, nb::arg("q"), nb::arg("cartesian"), nb::arg("gains"))
      .def("set_payload", &set_payload, nb::arg("mass"), nb::arg("center"), nb::arg("inertia"),
           nb::arg("tool").none(), nb::arg("gains").none())
      .def("limit_tip_speed", &limit_tip_speed, nb::arg("linear"), nb::arg("angular"),
           nb::arg("limit"))
      .def("release", &release)
      .def("loop", &loop_of)
      .def("publish", &Host::publish, nb::arg("urls"))
      .def("stop_publishing", &Host::stop_publishing)
      .def("snapshot", [](const Host& host) { return snapshot_of(host.readable()); })
      .def("modes", [](const Host& host) { return modes_of(host.readable()); })
      .def("sampled_modes", [](const Host& host) { return sampled_modes_of(host.readable()); });
}

}  // namespace dashpot::python
