// Arms with elastic joints: modes and margin that the analysis of the sampled loop predicts, beside
// the simulated arm under the real controller, as a matrix that takes the loop's state from one
// tick to the next: of the arm by differences of simulated ticks, of the controller by differences
// of its torques. Nothing of the analysis is in it.
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/elastic_joints.hpp>
#include <dashpot/sim/arm.hpp>
#include <dashpot/sim/plant.hpp>
#include <dashpot/tests/support/sanitized.hpp>
#include <dashpot/tests/support/twin_models.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <complex>
#include <iostream>
#include <numbers>
#include <stdexcept>

namespace dashpot::testing {
namespace {

/// Steps by error control near the limit of what rounding allows, for gears of 1e4 rad/s.
sim::PlantOptions exact_steps(double period) {
  sim::PlantOptions options;
  options.period = period;
  options.integrator.method = sim::Method::kDormandPrince8;
  options.integrator.adaptive = true;
  options.integrator.max_step = period;
  options.integrator.absolute_tolerance = options.integrator.relative_tolerance = 1e-13;
  return options;
}

/// x_k+1 = A x_k + B f_k, the sensors show C x_k; x = (q, deflections; their rates in units of
/// kRate) from where the arm rests.
struct ArmMap {
  static constexpr double kRate = 1000;  // 1/s

  Eigen::MatrixXd A, B, C;
  sim::JointVector rest;  ///< where the links are

  /// By central differences about where the sensors show q, at rest under the torque `weight` of
  /// the links there.
  template <class Weight>
  ArmMap(sim::Arm& arm, const sim::JointVector& q, double period, const Weight& weight)
      : rest(sim::Plant(arm, {}, q).position()) {
    const Eigen::Index n = arm.dof(), N = arm.coordinates();
    const sim::PlantOptions options = exact_steps(period);
    const sim::Plant start(arm, options, q);
    const Eigen::VectorXd center = start.state().head(2 * N);
    const sim::JointVector carried = weight(rest);
    const auto next = [&](const Eigen::VectorXd& x, const sim::JointVector& torque) {
      sim::Plant plant(arm, options, x.head(N), x.tail(N));
      if (plant.step(torque) != sim::Status::kOk) throw std::runtime_error("the step failed");
      return Eigen::VectorXd(plant.state().head(2 * N));
    };
    Eigen::VectorXd scale = Eigen::VectorXd::Ones(2 * N);
    scale.tail(N).setConstant(kRate);
    constexpr double kStep = 1e-5, kTorque = 1e-2;
    A.resize(2 * N, 2 * N);
    C.resize(2 * n, 2 * N);
    for (Eigen::Index j = 0; j < 2 * N; ++j) {
      const Eigen::VectorXd step = kStep * scale[j] * Eigen::VectorXd::Unit(2 * N, j);
      A.col(j) = (next(center + step, carried) - next(center - step, carried)) / (2 * kStep);
      sim::StateVector y = sim::StateVector::Zero(2 * N + sim::kWorkChannels);
      y[j] = scale[j];
      sim::JointVector shown, rate;
      arm.read_sensors(y, shown, rate);
      C.col(j) << shown, rate;
    }
    A = scale.cwiseInverse().asDiagonal() * A;
    B.resize(2 * N, n);
    for (Eigen::Index j = 0; j < n; ++j) {
      const sim::JointVector step = kTorque * sim::JointVector::Unit(n, j);
      B.col(j) = (next(center, carried + step) - next(center, carried - step)) / (2 * kTorque);
    }
    B = scale.cwiseInverse().asDiagonal() * B;
  }

