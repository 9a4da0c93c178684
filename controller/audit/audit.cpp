#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/analysis/elastic_form.hpp>
#include <dashpot/analysis/null_damping.hpp>
#include <dashpot/controller/audit.hpp>
#include <dashpot/controller/audit/stated_gains.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/controller/vibration/closed_loop.hpp>
#include <dashpot/controller/vibration/loop_system.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace dashpot::controller {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// A real part below this share of the fastest eigenvalue counts as zero.
constexpr double kZeroReal = 1e-12;

/// A number with a bound of its error.
struct Bounded {
  double value = kNan, bound = 0;
};

/// Returns the smallest of numbers with bounds: the true one lies between the smallest lower and
/// the smallest upper end.
Bounded smallest(const std::vector<Bounded>& numbers) {
  double value = kInfinity, low = kInfinity, high = kInfinity;
  for (const Bounded& number : numbers) {
    value = std::min(value, number.value);
    low = std::min(low, number.value - number.bound);
    high = std::min(high, number.value + number.bound);
  }
  if (numbers.empty()) return {};
  return {value, std::max(value - low, high - value)};
}

/// Sets the numbers of the continuous loop, and their bounds.
void read_spectrum(const analysis::Spectrum<>& spectrum, PostureAudit& result) {
  std::vector<Bounded> ratios, poles;
  result.numbers.zero_modes = spectrum.zero_modes.count;
  for (const analysis::Mode<>& mode : spectrum.modes) {
    for (const analysis::Complex& value : mode.eigenvalues) {
      poles.push_back({value.real(), mode.error_bound});
    }
    if (mode.kind == analysis::ModeKind::kSoft) {
      ++result.numbers.zero_modes;
    } else if (!std::isnan(mode.damping_ratio)) {
      ratios.push_back({mode.damping_ratio, mode.damping_ratio_bound});
    }
  }
  for (Index i = 0; i < spectrum.zero_mode_rates.size(); ++i) {
    const double rate = spectrum.zero_mode_rates[i];
    if (!std::isnan(rate)) poles.push_back({rate, spectrum.zero_mode_rates_bound[i]});
  }
  const Bounded ratio = smallest(ratios), pole = smallest(poles);
  result.numbers.smallest_ratio = ratio.value;
  result.smallest_ratio_bound = ratio.bound;
  result.numbers.fastest_pole = pole.value;
  result.fastest_pole_bound = pole.bound;
}

/// Sets smallest ratio and fastest pole from eigenvalues of a loop whose springs are stiff in all
/// directions. Returns false if real eigenvalues have to be paired before the ratio is known.
bool read_eigenvalues(const Eigen::Ref<const Eigen::VectorXcd>& values, double soft_frequency,
                      PostureNumbers& result) {
  double ratio = kInfinity, fastest = kInfinity, slowest = -kInfinity;
  for (const analysis::Complex& value : values) {
    fastest = std::min(fastest, value.real());
    if (value.imag() == 0) slowest = std::max(slowest, value.real());
    const double frequency = analysis::modulus(value);
    if (value.imag() > 0 && frequency >= soft_frequency) {
      ratio = std::min(ratio, -value.real() / frequency);
    }
  }
  result.smallest_ratio = ratio;
  result.fastest_pole = fastest;
  return ratio < kInfinity && slowest <= kZeroReal * std::abs(fastest);
}

}  // namespace

PostureNumbers numbers_of(const analysis::Spectrum<>& spectrum) {
  PostureAudit result;
  read_spectrum(spectrum, result);
  return result.numbers;
}

