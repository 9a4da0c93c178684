#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/sensitivity.hpp>
#include <dashpot/apps/cli/system_file.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/tune/tuned_loop.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/elastic_joints.hpp>
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/controller/settings_check.hpp>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <complex>
#include <exception>
#include <mutex>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <thread>

namespace dashpot::apps {
namespace {

using controller::InputError;
using controller::JointVector;
using controller::Mode;
using controller::PostureNumbers;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using LoopJson = nlohmann::ordered_json;

/// A place of the arm that moves: the row d of its motion, and the joint motion that moves it by
/// one unit, n each.
struct Place {
  Eigen::RowVectorXd row;
  VectorXd motion;
  std::string unit;  ///< of its receptance
  bool linear = false;
};

/// J# = M^-1 J' (J M^-1 J')^-1; next to a singularity that of the directions left.
MatrixXd consistent_inverse(const MatrixXd& M, const MatrixXd& J) {
  const Eigen::LLT<MatrixXd> mass(M);
  const MatrixXd X = mass.matrixL().solve(J.transpose());  // J M^-1 J' = X'X
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> solve;
  solve.setThreshold(1e-6);
  solve.compute(X.transpose());
  return mass.matrixU().solve(solve.pseudoInverse());
}

Place place_of(const std::string& place, const MatrixXd& M, const MatrixXd& J) {
  const bool tip = place.starts_with("tip/"), joint = place.starts_with("joint/");
  const std::string digits = place.substr(std::min(place.find('/') + 1, place.size()));
  const bool number = !digits.empty() && digits.size() < 3 &&
                      digits.find_first_not_of("0123456789") == std::string::npos;
  const int i = number ? std::stoi(digits) : -1;
  const Eigen::Index n = M.rows();
  if (joint && i >= 0 && i < n) return {VectorXd::Unit(n, i), VectorXd::Unit(n, i), "rad/(N m)"};
  if (!tip || i < 0 || i > 5) throw InputError("place", "there is no such place on this arm");
  return {J.row(i), consistent_inverse(M, J).col(i), i < 3 ? "m/N" : "rad/(N m)", i < 3};
}

PostureNumbers numbers_of(const analysis::Spectrum<>& spectrum, double soft) {
  PostureNumbers result;
  double ratio = std::numeric_limits<double>::infinity(), fastest = ratio;
  result.zero_modes = spectrum.zero_modes.count;
  for (const analysis::Mode<>& mode : spectrum.modes) {
    for (const auto& value : mode.eigenvalues) fastest = std::min(fastest, value.real());
    if (mode.kind == analysis::ModeKind::kSoft || mode.natural_frequency < soft) {
      ++result.zero_modes;
    } else if (!std::isnan(mode.damping_ratio)) {
      ratio = std::min(ratio, mode.damping_ratio);
    }
  }
  for (const double rate : spectrum.zero_mode_rates) {
    if (!std::isnan(rate)) fastest = std::min(fastest, rate);
  }
  if (std::isfinite(ratio)) result.smallest_ratio = ratio;
  if (std::isfinite(fastest)) result.fastest_pole = fastest;
  return result;
}

/// The joint with the largest part of a shape.
int largest_joint(const Eigen::VectorXcd& shape, int n) {
  Eigen::Index at = 0;
  shape.head(n).cwiseAbs().maxCoeff(&at);
  return static_cast<int>(at);
}

/// How a motion that is let go one unit away comes to rest, and how that looks from the goal: the
/// step to a goal one unit away is one minus it.
LoopJson release_json(const analysis::Response& response, const analysis::Spectrum<>& spectrum,
                      const VectorXd& motion, const Eigen::RowVectorXd& row) {
  double decay = std::numeric_limits<double>::infinity();
  for (const analysis::Mode<>& mode : spectrum.modes) {
    for (const auto& value : mode.eigenvalues) {
      if (std::abs(value) > controller::kSoftFrequency) decay = std::min(decay, -value.real());
    }
  }
  constexpr int kPoints = 401;
  constexpr double kSettled = 0.02;
  const VectorXd rest = VectorXd::Zero(motion.size());
  const auto value_at = [&](double t) { return row.dot(response.free(motion, rest, t).position); };
  const bool grows = decay < 0;
  double horizon = 20;
  if (std::isfinite(decay) && decay != 0) {
    horizon = std::clamp(grows ? -1.5 / decay : 5 / decay, 0.02, 20.0);
  }
  std::vector<double> times(kPoints), values(kPoints);
  int last = 0;
  for (int round = 0; round < 2; ++round) {
    last = 0;
    for (int i = 0; i < kPoints; ++i) {
      const auto k = static_cast<std::size_t>(i);
      times[k] = horizon * i / (kPoints - 1);
      values[k] = value_at(times[k]);
      if (std::abs(values[k]) > kSettled) last = i;
    }
    if (grows || last > kPoints / 4) break;  // otherwise a slow mode that this place hardly sees
    horizon = std::max(3 * times[static_cast<std::size_t>(last) + 1], 0.02);
  }
  const auto lowest = std::min_element(values.begin(), values.end());
  double overshoot = std::max(0.0, -*lowest);
  if (overshoot > 0) {  // between the points, by ternary search
    const auto at = static_cast<std::size_t>(lowest - values.begin());
    double a = times[at == 0 ? 0 : at - 1], b = times[std::min(at + 1, times.size() - 1)];
    for (int i = 0; i < 40; ++i) {
      const double c = a + (b - a) / 3, d = b - (b - a) / 3;
      (value_at(c) < value_at(d) ? b : a) = value_at(c) < value_at(d) ? d : c;
    }
    overshoot = std::max(overshoot, -value_at(0.5 * (a + b)));
  }
  LoopJson settling;
  if (!grows && last + 1 < kPoints) {
    double a = times[static_cast<std::size_t>(last)], b = times[static_cast<std::size_t>(last) + 1];
    for (int i = 0; i < 40; ++i) {
      const double c = 0.5 * (a + b);
      (std::abs(value_at(c)) > kSettled ? a : b) = c;
    }
    settling = b;
  }
  return {{"time", times},
          {"value", values},
          {"overshoot", grows ? LoopJson() : LoopJson(overshoot)},
          {"settling_time", settling}};
}

LoopJson frequency_json(const analysis::Response& response, const analysis::Spectrum<>& spectrum,
                        const Eigen::RowVectorXd& row, const std::string& unit) {
  double slowest = 10, fastest = 10;
  LoopJson natural = LoopJson::array();
  for (const analysis::Mode<>& mode : spectrum.modes) {
    const double frequency = mode.natural_frequency;
    natural.push_back(frequency);
    if (!std::isfinite(frequency) || frequency < controller::kSoftFrequency) continue;
    slowest = std::min(slowest, frequency);
    fastest = std::max(fastest, frequency);
  }
  constexpr int kPoints = 161;
  std::vector<double> omegas, magnitudes, phases;
  double phase = 0;
  for (int i = 0; i < kPoints; ++i) {
    const double omega = 0.1 * slowest * std::pow(100 * fastest / slowest, i / (kPoints - 1.0));
    const std::complex<double> h = (row * response.receptance(omega) * row.transpose())(0, 0);
    phase += std::remainder(std::arg(h) - phase, 2 * M_PI);
    omegas.push_back(omega);
    magnitudes.push_back(std::abs(h));
    phases.push_back(phase);
  }
  return {{"omega", omegas},
          {"magnitude", magnitudes},
          {"phase", phases},
          {"unit", unit},
          {"natural_frequency", natural}};
}

/// d ratio / d entry of the stiffness and damping that the controller has, a matrix a mode.
LoopJson sensitivity_json(const analysis::System<>& system, const analysis::Spectrum<>& spectrum,
                          const MatrixXd* J) {
  LoopJson of_stiffness = LoopJson::array(), of_damping = LoopJson::array();
  for (const analysis::ModeSensitivity& mode : analysis::sensitivities(system, spectrum)) {
    const auto rows = [J](const MatrixXd& G) {
      return json_rows(J != nullptr ? analysis::task_gradient(*J, G) : G);
    };
    of_stiffness.push_back(rows(mode.stiffness.damping_ratio));
    of_damping.push_back(rows(mode.damping.damping_ratio));
  }
  return {{"stiffness", of_stiffness}, {"damping", of_damping}};
}

/// Which motion comes to the edge of stability first when the gains grow: the loop with gains just
/// beyond the margin has a z outside the unit circle.
LoopJson limit_json(const analysis::System<>& system, const analysis::SampledLoop& loop,
                    double margin, const controller::RobotModel& model) {
  if (!(margin > 0) || !std::isfinite(margin)) return nullptr;
  const double factor = 1.001 * margin;
  const Eigen::Index n = system.dof();
  const auto scaled = [&](const MatrixXd& all, const MatrixXd& passive) {
    const MatrixXd kept = passive.size() == 0 ? MatrixXd::Zero(n, n) : passive;
    return MatrixXd(kept + factor * (all - kept));
  };
  analysis::System<> edge(n);
  edge.mass = system.mass;
  edge.stiffness = scaled(system.stiffness, loop.passive_stiffness);
  edge.damping = scaled(system.damping, loop.friction);
  analysis::SampledLoop grown = loop;
  grown.memory.output *= factor;
  const analysis::Spectrum<> spectrum = analysis::analyze(edge);
  const analysis::SampledSpectrum found = analysis::sample_loop(edge, spectrum, grown);
  double largest = 0, turn = 0;
  int mode = -1;
  const auto see = [&](std::complex<double> z, int of) {
    if (std::abs(z) <= largest || std::abs(std::log(z)) < controller::kSoftFrequency * loop.period)
      return;
    largest = std::abs(z);
    turn = std::abs(std::arg(z));
    mode = of;
  };
  for (std::size_t i = 0; i < found.modes.size(); ++i) {
    for (const auto& z : found.modes[i].discrete_eigenvalues) see(z, static_cast<int>(i));
  }
  for (const auto* others : {&found.zero_modes, &found.memory, &found.others}) {
    for (const auto& z : *others) see(z, -1);
  }
  if (largest < 1) return nullptr;
  LoopJson joint;
  if (mode >= 0 && mode < spectrum.modes.size()) {
    joint = model
                .joints()[static_cast<std::size_t>(
                    largest_joint(spectrum.modes[mode].shapes[0], model.dof()))]
                .name;
  }
  return {{"frequency", turn / loop.period}, {"joint", joint}};
}

/// Sets C_C, or C_q, of the damping that the controller has designed: with J# of
/// `consistent_inverse` the null space's dampers vanish in J#' (C - friction) J#.
void set_designed_damping(const analysis::System<>& system, const MatrixXd& friction,
                          analysis::TaskImpedance& parts) {
  if (!parts.jacobian) {
    parts.damping = system.damping;
    return;
  }
  const MatrixXd& J = *parts.jacobian;
  const MatrixXd inverse = consistent_inverse(parts.mass, J);
  parts.task_damping = inverse.transpose() * (system.damping - friction) * inverse;
  parts.damping = system.damping - J.transpose() * *parts.task_damping * J;
}

/// Stiffness and damping that act at the tip or in the joints, without friction; without `known`
/// the damping is no single matrix.
LoopJson gains_json(const analysis::TaskImpedance& parts, const MatrixXd& friction, bool known) {
  if (parts.jacobian) {
    return {{"stiffness", json_rows(*parts.task_stiffness)},
            {"damping", known ? json_rows(*parts.task_damping) : LoopJson()}};
  }
  return {{"stiffness", json_rows(*parts.stiffness)},
          {"damping", known ? json_rows(*parts.damping - friction) : LoopJson()}};
}

/// The loop as `dashpot analyze` takes it: as its parts, or where gears bend as a whole.
LoopJson system_json(const analysis::System<>& system, const analysis::TaskImpedance& parts,
                     bool rigid) {
  if (!rigid) {
    return {{"mass", json_rows(system.mass)},
            {"damping", json_rows(system.damping)},
            {"stiffness", json_rows(system.stiffness)}};
  }
  LoopJson result = {{"mass", json_rows(parts.mass)}};
  const auto add = [&result](const char* name, const std::optional<MatrixXd>& matrix) {
    if (matrix) result[name] = json_rows(*matrix);
  };
  add("jacobian", parts.jacobian);
  add("task_stiffness", parts.task_stiffness);
  add("task_damping", parts.task_damping);
  add("stiffness", parts.stiffness);
  add("damping", parts.damping);
  return result;
}

LoopJson refusal_json(const std::string& key, const std::string& reason) {
  return {{"key", key}, {"reason", reason}};
}

}  // namespace

TunedLoop::TunedLoop(const TunedArm& arm, const TunedDesign& design)
    : arm_(arm),
      design_(design),
      audit_(arm.model(), design.stated),
      gears_(controller::elastic_joints(arm.model())) {
  if (!design.designed()) return;
  validate(design.settings, arm.model().dof());
}

analysis::System<controller::kMaxJoints> TunedLoop::designed_system(
    const JointVector& q, controller::PostureLoop& loop) const {
  analysis::System<controller::kMaxJoints> system;
  const controller::Status status =
      loop.closed_loop(q, design_.settings.initial.gains, design_.stated.mode, system);
  if (status != controller::Status::kOk) throw InputError("q", "is no posture");
  return system;
}

TunedLoop::There TunedLoop::there(const JointVector& q) const {
  There result;
  result.parts = audit_.impedance(q);
  if (design_.stated.period > 0) result.sampled = audit_.loop(q);
  result.sampled.gears = gears_;
  analysis::SpectrumOptions options;
  options.soft_frequency = design_.stated.soft_frequency;
  if (design_.designed()) {
    controller::PostureLoop loop(arm_.model(), design_.settings);
    const analysis::System<controller::kMaxJoints> system = designed_system(q, loop);
    result.system = analysis::System<>(system.dof());
    result.system.mass = system.mass;
    result.system.damping = system.damping;
    result.system.stiffness = system.stiffness;
    result.system.stiffness_factor = system.stiffness_factor;
  } else {
    SystemEntry entry;
    entry.gears = gears_;
    result.system = entry.system(result.parts);
  }
  result.spectrum = analysis::analyze(result.system, options);
  return result;
}

PostureNumbers TunedLoop::numbers(const There& loop) const {
  PostureNumbers result = numbers_of(loop.spectrum, design_.stated.soft_frequency);
  if (design_.stated.period > 0) {
    result.gain_margin =
        analysis::gain_margin(loop.system, loop.spectrum, analysis::with_gears(loop.sampled), 1e6,
                              design_.stated.soft_frequency);
  }
  return result;
}

PostureNumbers TunedLoop::numbers(const JointVector& q, controller::PostureLoop* loop) const {
  if (loop == nullptr) return audit_.numbers(q);
  const std::optional<PostureNumbers> quick = audit_.numbers(q, designed_system(q, *loop));
  return quick ? *quick : numbers(there(q));
}

nlohmann::ordered_json TunedLoop::workspace(std::uint64_t seed, std::int64_t first,
                                            std::int64_t count) const {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::vector<PostureNumbers> found(static_cast<std::size_t>(count));
  std::atomic<std::int64_t> next = 0;
  std::exception_ptr failure;
  std::once_flag failed;
  const auto find = [&] {
    std::optional<controller::PostureLoop> loop;
    if (design_.designed()) loop.emplace(arm_.model(), design_.settings);
    for (std::int64_t i = next++; i < count; i = next++) {
      PostureNumbers& here = found[static_cast<std::size_t>(i)];
      try {
        here = numbers(audit_.posture(seed, first + i), loop ? &*loop : nullptr);
      } catch (const std::runtime_error&) {  // an eigenvalue iteration that fails has no numbers
        here = {};
      }
    }
  };
  const auto work = [&]() noexcept {
    try {
      find();
    } catch (...) {
      next = count;
      std::call_once(failed, [&] { failure = std::current_exception(); });
    }
  };
  {
    std::vector<std::jthread> threads;
    threads.reserve(std::thread::hardware_concurrency());
    for (unsigned k = 1; k < std::thread::hardware_concurrency(); ++k) threads.emplace_back(work);
    work();
  }
  if (failure) std::rethrow_exception(failure);
  LoopJson result = {{"smallest_ratio", LoopJson::array()},
                     {"gain_margin", LoopJson::array()},
                     {"worst", LoopJson::object()}};
  const auto add = [&](const char* name, double PostureNumbers::*number) {
    double worst = kNone;
    std::int64_t at = -1;
    for (std::int64_t i = 0; i < count; ++i) {
      const double value = found[static_cast<std::size_t>(i)].*number;
      result[name].push_back(std::isinf(value) ? 1e6 : value);
      if (std::isnan(value) || value >= worst) continue;
      worst = value;
      at = i;
    }
    if (at < 0) return;
    result["worst"][name] = {{"value", std::isinf(worst) ? 1e6 : worst},
                             {"q", json_list(audit_.posture(seed, first + at))}};
  };
  add("smallest_ratio", &PostureNumbers::smallest_ratio);
  add("gain_margin", &PostureNumbers::gain_margin);
  return result;
}

nlohmann::ordered_json TunedLoop::at(const JointVector& q, const std::string& place) const {
  There loop = there(q);
  const controller::RobotModel& model = arm_.model();
  const int n = model.dof();
  const MatrixXd J = controller::evaluate(model, q, JointVector::Zero(n)).J;
  const Place moved = place_of(place, loop.parts.mass, J);
  const bool rigid = !gears_.any();
  const MatrixXd friction = model.joint_values(&controller::Joint::viscous_friction).asDiagonal();
  if (design_.designed() && rigid) set_designed_damping(loop.system, friction, loop.parts);
  const PostureNumbers here = numbers(loop);

  const Eigen::Index size = loop.system.dof();
  VectorXd motion = VectorXd::Zero(size);
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(size);
  motion.head(n) = moved.motion;
  row.head(n) = moved.row;
  for (std::size_t k = 0; k < gears_.joints().size(); ++k) {
    motion[n + static_cast<Eigen::Index>(k)] = moved.motion[gears_.joints()[k]];
  }
  const analysis::Response response(loop.system, loop.spectrum);
  LoopJson result = {{"modes", modes_json(loop.spectrum)},
                     {"zero_modes", json_rows(loop.spectrum.zero_modes.basis.transpose())},
                     {"soft_or_zero", here.zero_modes},
                     {"smallest_ratio", here.smallest_ratio},
                     {"fastest_pole", here.fastest_pole},
                     {"gain_margin", std::isinf(here.gain_margin) ? 1e6 : here.gain_margin},
                     {"limit", nullptr},
                     {"release", release_json(response, loop.spectrum, motion, row)},
                     {"frequency", frequency_json(response, loop.spectrum, row, moved.unit)},
                     {"sensitivity", nullptr},
                     {"system", system_json(loop.system, loop.parts, rigid)},
                     {"gains", gains_json(loop.parts, friction, !design_.designed() || rigid)}};
  if (design_.stated.period > 0) {
    result["limit"] =
        limit_json(loop.system, analysis::with_gears(loop.sampled), here.gain_margin, model);
  }
  const bool task = design_.stated.mode == Mode::kCartesian;
  if (rigid && !design_.stated.inertia_blocks) {
    result["sensitivity"] =
        sensitivity_json(loop.system, loop.spectrum, task ? &*loop.parts.jacobian : nullptr);
  }
  return result;
}

nlohmann::ordered_json refusals(const TunedArm& arm, const TunedDesign& design,
                                const JointVector& q) {
  LoopJson result = LoopJson::array();
  const controller::Gains& gains = design.settings.initial.gains;
  const bool null_space = !gains.null_stiffness.isZero(0) || !gains.null_damping.isZero(0);
  if (design.stated.kinematic_null_space && null_space) {
    result.push_back(refusal_json(
        "null_projector", "Dashpot's controller has the dynamically consistent projector alone"));
  }
  if (design.stated.inertia_blocks) {
    result.push_back(refusal_json(
        "inertia_blocks", "Dashpot's controller does not multiply gains by the tip's inertia"));
    return result;
  }
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    const auto fault = controller::check_gains(gains, mode, arm.model().dof());
    if (fault) result.push_back(refusal_json(fault.key, fault.reason));
  }
  if (!result.empty()) return result;
  try {
    controller::Settings settings = design.settings;
    settings.analysis.where = controller::Analysis::Where::kOff;
    settings.analysis.sampled.interval = 0;
    (void)controller::Controller(arm.model(), settings);
  } catch (const controller::InvalidSettings& error) {
    result.push_back(refusal_json(error.key(), error.what()));
    return result;
  }
  if (design.stated.period == 0) return result;
  const controller::GainJudge::Verdict verdict =
      controller::GainJudge(arm.model(), design.settings).judge(q, gains);
  const double asked =
      verdict.dropped ? controller::GainJudge::kDropped : design.settings.limits.gain_margin;
  if (verdict.margin < std::min(asked, design.settings.limits.gain_margin)) {
    std::ostringstream text;
    text.precision(3);
    text << "with the " << (verdict.mode == Mode::kJoint ? "joint" : "task")
         << " gains the sampled loop has a gain margin of " << verdict.margin << " here"
         << (verdict.dropped ? " once the payload is dropped, " : ", ") << asked << " is asked for";
    const std::string missing = controller::missing_rotors_text(arm.model());
    if (!missing.empty()) text << "; " << missing;
    result.push_back(refusal_json("gain_margin", text.str()));
  }
  return result;
}

}  // namespace dashpot::apps