  /// The map of the loop with u_k = F (shown positions, velocities), which acts `delay` ticks later
  /// behind a first-order low-pass of `cutoff` Hz (0: none); x is followed by the u on their way,
  /// the oldest first, and by the filter's torque.
  Eigen::MatrixXd closed(const Eigen::MatrixXd& F, double period, int delay, double cutoff) const {
    const Eigen::Index n = B.cols(), m = A.rows(), d = delay, f = cutoff > 0 ? 1 : 0;
    const double gain = f > 0 ? -std::expm1(-2 * std::numbers::pi * cutoff * period) : 1;
    const Eigen::Index rows = m + n * (d + f);
    Eigen::MatrixXd acting = Eigen::MatrixXd::Zero(n, rows);  // the torque in this period
    if (d == 0) {
      acting.leftCols(m) = gain * F * C;
    } else {
      acting.middleCols(m, n).diagonal().setConstant(gain);
    }
    if (f > 0) acting.rightCols(n).diagonal().setConstant(1 - gain);
    Eigen::MatrixXd map = Eigen::MatrixXd::Zero(rows, rows);
    map.topLeftCorner(m, m) = A;
    map.topRows(m) += B * acting;
    for (Eigen::Index k = 0; k + 1 < d; ++k)
      map.block(m + n * k, m + n * (k + 1), n, n).setIdentity();
    if (d > 0) map.block(m + n * (d - 1), 0, n, m) = F * C;
    if (f > 0) map.bottomRows(n) = acting;
    return map;
  }
};

/// Largest |z| of the motions that are faster than 0.01 1/s.
double spectral_radius(const Eigen::MatrixXd& map, double period) {
  double largest = 0;
  for (const std::complex<double>& z : map.eigenvalues()) {
    if (std::abs(std::log(z)) / period > 0.01) largest = std::max(largest, std::abs(z));
  }
  return largest;
}

/// The controller's d torque / d (position, velocity), n x 2n, where it has held the arm at q until
/// its springs rest, by central differences. `worst` is the worst status on the way. The settings'
/// watchdog of frozen feedback has to be off.
Eigen::MatrixXd feedback(controller::Controller& controller, controller::Setpoint setpoint,
                         const controller::JointVector& q, const controller::JointVector& weight,
                         double settling, controller::Status& worst) {
  constexpr double kStep = 1e-6;
  const Eigen::Index n = q.size();
  controller::RobotState state;
  state.velocity = controller::JointVector::Zero(n);
  controller::JointVector torque(n);
  worst = controller::Status::kOk;
  const auto tick = [&](const controller::JointVector& at, const controller::JointVector& rate) {
    state.time += std::llround(1e9 * controller.settings().period);
    state.position = at;
    state.velocity = rate;
    setpoint.time = state.time;
    worst = controller::worse(worst, controller.update(state, setpoint, torque));
    return torque;
  };
  const controller::JointVector none = controller::JointVector::Zero(n);
  controller.reset(weight);
  for (double t = 0; t < settling; t += controller.settings().period) tick(q, none);
  Eigen::MatrixXd F(n, 2 * n);
  for (Eigen::Index j = 0; j < 2 * n; ++j) {
    const controller::JointVector step = kStep * controller::JointVector::Unit(n, j % n);
    const auto moved = [&](double sign) {
      tick(q, none);
      return j < n ? tick(q + sign * step, none) : tick(q, sign * step);
    };
    const controller::JointVector ahead = moved(1), behind = moved(-1);
    F.col(j) = (ahead - behind) / (2 * kStep);
  }
  return F;
}

/// Differences of one loop, predicted and simulated.
struct ElasticDifference {
  double frequency = 0;  ///< largest, relative
  double ratio = 0;      ///< largest
  double margin = 0;     ///< relative, of the boundary that bisection finds
  int modes = 0;         ///< compared
  bool bounded = false;  ///< there is a boundary
  bool stable = false;
  bool link = false;  ///< measured there
  controller::Status status = controller::Status::kOk;

