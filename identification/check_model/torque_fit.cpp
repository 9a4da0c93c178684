#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/identification/check_model/torque_fit.hpp>

#include <cmath>

namespace dashpot::identification {
namespace {

/// Typical inertia of a body at the tip about the tip link's origin, kg m^2: ordinary motion hardly
/// determines this inertia, which must not make the mass uncertain.
constexpr double kPayloadInertia = 0.1;
/// The same of a body of a known mass, beside its size: m from its centre.
constexpr double kPayloadSize = 0.1;
constexpr double kFarRotor = 10;    // kg m^2, and over a joint's inertia: no rotor has more
constexpr double kFarDelay = 0.03;  // s

/// Returns the diagonal of M, the mean along runs, kg m^2.
VectorXd mean_inertia(const controller::RobotModel& model, const std::vector<SmoothRun>& runs) {
  const controller::DynamicsKernel kernel(model);
  controller::DynamicsResult at;
  VectorXd sum = VectorXd::Zero(model.dof());
  double count = 0;
  for (const SmoothRun& run : runs) {
    const Index step = std::max<Index>(1, run.position.cols() / 50);
    for (Index i = 0; i < run.position.cols(); i += step, ++count) {
      kernel.evaluate(run.position.col(i), run.velocity.col(i), at);
      sum += at.M.diagonal();
    }
  }
  return sum / std::max(1.0, count);
}

/// Keeps the end of each record for validation, and windows apart that share samples.
std::vector<Purpose> purposes(const WeakForm& form, double share) {
  std::vector<std::pair<double, double>> span;
  for (const WeakForm::Window& window : form.windows()) {
    const auto record = static_cast<std::size_t>(window.record);
    if (record >= span.size()) span.resize(record + 1, {kUndetermined, -kUndetermined});
    span[record].first = std::min(span[record].first, window.from);
    span[record].second = std::max(span[record].second, window.to);
  }
  std::vector<Purpose> result;
  for (const WeakForm::Window& window : form.windows()) {
    const auto [from, to] = span[static_cast<std::size_t>(window.record)];
    const double border = to - share * (to - from);
    result.push_back(share == 0 || window.to <= border ? Purpose::kFit
                     : window.from >= border           ? Purpose::kValidation
                                                       : Purpose::kNothing);
  }
  return result;
}

/// The sum of the logarithms of the joints' residuals.
double left_over_of(const TorqueFit& fit) {
  double sum = 0;
  for (Index j = 0; j < fit.n; ++j) {
    // All residuals below a thousandth count as equal.
    const double size = std::max(fit.result.sigma[j], 1e-3 * fit.largest[j]);
    if (fit.moves[j] && size > 0) sum += 2 * std::log(size);
  }
  return sum;
}

}  // namespace

TorqueFit::TorqueFit(const controller::RobotModel& robot, const std::vector<SmoothRun>& runs,
                     const RecordFilter& how, const WeakForm& windows,
                     const ModelCheckOptions& options)
    : model(robot),
      form(windows),
      n(robot.dof()),
      K(form.count()),
      payload_known(options.payload_known),
      taken_delay(how.torque_delay),
      torque(form.torque()),
      own(form.torques(controller::DynamicsKernel(robot), n)),
      largest(torque.cwiseAbs().rowwise().maxCoeff()),
      rotor_prior(kFarRotor * mean_inertia(robot, runs).cwiseMax(1.0)),
      purpose(purposes(form, options.validation)) {
  VectorXd v0(n), slow(n);
  for (Index j = 0; j < n; ++j) {
    double fastest = 0;
    for (const SmoothRun& run : runs) {
      fastest = std::max(fastest, run.velocity.row(j).cwiseAbs().maxCoeff());
    }
    v0[j] = std::max({3 * how.rate_noise[j], 0.01 * fastest, 1e-12});
    // Below this gears stick and slip, and lubricants have no film yet: rad/s, m/s.
    const double creeping = joint(j).type == controller::JointType::kPrismatic ? 0.005 : 0.02;
    slow[j] = std::max({v0[j], 0.05 * fastest, creeping});
  }
  // Where a joint rests or creeps, friction is anything up to Coulomb's.
  constexpr double kMostRest = 0.2;
  turning = (form.slow_share(slow).array() < kMostRest).cast<double>();
  moves = turning.rowwise().sum().array() >= std::max(10.0, 0.02 * static_cast<double>(K));
  linear.joints = n;
  linear.used = turning.reshaped();
  linear.A = MatrixXd::Zero(n * K, 3 * n);
  linear.prior = VectorXd::Constant(3 * n, kUndetermined);
  const MatrixXd sign = form.sign(v0), velocity = form.velocity();
  for (Index row = 0; row < n * K; ++row) {
    const Index j = row % n, k = row / n;
    const bool fitted = purpose[static_cast<std::size_t>(k)] == Purpose::kFit;
    if (!fitted || !moves[j]) linear.used[row] = 0;
    if (moves[j]) linear.A.row(row).segment<3>(3 * j) << 1, sign(j, k), velocity(j, k);
  }
  const std::vector<MatrixXd> body = body_columns(model, form, kPayloadColumns);
  for (std::size_t i = 0; i < body.size(); ++i)
    add(body[i], payload_known ? kHeld : i < 4 ? kUndetermined : kPayloadInertia);
  const MatrixXd acceleration = form.acceleration();
  for (Index j = 0; j < n; ++j) {
    MatrixXd column = MatrixXd::Zero(n, K);
    column.row(j) = acceleration.row(j);
    add(column, rotor_prior[j]);
  }
  add(form.torque_rate(), kFarDelay);
}

void TorqueFit::add(const MatrixXd& column, double prior) {
  linear.A.conservativeResize(Eigen::NoChange, linear.A.cols() + 1);
  linear.A.rightCols(1) = column.reshaped();
  linear.prior.conservativeResize(linear.A.cols());
  linear.prior.tail(1)[0] = prior;
}

double TorqueFit::fit(TorqueKind kind) {
  model_torque = MatrixXd::Zero(n, K);
  if (kind != TorqueKind::kExternal) model_torque += own.inertial;
  if (kind == TorqueKind::kWhole) model_torque += own.gravity;
  linear.prior.segment(rotor(0), n) = rotor_prior;
  // External torques leave out the rotors.
  if (kind == TorqueKind::kExternal) linear.prior.segment(rotor(0), n).setConstant(kHeld);
  linear.y = (torque - model_torque).reshaped();
  result = robust_fit(linear);
  return left_over_of(*this);
}

double TorqueFit::fit_inclined(const controller::RobotDescription& robot) {
  fit(TorqueKind::kWhole);
  if (!robot.options.gravity.isZero(0)) {
    const Index before = linear.A.cols();
    for (const MatrixXd& column : tilt_columns(robot, form)) add(column, kUndetermined);
    result = robust_fit(linear);
    linear.A.conservativeResize(Eigen::NoChange, before);
    linear.prior.conservativeResize(before);
  }
  return left_over_of(*this);
}

void TorqueFit::narrow_payload(ModelCheck& check) {
  const Index mass = payload();
  const auto sure = [&](Index i) {
    return std::abs(result.value[i]) + 2 * std::sqrt(result.covariance(i, i));
  };
  if (!payload_known && !unseen(mass)) {
    const double m = sure(mass) + 1e-3;
    const double moment = Eigen::Vector3d(sure(mass + 1), sure(mass + 2), sure(mass + 3)).norm();
    const double far = std::min(1.0, moment / m);
    const double inertia = m * (far * far + kPayloadSize * kPayloadSize);
    linear.prior.segment<6>(mass + 4).setConstant(std::min(kPayloadInertia, inertia));
  }
  for (Index i = rotor(0); i < rotor(n); ++i) {
    for (Index k = mass; k < mass + 4 && linear.prior[i] != kHeld; ++k) {
      constexpr double kAlike = 0.995;
      const double both = std::sqrt(result.covariance(i, i) * result.covariance(k, k));
      if (!(std::abs(result.covariance(i, k)) > kAlike * both) || !(both > 0)) continue;
      linear.prior[i] = kHeld;
      check.ambiguities.push_back("the records cannot tell apart " + parameter_name(i) + " and " +
                                  parameter_name(k) + ": the rotor is as the model says");
    }
  }
  result = robust_fit(linear);
  check.parameters = static_cast<int>((linear.prior.array() != kHeld).count());
  check.rank = check.parameters - static_cast<int>(result.unseen.cols());
  check.condition = result.condition;
}

Index TorqueFit::rotor(Index j) const {
  return payload() + kPayloadColumns + j;
}

std::string TorqueFit::parameter_name(Index i) const {
  static constexpr std::array<const char*, 3> kJoint{"offset", "Coulomb friction",
                                                     "viscous friction"};
  if (i < payload()) {
    return std::string(kJoint[static_cast<std::size_t>(i % 3)]) + " of joint " +
           std::to_string(i / 3 + 1);
  }
  if (i == payload()) return "the payload's mass";
  if (i < payload() + 4) {
    return std::string("the payload's first moment along ") + "xyz"[i - payload() - 1];
  }
  if (i < rotor(0)) return "the payload's inertia";
  if (i == rest_of_delay()) return "the delay of the torques";
  return i < rest_of_delay() ? "reflected inertia of joint " + std::to_string(i - rotor(0) + 1)
                             : "what is suspected";
}

const controller::Joint& TorqueFit::joint(Index j) const {
  return model.joints()[static_cast<std::size_t>(j)];
}

std::string TorqueFit::torque_unit(Index j) const {
  return joint(j).type == controller::JointType::kPrismatic ? " N" : " N m";
}

std::string TorqueFit::inertia_unit(Index j) const {
  return joint(j).type == controller::JointType::kPrismatic ? " kg" : " kg m^2";
}

double TorqueFit::moved_mass() const {
  double mass = 0;
  for (unsigned i = 0; i < static_cast<unsigned>(n); ++i) {
    mass += kdl_chain(model).getSegment(i).getInertia().getMass();
  }
  return mass;
}

double TorqueFit::most_left() const {
  return moves.select(result.sigma.array() / largest.array(), 0.0).maxCoeff();
}

bool TorqueFit::delay_is_taken() const {
  const Index i = rest_of_delay();
  const double rest = std::abs(result.value[i]);
  return rest < 2e-5 || rest < 0.1 * std::sqrt(result.covariance(i, i));
}

bool TorqueFit::unseen(Index i) const {
  return result.unseen.cols() > 0 && result.unseen.row(i).norm() > 0.01;
}

double TorqueFit::variance(Index i) const {
  return result.covariance(i, i) + (spread.size() > 0 ? std::pow(spread[i], 2) : 0);
}

double TorqueFit::rms(const VectorXd& values, const RobustFit& weighted, Index j) const {
  double sum = 0, count = 0;
  for (Index row = j; row < values.size(); row += n) {
    const double weight = linear.used[row] * weighted.weight[row];
    sum += weight * values[row] * values[row];
    count += weight;
  }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

}  // namespace dashpot::identification
