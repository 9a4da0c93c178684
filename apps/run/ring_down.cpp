#include <dashpot/apps/loop/simulated_loop.hpp>
#include <dashpot/apps/report/modes.hpp>
#include <dashpot/apps/run/run_report.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/identification/identification.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace dashpot::apps {

std::optional<PredictedRelease> predict_release(const Scene& scene) {
  analysis::Cause cause{scene.start - scene.rest, scene.velocity, {}, {}};
  if (cause.position->isZero(0) && cause.velocity->isZero(0)) return std::nullopt;
  PredictedRelease result;
  const controller::Config& config = scene.arm->config;
  const controller::Setpoint& setpoint = scene.steps.front().setpoint;
  controller::PostureLoop loop(config.model, config.settings);
  const analysis::System<> system = loop.at(scene.rest, setpoint.gains, setpoint.mode).system;
  if (system.dof() != scene.dof()) return std::nullopt;
  const JointVector still = JointVector::Zero(scene.dof());
  const Eigen::MatrixXd tip = evaluate(config.model, scene.rest, still).J.topRows<3>();
  result.spectrum = analysis::analyze(system);
  if (result.spectrum.modes.empty()) return std::nullopt;
  result.shares = analysis::mode_shares(system, result.spectrum, cause, tip);
  return result;
}

namespace {

constexpr double kRelease = 1e-4;       // rad: nonlinear terms are smaller by this factor
constexpr double kDuration = 2;         // s
constexpr double kSamplePeriod = 1e-3;  // s, or one control period if that is longer
constexpr double kFarthest = 0.5;       // relative distance of eigenvalues of one mode

/// The scene from another start, without pushes and steps, with exact sensors.
Scene quiet_scene(const Scene& scene, const JointVector& start) {
  Scene quiet = scene;
  quiet.start = start;
  quiet.velocity.setZero();
  quiet.plant.position_noise.resize(0);
  quiet.plant.velocity_noise.resize(0);
  quiet.plant.position_resolution.resize(0);
  quiet.arm->options.wrenches.clear();
  quiet.steps.resize(1);
  return quiet;
}

struct RecordedMotion {
  identification::MotionRecord record;  ///< positions
  dashpot_modes modes{};                ///< the first ones
};

/// Returns nothing if `stopped` returns true first.
std::optional<RecordedMotion> record(const Scene& scene, const ControllerFactory& make_controller,
                                     int every, const std::function<bool()>& stopped) {
  const auto controller = make_controller();
  ClosedLoop loop(scene, *controller);
  const auto samples = static_cast<Eigen::Index>(kDuration / (every * scene.plant.period));
  RecordedMotion motion;
  motion.record.time = Eigen::VectorXd::LinSpaced(
      samples, 0, static_cast<double>(samples - 1) * every * scene.plant.period);
  motion.record.output.resize(scene.dof(), samples);
  for (Eigen::Index i = 0; i < samples; ++i) {
    if (stopped()) return std::nullopt;
    motion.record.output.col(i) = loop.plant().position();
    for (int k = 0; k < every; ++k) {
      loop.follow_scenario();
      loop.control();
      const dashpot_modes* modes = controller->new_modes();
      // The first tick may leave its modes to another thread, and there are none yet then.
      const bool first = modes != nullptr && modes->time >= 0 && motion.modes.count == 0;
      if (first) motion.modes = *modes;
      const sim::Status status = loop.move();
      if (status != sim::Status::kOk) {
        throw std::runtime_error(std::string("a small release does not ring down: ") +
                                 sim::to_text(status));
      }
    }
  }
  return motion;
}

using Eigenvalues = std::array<analysis::Complex, 2>;

Eigenvalues eigenvalues(const dashpot_mode& mode) {
  const auto& [first, second] = mode.eigenvalues;
  return {analysis::Complex(first[0], first[1]), analysis::Complex(second[0], second[1])};
}

/// How far `other` is from `wanted`, relative.
double distance(const Eigenvalues& wanted, const Eigenvalues& other) {
  double sum = 0;
  for (std::size_t k = 0; k < 2; ++k) sum += std::norm(other[k] - wanted[k]) / std::norm(wanted[k]);
  return std::sqrt(sum);
}

/// A row that has only the prediction so far, and its eigenvalues.
struct Row {
  RingDownMode mode;
  Eigenvalues place;
};

std::vector<Row> rows_of(const dashpot_modes& predicted) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  std::vector<Row> rows;
  for (std::uint32_t i = 0; i < predicted.count; ++i) {
    const dashpot_mode& mode = predicted.modes[i];
    rows.push_back(
        {{mode.label, mode.natural_frequency, mode.damping_ratio, kNaN, kNaN, kNaN, kNaN},
         eigenvalues(mode)});
  }
  return rows;
}