Audit::Audit(const RobotModel& model, const AuditOptions& options)
    : model_(model),
      options_(options),
      arm_(model, options),
      impedance_(stated_impedance(options, model.dof())) {
  const int n = model.dof();
  if (options.mode == Mode::kJoint) {
    springs_ = checked_rank("joint_stiffness", impedance_.joint_stiffness);
  } else {
    const TipImpedance& tip =
        options.gains.frame == Frame::kBase ? impedance_.base : impedance_.tool;
    const int selected = static_cast<int>(tip.selected.sum());
    springs_ = std::min(n, checked_rank("task_stiffness", tip.stiffness));
    const bool unprojected = options.gains.null_projector == NullProjector::kNone;
    springs_ += std::min(std::max(0, n - (unprojected ? springs_ : selected)),
                         static_cast<int>((impedance_.null_stiffness.array() > 0).count()));
  }
  require(std::isfinite(options.soft_frequency) && options.soft_frequency > 0,
          "soft_frequency: has to be positive, rad/s");
  require(options.period >= 0 && options.period <= 0.1,
          "period: must be between 0 and 0.1 s; is it in ms?");
  require(options.delay >= 0, "delay: must not be negative, ticks");
  require(std::isfinite(options.cutoff) && options.cutoff >= 0,
          "cutoff: must be finite and not negative, Hz");
  require(std::isfinite(options.integral_time) && options.integral_time >= 0,
          "integral_time: must be finite and not negative, s");
  require(std::isfinite(options.margin) && options.margin >= 1, "margin: must be at least 1");
  require(options.null_weights.size() == 0 ||
              (options.null_weights.size() == n && options.null_weights.allFinite() &&
               options.null_weights.minCoeff() > 0),
          "null_weights: need n positive entries");
  if (options.lower.size() == 0) options_.lower = model.joint_values(&Joint::lower);
  if (options.upper.size() == 0) options_.upper = model.joint_values(&Joint::upper);
  require(options_.lower.size() == n && options_.upper.size() == n &&
              (options_.lower.array() <= options_.upper.array()).all(),
          "lower, upper: need n entries, with each lower one at most the upper one");
  designed_ = designing_settings(model, options);
}

DynamicsResult Audit::evaluate(const JointVector& q) const {
  require(q.size() == model_.dof(), "q: has " + std::to_string(q.size()) + " entries, expected " +
                                        std::to_string(model_.dof()));
  require(q.allFinite(), "q: has an entry that is not a finite number");
  DynamicsResult robot;
  arm_.kernel().evaluate(q, JointVector::Zero(q.size()), robot);
  return robot;
}

Impedance Audit::impedance_at(const DynamicsResult& robot) const {
  Impedance result = impedance_;
  if (!options_.inertia_blocks) return result;
  const Eigen::LLT<MatrixXd> mass{MatrixXd(robot.M)};
  for (TipImpedance* tip : {&result.base, &result.tool}) {
    for (int at = 0; at < 6; at += 3) {
      const MatrixXd J = robot.J.middleRows<3>(at);
      const Eigen::Matrix3d mobility = J * mass.solve(J.transpose());
      Eigen::Matrix3d inertia = mobility.inverse();
      if (tip == &result.tool) inertia = robot.R_BT.transpose() * inertia * robot.R_BT;
      inertia = (0.5 * (inertia + inertia.transpose())).eval();
      tip->stiffness.block<3, 3>(at, at) = tip->stiffness(at, at) * inertia;
      tip->damping.block<3, 3>(at, at) = tip->damping(at, at) * inertia;
    }
  }
  return result;
}

analysis::SampledLoop Audit::loop(const JointVector& q, const DynamicsResult& robot) const {
  const JointMatrix K_I = integral_stiffness(robot, impedance_at(robot), options_.integral_time);
  return arm_.at(q, nullptr, K_I);
}