  bool agrees() const {
    return status == controller::Status::kOk && frequency < 1e-4 && ratio < 1e-3 && margin < 1e-3;
  }
};

std::ostream& operator<<(std::ostream& out, const ElasticDifference& seen) {
  return out << (seen.link ? "link" : "motor") << ", frequency off by " << seen.frequency
             << ", ratio by " << seen.ratio << ", margin by " << seen.margin << "; "
             << to_text(seen.status);
}

/// A loop drawn from a seed: arm, gears of 5e3 to 1e5 N m/rad, sensor, rotors,
/// payload, gains of either mode with a ratio or constant damping, period,
/// delay and low-pass.
class DrawnElasticLoop {
 public:
  explicit DrawnElasticLoop(std::uint64_t seed)
      : arm_(arms()[seed % arms().size()]), dice_(seed), twin_(arm_) {
    const Eigen::Index n = twin_.dof();
    link_ = dice_.integer(0, 1) == 1;
    controller::ModelOptions told;
    told.reflected_inertia = told.gear_stiffness = told.gear_damping = sim::JointVector(n);
    const double ratio = dice_.log_uniform(0.005, 0.05);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double K = dice_.log_uniform(5e3, 1e5), B = dice_.log_uniform(0.05, 0.5);
      told.gear_stiffness[i] = K;
      told.reflected_inertia[i] = B;
      told.gear_damping[i] = 2 * ratio * std::sqrt(K * B);
    }
    if (dice_.integer(0, 2) == 0) {
      told.payload.mass = dice_.uniform(0.5, 3);
      told.payload.center = 0.05 * dice_.vector(3);
    }
    told.position_sensor =
        link_ ? controller::PositionSensor::kLink : controller::PositionSensor::kMotor;
    // The analysis takes the posture from the sensors. Behind motors the links are elsewhere, by
    // what their weight makes of the gears, and so are their inertia and Jacobian.
    if (!link_) told.gravity.setZero();
    twin_.model = arm_model(arm_, told);
    sim::RobotParameters parameters;
    parameters.reflected_inertia = told.reflected_inertia;
    parameters.gear_stiffness = told.gear_stiffness;
    parameters.gear_damping = told.gear_damping;
    parameters.gravity = told.gravity;
    parameters.payload = {told.payload.mass, told.payload.center, told.payload.inertia};
    twin_.robot = sim::Robot::from_file(arm_path(arm_.file), arm_.base, arm_.tip, parameters);
    loop_.period = 5e-4 * (1 << dice_.integer(0, 2));
    loop_.delay = dice_.integer(0, 3);
    loop_.torque_cutoff = dice_.integer(0, 1) * dice_.log_uniform(50, 300);
    q_ = random_posture(twin_, dice_);
    draw_gains();
  }

  ElasticDifference compare() {
    ElasticDifference result;
    result.link = link_;
    const Eigen::Index n = q_.size();
    const auto weight = [&](const sim::JointVector& q) {
      return controller::evaluate(twin_.model, q, sim::JointVector::Zero(n)).gravity;
    };
    sim::ArmOptions options;
    options.coulomb_friction = false;
    if (link_) options.position_sensor = sim::PositionSensor::kLink;
    sim::Arm arm(twin_.robot, options);
    const ArmMap map(arm, q_, loop_.period, weight);
    controller::Controller controller(twin_.model, settings_);
    controller::Setpoint setpoint = settings_.initial;
    setpoint.joint_position = q_;
    const auto there = controller::evaluate(twin_.model, q_, sim::JointVector::Zero(n));
    setpoint.tip_pose = {there.p_BT_B, there.R_BT};
    const Eigen::MatrixXd F =
        feedback(controller, setpoint, q_, there.gravity, 200 * loop_.period, result.status);
    analysis::System<controller::kMaxJoints> system;
    controller.closed_loop(system);
    const Eigen::MatrixXd G = twin_.gravity_gradient(q_);
    analysis::SampledLoop loop = loop_;
    loop.friction = twin_.friction();
    loop.gravity_gradient = G;
    loop.gears = controller::elastic_joints(twin_.model);
    loop = analysis::with_gears(loop);
    analysis::Spectrum<controller::kMaxJoints> spectrum;
    analysis::SpectrumSolver<controller::kMaxJoints>().solve(system, spectrum);
    const analysis::SampledSpectrum sampled = sample_loop(system, spectrum, loop);
    result.stable = sampled.stable();
    const Eigen::VectorXcd seen =
        map.closed(F, loop.period, loop.delay, loop.torque_cutoff).eigenvalues();
    for (const analysis::SampledMode& mode : sampled.modes) compare(mode, seen, result);

    const double margin = gain_margin(system, spectrum, loop, 1e3);
    result.bounded = margin > 0 && std::isfinite(margin);
    if (!result.bounded) return result;
    Eigen::MatrixXd held = Eigen::MatrixXd::Zero(n, 2 * n);
    held.leftCols(n) = G;
    const auto stable = [&](double factor) {
      const Eigen::MatrixXd law = held + factor * (F - held);
      return spectral_radius(map.closed(law, loop.period, loop.delay, loop.torque_cutoff),
                             loop.period) < 1;
    };
    double low = 0.95 * margin, high = 1.05 * margin;
    const bool below = stable(low);
    result.margin = 1;
    if (stable(high) == below) return result;  // the boundary is not there
    for (int k = 0; k < 12; ++k) {
      const double middle = 0.5 * (low + high);
      (stable(middle) == below ? low : high) = middle;
    }
    result.margin = std::abs(0.5 * (low + high) / margin - 1);
    return result;
  }

