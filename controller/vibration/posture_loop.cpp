#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/controller/vibration/closed_loop.hpp>

#include <Eigen/Eigenvalues>
#include <array>
#include <exception>
#include <stdexcept>
#include <utility>

namespace dashpot::controller {
namespace {

constexpr std::array<const char*, 6> kAssumptions = {
    "continuous", "gravity ideal", "delay none", "rotors unknown", "gears rigid", "friction none"};

}  // namespace

LoopTiming timing_of(const Settings& settings) {
  const Analysis::Sampled& sampled = settings.analysis.sampled;
  return {settings.period,        sampled.delay,
          sampled.cutoff,         sampled.difference_velocity,
          settings.integral.time, !settings.feed_forward.gravity};
}

void set_timing(const LoopTiming& timing, Settings& settings) {
  if (timing.period > 0) settings.period = timing.period;
  settings.analysis.sampled.delay = timing.delay;
  settings.analysis.sampled.cutoff = timing.cutoff;
  settings.analysis.sampled.difference_velocity = timing.difference_velocity;
  settings.integral.time = timing.integral_time;
  settings.feed_forward.gravity = !timing.ideal_gravity;
}

analysis::SampledLoop timed(const LoopTiming& timing, analysis::SampledLoop loop) {
  loop.period = timing.period;
  loop.delay = timing.delay;
  loop.torque_cutoff = timing.cutoff;
  loop.difference_velocity = timing.difference_velocity;
  if (timing.ideal_gravity) loop.gravity_gradient.resize(0, 0);
  return loop;
}

std::uint32_t assumption_bits(const LoopTiming& timing, const RobotModel* model) {
  const bool sampled = timing.period > 0;
  const std::array<bool, kAssumptions.size()> left_out = {
      !sampled,
      sampled && timing.ideal_gravity,
      sampled && timing.delay == 0,
      model != nullptr && unknown_rotors(*model).any(),
      model != nullptr && model->elastic_joints() == 0,
      model != nullptr && model->joint_values(&Joint::viscous_friction).isZero(0)};
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < left_out.size(); ++i) bits |= std::uint32_t{left_out[i]} << i;
  return bits;
}

std::vector<std::string> assumption_names(std::uint32_t bits) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < kAssumptions.size(); ++i) {
    if ((bits >> i & 1U) != 0) names.emplace_back(kAssumptions[i]);
  }
  return names;
}

Eigen::MatrixXd gravity_gradient(const DynamicsKernel& kernel, const JointVector& q) {
  constexpr double kStep = 1e-5;  // rad
  DynamicsResult after, before;
  const JointVector none = JointVector::Zero(q.size());
  Eigen::MatrixXd gradient(q.size(), q.size());
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const JointVector step = kStep * JointVector::Unit(q.size(), i);
    kernel.evaluate(q + step, none, after);
    kernel.evaluate(q - step, none, before);
    gradient.col(i) = (after.gravity - before.gravity) / (2 * kStep);
  }
  return gradient;
}

PassivePart passive_part(const Jacobian& J, const Environment& environment,
                         const JointMatrix& load_stiffness) noexcept {
  PassivePart part{load_stiffness, JointMatrix::Zero(J.cols(), J.cols())};
  add_congruence(J, environment.tip_stiffness.asDiagonal(), J, part.stiffness);
  add_congruence(J, environment.tip_damping.asDiagonal(), J, part.damping);
  part.stiffness.diagonal() += environment.joint_stiffness;
  part.damping.diagonal() += environment.joint_damping;
  return part;
}

JointMatrix integral_stiffness(const DynamicsResult& robot, const Impedance& impedance,
                               double time) noexcept {
  if (time == 0) return {};
  const Matrix6 K_C = impedance.base.stiffness + turned(impedance.tool.stiffness, robot.R_BT);
  JointMatrix K = impedance.joint_stiffness;
  add_congruence(robot.J, K_C, robot.J, K);
  const Eigen::Index n = K.rows();
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i <= j; ++i) K(i, j) = K(j, i) = 0.5 * (K(i, j) + K(j, i)) / time;
  }
  return K;
}

analysis::ControllerMemory integral_memory(const Eigen::MatrixXd& K_I, double period) {
  constexpr double kNothing = 1e-12;  // of the largest eigenvalue
  const Eigen::Index n = K_I.rows();
  if (n == 0 || K_I.isZero(0)) return {};
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(K_I);
  const Eigen::VectorXd& values = eigen.eigenvalues();
  const Eigen::Index rank = (values.array() > kNothing * values[n - 1]).count();
  const Eigen::MatrixXd F =
      eigen.eigenvectors().rightCols(rank) * values.tail(rank).cwiseSqrt().asDiagonal();
  return {Eigen::MatrixXd::Identity(rank, rank), period * F.transpose(), F};
}

std::vector<double> integral_decays(const analysis::SampledSpectrum& sampled, double period) {
  std::vector<double> decays;
  for (const analysis::Complex z : sampled.memory) {
    decays.push_back(-std::log(std::abs(z)) / period);
  }
  std::sort(decays.begin(), decays.end());
  return decays;
}

SampledArm::SampledArm(const RobotModel& model, const LoopTiming& timing)
    : kernel_(model),
      timing_(timing),
      gears_(elastic_joints(model)),
      friction_(model.joint_values(&Joint::viscous_friction)),
      assumes_(assumption_bits(timing, &model)) {}