/// The loop of a scene as its drives hold, delay and filter the torque; friction and gravity come
/// from the controller's model.
controller::PostureLoop sampled_as(const Scene& scene) {
  controller::Settings settings = scene.arm->config.settings;
  settings.period = scene.plant.period;
  settings.analysis.sampled.delay = scene.plant.delay;
  settings.analysis.sampled.cutoff = scene.plant.torque_cutoff;
  settings.analysis.sampled.difference_velocity = scene.plant.difference_velocity;
  return {scene.arm->config.model, settings};
}

/// Adds the modes and eigenvalues of the sampled loop. A mode that moves further than kFarthest has
/// no counterpart there, because it could be another mode's.
void add_sampled(const Scene& scene, RingDown& ring_down, std::vector<Row>& rows) {
  controller::PostureLoop at_rest = sampled_as(scene);
  const controller::Setpoint& setpoint = scene.steps.front().setpoint;
  const auto [system, loop] = at_rest.at(scene.rest, setpoint.gains, setpoint.mode);
  ring_down.assumes = controller::assumption_names(at_rest.arm().assumes());
  const analysis::Spectrum<> continuous = analysis::analyze(system);
  const analysis::SampledSpectrum sampled = analysis::sample_loop(system, continuous, loop);
  ring_down.gain_margin = analysis::gain_margin(system, continuous, loop);
  ring_down.growth = std::max(0.0, std::log(sampled.spectral_radius) / scene.plant.period);
  ring_down.integral_decays = controller::integral_decays(sampled, scene.plant.period);
  for (auto& [row, place] : rows) {
    for (int i = 0; i < continuous.modes.size(); ++i) {
      const analysis::Mode<>& from = continuous.modes[i];
      const analysis::SampledMode& to = sampled.modes[static_cast<std::size_t>(i)];
      const bool same = std::abs(from.natural_frequency - row.predicted_frequency) <=
                            1e-6 * row.predicted_frequency &&
                        std::abs(from.damping_ratio - row.predicted_ratio) <= 1e-6;
      if (!same || distance(from.eigenvalues, to.eigenvalues) > kFarthest) continue;
      row.sampled_frequency = to.natural_frequency;
      row.sampled_ratio = to.damping_ratio;
      place = to.eigenvalues;
    }
  }
}

/// Gives rows the modes of the motion whose eigenvalues are nearest: the motion is the sampled
/// loop's, in which close modes may change places. A row without one within kFarthest stays alone.
void add_measured(const std::vector<identification::MeasuredMode>& fitted, std::vector<Row>& rows) {
  Eigen::MatrixXd apart(static_cast<Eigen::Index>(rows.size()),
                        static_cast<Eigen::Index>(fitted.size()));
  for (Eigen::Index i = 0; i < apart.rows(); ++i) {
    for (Eigen::Index k = 0; k < apart.cols(); ++k) {
      apart(i, k) = distance(rows[static_cast<std::size_t>(i)].place,
                             fitted[static_cast<std::size_t>(k)].eigenvalues);
    }
  }
  const std::vector<int> pairs = nearest_pairs(apart, kFarthest);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (pairs[i] < 0) continue;
    const identification::MeasuredMode& mode = fitted[static_cast<std::size_t>(pairs[i])];
    rows[i].mode.measured_frequency = mode.natural_frequency;
    rows[i].mode.measured_ratio = mode.damping_ratio;
  }
}

}  // namespace

std::optional<RingDown> measure_ring_down(const Scene& scene,
                                          const ControllerFactory& make_controller,
                                          const std::function<bool()>& stopped) {
  const int every = std::max(1, static_cast<int>(std::lround(kSamplePeriod / scene.plant.period)));
  const auto rest = record(quiet_scene(scene, scene.rest), make_controller, every, stopped);
  if (!rest) return std::nullopt;
  std::vector<identification::MotionRecord> records;
  for (int i = 0; i < scene.dof(); ++i) {
    const JointVector start = scene.rest + kRelease * JointVector::Unit(scene.dof(), i);
    auto motion = record(quiet_scene(scene, start), make_controller, every, stopped);
    if (!motion) return std::nullopt;
    // Motion without a release, such as sagging, is subtracted.
    motion->record.output -= rest->record.output;
    records.push_back(std::move(motion->record));
  }
  const identification::Identification fit = identification::identify_decays(records);
  RingDown result;
  result.releases = scene.dof();
  result.residual = std::sqrt(1 - fit.explained);
  std::vector<Row> rows = rows_of(rest->modes);
  add_sampled(scene, result, rows);
  // Without noise all found modes exist, even those that would be doubtful in a record of an arm.
  std::vector<identification::MeasuredMode> found = fit.modes;
  found.insert(found.end(), fit.rejected.begin(), fit.rejected.end());
  add_measured(found, rows);
  for (const Row& row : rows) result.modes.push_back(row.mode);
  return result;
}

}  // namespace dashpot::apps