 private:
  void draw_gains() {
    controller::Settings& settings = settings_ = controller::default_settings(twin_.model);
    settings.period = loop_.period;
    settings.motion.gain_time = loop_.period;
    settings.motion.smoothing = 20 * loop_.period;
    settings.watchdog.setpoint_hold = settings.watchdog.setpoint_damp = 0;
    settings.watchdog.feedback = 0;
    settings.analysis.share = 1;
    settings.limits.beyond_model = true;
    settings.limits.torque.setConstant(1e4);
    settings.limits.torque_rate.setConstant(1e6);
    settings.limits.gain_margin = 1;
    // The brake has nothing to do, however stiff the gears are.
    settings.limits.stopping_time = 100;
    settings.limits.velocity.setConstant(1e6);
    settings.limits.position_upper.setConstant(std::numeric_limits<double>::infinity());
    settings.limits.position_lower = -settings.limits.position_upper;
    controller::Gains& gains = settings.initial.gains;
    settings.initial.mode =
        dice_.integer(0, 1) == 1 ? controller::Mode::kCartesian : controller::Mode::kJoint;
    const double scale = dice_.log_uniform(0.3, 10);
    gains.joint_stiffness *= scale;
    gains.task_stiffness *= scale;
    const bool constant = dice_.integer(0, 3) == 0;
    const double ratio = constant ? 0 : dice_.uniform(0.3, 1);
    gains.joint_damping_ratio = gains.task_damping_ratio = ratio;
    if (constant) gains.null_damping_ratio = 0;
  }

  void compare(const analysis::SampledMode& mode, const Eigen::VectorXcd& seen,
               ElasticDifference& result) const {
    constexpr double kFastest = 2.5;  // |log z|, beyond which a motion is seen at wrong frequencies
    std::complex<double> found[2];
    for (std::size_t i = 0; i < 2; ++i) {
      const std::complex<double> z = mode.discrete_eigenvalues[i];
      if (!(std::abs(std::log(z)) < kFastest)) return;
      Eigen::Index nearest = 0;
      (seen.array() - z).abs().minCoeff(&nearest);
      found[i] = std::log(seen[nearest]) / loop_.period;
    }
    const std::complex<double> product = found[0] * found[1], sum = found[0] + found[1];
    const double omega = std::sqrt(std::abs(product)), zeta = -sum.real() / (2 * omega);
    result.frequency = std::max(result.frequency, std::abs(omega / mode.natural_frequency - 1));
    result.ratio = std::max(result.ratio, std::abs(zeta - mode.damping_ratio));
    ++result.modes;
  }

  Arm arm_;
  Dice dice_;
  TwinModels twin_;
  bool link_ = false;
  sim::JointVector q_;
  controller::Settings settings_;
  analysis::SampledLoop loop_;
};

TEST(ElasticPrediction, IsWhatTheSimulatedLoopDoes) {
  DASHPOT_SKIP_IF_QUICK();
  constexpr int kLoops = 24;
  ElasticDifference worst;
  int bounded = 0, unstable = 0;
  for (std::uint64_t seed = 1; seed <= kLoops; ++seed) {
    const ElasticDifference seen = DrawnElasticLoop(seed).compare();
    EXPECT_TRUE(seen.agrees()) << "seed " << seed << ": " << seen;
    worst.frequency = std::max(worst.frequency, seen.frequency);
    worst.ratio = std::max(worst.ratio, seen.ratio);
    worst.margin = std::max(worst.margin, seen.margin);
    worst.modes += seen.modes;
    bounded += seen.bounded ? 1 : 0;
    unstable += seen.stable ? 0 : 1;
  }
  std::cout << worst.modes << " modes of " << kLoops << " loops, " << unstable
            << " unstable: frequency within " << worst.frequency << ", ratio within " << worst.ratio
            << ", " << bounded << " margins within " << worst.margin << std::endl;
  EXPECT_GT(worst.modes, 5 * kLoops);
  EXPECT_GT(bounded, kLoops / 2);
  EXPECT_GT(unstable, 0);
  EXPECT_LT(unstable, kLoops);
}

}  // namespace
}  // namespace dashpot::testing