analysis::SampledLoop SampledArm::at(const JointVector& q, const PassivePart* outside,
                                     const JointMatrix& K_I) const {
  analysis::SampledLoop loop;
  if (!friction_.isZero(0)) loop.friction = friction_.asDiagonal();
  if (outside != nullptr && !outside->damping.isZero(0)) {
    loop.friction = outside->damping;
    loop.friction.diagonal() += friction_;
  }
  if (outside != nullptr && !outside->stiffness.isZero(0)) {
    loop.passive_stiffness = outside->stiffness;
  }
  if (!timing_.ideal_gravity) loop.gravity_gradient = gravity_gradient(kernel_, q);
  loop.memory = integral_memory(K_I, timing_.period);
  loop.gears = gears_;
  loop.slowest = kSlowestVibration;
  return timed(timing_, std::move(loop));
}

DesignedDamping designed_damping(const RobotModel& model, const Settings& settings) {
  constexpr double kReserve = 1.02;  // of the margin, for what couples modes
  JointVector subtracted = JointVector::Zero(model.dof());
  if (settings.subtract_friction) subtracted = friction_left(model, settings).cwiseMax(0);
  const double margin = settings.limits.gain_margin;
  analysis::SampledLoop loop;
  loop.friction = Eigen::VectorXd(model.joint_values(&Joint::viscous_friction)).asDiagonal();
  const analysis::BorneDamping borne =
      margin == 1 ? analysis::BorneDamping()
                  : analysis::BorneDamping(timed(timing_of(settings), loop), kReserve * margin);
  return DesignedDamping(subtracted, borne, settings.null_weights);
}

JointMatrix null_projector(const DynamicsResult& robot, NullProjector projector,
                           const JointVector& weights) noexcept {
  Setpoint setpoint;
  setpoint.mode = Mode::kCartesian;
  setpoint.gains.null_projector = projector;
  NullSpace null_space(weights);
  null_space.compute(robot, Impedance(setpoint, static_cast<int>(robot.M.rows())));
  JointMatrix N(robot.M.rows(), robot.M.cols());
  null_projector(null_space, N);
  return N;
}

analysis::System<> unbounded(const analysis::System<kMaxJoints>& system) {
  analysis::System<> result(system.dof());
  result.mass = system.mass;
  result.damping = system.damping;
  result.stiffness = system.stiffness;
  result.stiffness_factor = system.stiffness_factor;
  return result;
}

double margin_up_to(const analysis::System<kMaxJoints>& system, const analysis::SampledLoop& loop,
                    double enough) try {
  analysis::Spectrum<kMaxJoints> spectrum;
  const analysis::Status solved = analysis::SpectrumSolver<kMaxJoints>().solve(system, spectrum);
  if (solved != analysis::Status::kOk && solved != analysis::Status::kUncertified) return 0;
  return std::min(enough, analysis::gain_margin(system, spectrum, loop, enough));
} catch (const std::exception&) {  // no convergence
  return 0;
}

PostureLoop::PostureLoop(const RobotModel& model, const Settings& settings)
    : arm_(model, timing_of(settings)),
      settings_(settings),
      friction_left_(friction_left(model, settings)),
      damping_(designed_damping(model, settings)) {}

Status PostureLoop::closed_loop(const JointVector& q, const Gains& gains, Mode mode,
                                analysis::System<kMaxJoints>& system,
                                const Vector6& external_wrench) {
  if (q.size() != friction_left_.size()) return Status::kStateWrongSize;
  if (!q.allFinite()) return Status::kStateNotFinite;
  if (!external_wrench.allFinite()) return Status::kWrenchNotFinite;
  const auto n = static_cast<int>(q.size());
  const JointVector rest = JointVector::Zero(n);
  DynamicsResult robot;
  arm_.kernel().evaluate(q, rest, robot);
  Setpoint setpoint;
  setpoint.mode = mode;
  setpoint.gains = gains;
  const GainBlend given(1, Impedance(setpoint, n));
  damping_.reset();
  const Impedance& impedance = damping_.update(given, robot);
  level_ = damping_.level(given.now());
  q_ = q;
  integral_ = integral_stiffness(robot, impedance, settings_.integral.time);
  outside_ = passive_part(robot.J, settings_.environment,
                          stiffness_of_load(robot.J, settings_.task_terms.load, external_wrench));
  controller::closed_loop(robot, rest,
                          {impedance,
                           damping_.null_space(),
                           friction_left_,
                           {external_wrench},
                           Posture{&arm_.kernel(), &q, rest, rest}},
                          settings_, system);
  if (arm_.gears().any()) arm_.gears().extend(outside_, system);
  return Status::kOk;
}

analysis::SampledLoop PostureLoop::sampled() const {
  return with_gears(arm_.at(q_, &outside_, integral_));
}

LoopAt PostureLoop::at(const JointVector& q, const Gains& gains, Mode mode,
                       const Vector6& external_wrench) {
  analysis::System<kMaxJoints> system;
  const Status status = closed_loop(q, gains, mode, system, external_wrench);
  if (status != Status::kOk) {
    throw std::invalid_argument(std::string("closed loop: ") + to_text(status));
  }
  return {unbounded(system), sampled()};
}

}  // namespace dashpot::controller
