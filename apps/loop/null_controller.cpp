#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/apps/loop/loop_controller.hpp>

#include <algorithm>

namespace dashpot::apps {
namespace {

/// The modes of the matrices, in the terms of the plugin.
dashpot_modes modes_of(const MatrixSystem& system) {
  analysis::System<> matrices(system.mass.rows());
  matrices.mass = system.mass;
  matrices.damping = system.damping;
  matrices.stiffness = system.stiffness;
  const analysis::Spectrum<> spectrum = analysis::analyze(matrices);
  dashpot_modes modes{};
  modes.struct_size = sizeof modes;
  modes.joints = static_cast<std::uint32_t>(system.mass.rows());
  modes.status = static_cast<std::int32_t>(spectrum.status);
  modes.origin = DASHPOT_DIRECT;
  modes.direct = 1;
  modes.zero_modes = static_cast<std::uint32_t>(spectrum.zero_modes.count);
  modes.count = static_cast<std::uint32_t>(std::min(spectrum.modes.size(), DASHPOT_MAX_JOINTS));
  for (std::uint32_t i = 0; i < modes.count; ++i) {
    const auto& from = spectrum.modes[static_cast<int>(i)];
    dashpot_mode& to = modes.modes[i];
    to.natural_frequency = from.natural_frequency;
    to.natural_frequency_bound = from.natural_frequency_bound;
    to.damping_ratio = from.damping_ratio;
    to.damping_ratio_bound = from.damping_ratio_bound;
    to.damped_frequency = from.damped_frequency;
    for (std::size_t k = 0; k < 2; ++k) {
      to.eigenvalues[k][0] = from.eigenvalues[k].real();
      to.eigenvalues[k][1] = from.eigenvalues[k].imag();
    }
    to.eigenvalue_bound = from.error_bound;
    to.label = static_cast<std::int32_t>(i + 1);
    to.kind = static_cast<std::int32_t>(from.kind);
    for (Eigen::Index j = 0; j < from.shapes[0].size(); ++j) {
      to.shape_real[j] = from.shapes[0][j].real();
      to.shape_imag[j] = from.shapes[0][j].imag();
    }
  }
  return modes;
}

class NullController : public LoopController {
 public:
  NullController(const MatrixSystem& system, double period) : modes_(modes_of(system)) {
    snapshot_.struct_size = sizeof snapshot_;
    snapshot_.joints = modes_.joints;
    snapshot_.restarts = 1;
    snapshot_.mode = DASHPOT_MODE_JOINT;
    for (int i = 0; i < 3; ++i)
      snapshot_.tip_rotation[4 * i] = snapshot_.reference_tip_rotation[4 * i] = 1;
    modes_every_ = static_cast<std::uint64_t>(std::max(1.0, kModesPeriod / period));
  }

  std::int32_t update(std::int64_t time, const JointVector& q, const JointVector& qd,
                      const controller::Setpoint* /*setpoint*/,
                      JointVector& torque) noexcept override {
    ++snapshot_.tick;
    snapshot_.time = time;
    std::copy_n(q.data(), q.size(), snapshot_.position);
    std::copy_n(qd.data(), qd.size(), snapshot_.velocity);
    torque.setZero();
    return DASHPOT_OK;
  }

  void stop() noexcept override {}
  bool needs_brakes() const noexcept override { return false; }
  const dashpot_snapshot& snapshot() noexcept override { return snapshot_; }

  const dashpot_modes* new_modes() noexcept override {
    if ((snapshot_.tick - 1) % modes_every_ != 0) return nullptr;
    modes_.tick = snapshot_.tick;
    modes_.time = snapshot_.time;
    std::copy(std::begin(snapshot_.position), std::end(snapshot_.position), modes_.position);
    return &modes_;
  }

  std::int32_t start(const JointVector&, std::string&) override { return DASHPOT_OK; }
  std::int32_t set_gains(const controller::Gains&, std::string&) override { return DASHPOT_OK; }
  std::int32_t set_payload(const controller::Payload&, const controller::Pose&,
                           const controller::Gains*, std::string&) override {
    return DASHPOT_OK;
  }
  std::int32_t limit_tip_speed(const controller::TipSpeed&, std::string&) override {
    return DASHPOT_OK;
  }
  std::int32_t check(const controller::Setpoint&, const JointVector&, std::string&) override {
    return DASHPOT_OK;
  }
  std::int32_t release() override { return DASHPOT_OK; }

 private:
  static constexpr double kModesPeriod = 0.01;  // s

  dashpot_modes modes_;
  dashpot_snapshot snapshot_{};
  std::uint64_t modes_every_;
};

}  // namespace

std::unique_ptr<LoopController> make_null_controller(const MatrixSystem& system,
                                                     double period) try {
  return std::make_unique<NullController>(system, period);
} catch (const analysis::InvalidSystem& error) {
  throw InputError("system", error.what());
}

}  // namespace dashpot::apps