PostureNumbers Audit::numbers(const JointVector& q) const {
  if (designed_) {
    const std::optional<PostureNumbers> quick = numbers(at(q));
    return quick ? *quick : audit(q).numbers;
  }
  const DynamicsResult robot = evaluate(q);
  Impedance impedance = impedance_at(robot);
  NullSpace null_space(options_.null_weights);
  if (impedance.null_space()) {
    null_space.compute(robot, impedance);
    if (!null_space.dynamic() && null_space.of_projector().nearly_singular()) {
      return audit(q).numbers;
    }
  }
  analysis::System<kMaxJoints> system;
  LoopSystem().form(robot, impedance, null_space, arm_.friction(), system);
  if (arm_.gears().any()) arm_.gears().extend_factored(system);
  const std::optional<PostureNumbers> result =
      numbers(system, [&] { return with_gears(loop(q, robot)); });
  return result ? *result : audit(q).numbers;
}

std::optional<PostureNumbers> Audit::numbers(const LoopAt& loop) const {
  const MatrixXd& W = loop.system.stiffness_factor;
  analysis::System<kMaxJoints> system(loop.system.dof());
  system.mass = loop.system.mass;
  system.damping = loop.system.damping;
  system.stiffness_factor.resize(W.rows(), W.cols());
  Index rows = 0;  // without the rows of zero springs, such as a null space's
  for (const auto& row : W.rowwise()) {
    if (!row.isZero(0)) system.stiffness_factor.row(rows++) = row;
  }
  system.stiffness_factor.conservativeResize(rows, Eigen::NoChange);
  return numbers(system, [&] { return loop.sampled; });
}

std::optional<PostureNumbers> Audit::numbers(
    const analysis::System<kMaxJoints>& system,
    const std::function<analysis::SampledLoop()>& sampled) const {
  if (system.stiffness_factor.rows() == 0) return std::nullopt;
  analysis::ElasticForm<kMaxJoints> form;
  Eigen::Matrix<analysis::Complex, Eigen::Dynamic, 1, Eigen::ColMajor, 2 * kMaxJoints, 1> values;
  PostureNumbers result;
  const bool clear = analysis::to_elastic_form(system, form) == analysis::Status::kOk &&
                     form.slowest > options_.soft_frequency &&
                     form.modes() == springs_ + arm_.gears().count() &&
                     analysis::elastic_eigenvalues(form, values) == analysis::Status::kOk &&
                     read_eigenvalues(values, options_.soft_frequency, result);
  if (!clear) return std::nullopt;
  result.zero_modes = model_.dof() - springs_;
  if (options_.period > 0) try {
      result.gain_margin = analysis::gain_margin(form, sampled());
    } catch (const std::runtime_error&) {
      result.gain_margin = kNan;
    }
  return result;
}

analysis::TaskImpedance Audit::task_impedance(const DynamicsResult& robot) const {
  const Impedance impedance = impedance_at(robot);
  analysis::TaskImpedance result;
  result.mass = robot.M;
  const int n = model_.dof();
  if (options_.mode == Mode::kJoint) {
    result.stiffness = impedance.joint_stiffness;
    result.damping = impedance.joint_damping + JointMatrix(arm_.friction().asDiagonal());
    return result;
  }
  const bool tool = options_.gains.frame == Frame::kTool;
  result.jacobian = robot.J;
  if (tool) {
    result.jacobian->topRows<3>() = robot.R_BT.transpose() * robot.J.topRows<3>();
    result.jacobian->bottomRows<3>() = robot.R_BT.transpose() * robot.J.bottomRows<3>();
  }
  result.task_stiffness = (tool ? impedance.tool : impedance.base).stiffness;
  result.task_damping = (tool ? impedance.tool : impedance.base).damping;
  result.damping = MatrixXd(arm_.friction().asDiagonal());
  if (!impedance.null_space() || n == 0) return result;
  const auto projected = [&](const JointVector& gains) -> analysis::NullSpaceDamping {
    const MatrixXd D = gains.asDiagonal();
    MatrixXd W = MatrixXd::Identity(n, n);
    switch (options_.gains.null_projector) {
      case NullProjector::kNone:
        return {D, MatrixXd::Zero(n, n)};
      case NullProjector::kDynamic:
        W = result.mass;
        break;
      case NullProjector::kWeighted:
        if (options_.null_weights.size() > 0) W = options_.null_weights.asDiagonal();
        break;
      case NullProjector::kKinematic:
        break;
    }
    return analysis::null_space_damping(W, *result.jacobian, *result.task_stiffness, D);
  };
  const analysis::NullSpaceDamping damping = projected(impedance.null_damping);
  *result.damping += damping.damping;
  result.damping_error = damping.error;
  if (!impedance.null_stiffness.isZero(0)) {
    result.stiffness = projected(impedance.null_stiffness).damping;
  }
  return result;
}

analysis::System<> Audit::system_of(const analysis::TaskImpedance& impedance) const {
  analysis::System<> system = analysis::to_joint_space(impedance);
  if (arm_.gears().any()) arm_.gears().extend(system);
  return system;
}

LoopAt Audit::at(const JointVector& q) const {
  const DynamicsResult robot = evaluate(q);
  if (designed_) {
    return PostureLoop(model_, *designed_).at(q, designed_->initial.gains, options_.mode);
  }
  return {system_of(task_impedance(robot)),
          options_.period > 0 ? with_gears(loop(q, robot)) : analysis::SampledLoop()};
}

PostureAudit Audit::audit(const JointVector& q) const {
  const auto [system, loop] = at(q);
  PostureAudit result;
  result.q = q;
  analysis::SpectrumOptions options;
  options.soft_frequency = options_.soft_frequency;
  result.spectrum = analysis::analyze(system, options);
  read_spectrum(result.spectrum, result);
  result.numbers.singular = result.numbers.zero_modes > model_.dof() - springs_;
  if (options_.period == 0) return result;
  result.numbers.gain_margin = analysis::gain_margin(system, result.spectrum, loop);
  if (options_.integral_time > 0) {
    result.integral_decays =
        integral_decays(sample_loop(system, result.spectrum, loop), loop.period);
  }
  return result;
}

JointVector Audit::posture(std::uint64_t seed, std::int64_t index) const {
  return PostureSequence(options_.lower, options_.upper, seed).at(index);
}

std::vector<PostureNumbers> Audit::sample(std::uint64_t seed, std::int64_t first,
                                          std::int64_t count) const {
  const PostureSequence postures(options_.lower, options_.upper, seed);
  std::vector<PostureNumbers> result(static_cast<std::size_t>(count));
  for (PostureNumbers& one : result) one = numbers(postures.at(first++));
  return result;
}

analysis::TaskImpedance Audit::undamped(const JointVector& q) const {
  analysis::TaskImpedance impedance = task_impedance(evaluate(q));
  impedance.task_damping.reset();
  if (!impedance.jacobian) impedance.damping = MatrixXd(arm_.friction().asDiagonal());
  return impedance;
}

analysis::SampledLoop Audit::loop(const JointVector& q) const {
  require(options_.period > 0, "period: a loop needs one");
  return loop(q, evaluate(q));
}

DampingSuggestion Audit::suggest(const JointVector& q, double ratio) const {
  require(std::isfinite(ratio) && ratio > 0, "ratio: has to be positive");
  analysis::DampingTarget target = analysis::DampingTarget::constant(ratio);
  target.soft_frequency = options_.soft_frequency;
  const analysis::TaskImpedance impedance = undamped(q);
  const analysis::DampingDesign full = analysis::design_damping(impedance, target);
  const Eigen::VectorXd diagonal = full.damping.diagonal();
  const auto smallest_ratio = [&](const MatrixXd& damping) {
    analysis::SpectrumOptions options;
    options.soft_frequency = options_.soft_frequency;
    return numbers_of(
               analysis::analyze(system_of(analysis::with_damping(impedance, damping)), options))
        .smallest_ratio;
  };
  return {ratio, full.damping, diagonal, smallest_ratio(full.damping),
          smallest_ratio(MatrixXd(diagonal.asDiagonal()))};
}

}  // namespace dashpot::controller
