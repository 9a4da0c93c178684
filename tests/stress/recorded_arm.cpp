#include <dashpot/tests/stress/recorded_arm.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace dashpot::stress {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Dice;

constexpr double kTick = 1e-3;                                // s
constexpr double kDrive = 0.1;                                // kg m^2
constexpr double kEnergy = 0.05;                              // share of a strong mode
constexpr Index kPush = 100, kBetween = 1500, kDecay = 2300;  // ticks
constexpr Index kChirp = 10'000, kAmbient = 60'000;           // ticks

/// Every `stride`-th entry.
VectorXd spread(const VectorXd& values, Index stride) {
  VectorXd result = VectorXd::Zero(values.size() * stride);
  for (Index i = 0; i < values.size(); ++i) result[i * stride] = values[i];
  return result;
}

}  // namespace

RecordedArm::RecordedArm(const Recipe& recipe, std::size_t which, Dice& draw)
    : recipe_(recipe), file_(testing::arms()[which % testing::arms().size()]) {
  const auto read = [this] {
    return sim::Robot::from_file(testing::arm_path(file_.file), file_.base, file_.tip, parameters_);
  };
  joints_ = read().dof();
  const sim::JointVector one = sim::JointVector::Ones(joints_);
  parameters_.gravity.setZero();
  parameters_.reflected_inertia = kDrive * one;
  parameters_.viscous_friction = 0 * one;
  if (recipe.gears) {
    parameters_.gear_stiffness = one;
    for (double& stiffness : parameters_.gear_stiffness) stiffness = draw.uniform(3e3, 1.2e4);
    parameters_.gear_damping = 1e-3 * parameters_.gear_stiffness;
  }
  coordinates_ = read().coordinates();
  VectorXd posture(joints_);
  for (double& q : posture) q = draw.uniform(-1.5, 1.5);
  home_ = spread(posture, coordinates_ / joints_);
  ideal_ = make_plant(0, std::nullopt);
  double growth = 0;
  do {  // gears bend under what is too stiff, or damped too much, for the loop
    choose_springs(draw);
    growth = linearize();
  } while (growth >= 1);
}

std::unique_ptr<testing::MujocoArm> RecordedArm::make_plant(
    double friction, const std::optional<sim::Wall>& wall) const {
  sim::RobotParameters parameters = parameters_;
  parameters.coulomb_friction = sim::JointVector::Constant(joints_, friction);
  sim::ArmOptions world;
  world.coulomb_friction = friction > 0;
  world.wall = wall;
  const auto robot =
      sim::Robot::from_file(testing::arm_path(file_.file), file_.base, file_.tip, parameters);
  return Plant::make(robot, world, {}, home_);
}

void RecordedArm::choose_springs(Dice& draw) {
  const Index stride = coordinates_ / joints_;
  MatrixXd mobility(coordinates_, coordinates_);
  for (Index i = 0; i < coordinates_; ++i) {
    mobility.col(i) = ideal_->acceleration(VectorXd::Unit(coordinates_, i));
  }
  mass_ = mobility.inverse();
  MatrixXd M(joints_, joints_);
  for (Index i = 0; i < joints_; ++i) {
    for (Index j = 0; j < joints_; ++j) M(i, j) = mass_(i * stride, j * stride);
  }
  springs_.resize(joints_);
  for (Index i = 0; i < joints_; ++i) springs_[i] = M(i, i) * std::pow(draw.uniform(8, 40), 2);
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> undamped(springs_.asDiagonal(), M);
  VectorXd rates = undamped.eigenvalues().cwiseSqrt();
  for (double& rate : rates) rate *= 2 * draw.uniform(recipe_.least_ratio, recipe_.most_ratio);
  const MatrixXd MU = M * undamped.eigenvectors();
  damping_ = MU * rates.asDiagonal() * MU.transpose();
  damping_.diagonal() *= 1.1;
  stiffness_ = spread(springs_, stride).asDiagonal();
  for (Index i = 0; i < joints_ && stride > 1; ++i) {
    stiffness_(i * stride + 1, i * stride + 1) = parameters_.gear_stiffness[i];
  }
}

VectorXd RecordedArm::tick(Plant& arm, const VectorXd& state, const VectorXd& push,
                           const VectorXd& limit) const {
  const Index n = joints_, N = coordinates_, stride = N / n, waiting = state.size() - 2 * N;
  VectorXd q(n), v(n);
  for (Index i = 0; i < n; ++i) q[i] = state[i * stride], v[i] = state[N + i * stride];
  const VectorXd wanted =
      (-springs_.cwiseProduct(q) - damping_ * v).cwiseMin(limit).cwiseMax(-limit);
  const VectorXd acting = waiting > 0 ? VectorXd(state.segment(2 * N, n)) : wanted;
  arm.place(home_ + state.head(N), state.segment(N, N));
  arm.step(spread(acting + push, stride), kTick);
  VectorXd next(state.size());
  next.head(N) = arm.position() - home_;
  next.segment(N, N) = arm.velocity();
  if (waiting > 0) {
    next.segment(2 * N, waiting - n) = state.tail(waiting - n);
    next.tail(n) = wanted;
  }
  return next;
}

double RecordedArm::linearize() {
  constexpr double kStep = 1e-5, kLeast = 1e-3, kReal = 1e-6;
  const Index size = 2 * coordinates_ + recipe_.delay * joints_;
  const VectorXd none = VectorXd::Zero(joints_), rest = VectorXd::Zero(size);
  const VectorXd free = VectorXd::Constant(joints_, std::numeric_limits<double>::infinity());
  A_.resize(size, size);
  B_.resize(size, joints_);
  for (Index i = 0; i < size; ++i) {
    const VectorXd step = kStep * VectorXd::Unit(size, i);
    A_.col(i) = (tick(*ideal_, step, none, free) - tick(*ideal_, -step, none, free)) / (2 * kStep);
  }
  for (Index i = 0; i < joints_; ++i) {
    const VectorXd push = VectorXd::Unit(joints_, i);
    B_.col(i) = (tick(*ideal_, rest, push, free) - tick(*ideal_, rest, -push, free)) / 2;
  }
  const Eigen::EigenSolver<MatrixXd> solver(A_);
  values_ = solver.eigenvalues().array().log() / kTick;
  vectors_ = solver.eigenvectors();
  modes_.clear();
  for (Index i = 0; i < size; ++i) {  // what is over at once is the delay
    if (std::abs(solver.eigenvalues()[i]) < kLeast || values_[i].imag() < -kReal) continue;
    modes_.push_back({values_[i]});
  }
  return solver.eigenvalues().cwiseAbs().maxCoeff();
}

MatrixXd RecordedArm::pushes(Dice& draw, Recording& recording) const {
  if (recipe_.motion == Motion::kRelease) {
    recording.decays = {{0, kDecay}};
    return MatrixXd::Zero(joints_, kDecay);
  }
  const auto direction = [&] { return VectorXd(springs_.cwiseProduct(draw.vector(joints_))); };
  if (recipe_.motion == Motion::kPushes) {
    MatrixXd push = MatrixXd::Zero(joints_, 3 * (kPush + kBetween) + kBetween / 5);
    for (Index at = kBetween / 5; at < push.cols(); at += kPush + kBetween) {
      push.middleCols(at, kPush).colwise() = direction();
      recording.decays.emplace_back(at + kPush, at + kPush + kBetween);
    }
    return push;
  }
  if (recipe_.motion == Motion::kAmbient) {
    MatrixXd push(joints_, kAmbient);
    for (Index i = 0; i < kAmbient; ++i) {
      push.col(i) = i % 2 == 0 ? direction() : VectorXd(push.col(i - 1));
    }
    return push;
  }
  constexpr double kFrom = 0.3, kTo = 12, kLength = kChirp * kTick;  // Hz, s
  recording.input.resize(kChirp);
  for (Index i = 0; i < kChirp; ++i) {
    const double t = static_cast<double>(i) * kTick;
    const double cycles = t * (kFrom + (kTo - kFrom) * t / (2 * kLength));
    recording.input[i] = std::sin(2 * std::numbers::pi * cycles);
  }
  return direction() * recording.input.transpose();
}

MatrixXd RecordedArm::predicted(const VectorXd& start, const MatrixXd& push) const {
  MatrixXd states(start.size(), push.cols());
  states.col(0) = start;
  for (Index i = 1; i < push.cols(); ++i) {
    states.col(i) = A_ * states.col(i - 1) + B_ * push.col(i - 1);
  }
  return states;
}

void RecordedArm::mark_strong(const MatrixXd& states, const Recording& recording) {
  const Index N = coordinates_;
  const Eigen::PartialPivLU<Eigen::MatrixXcd> inverse(vectors_);
  VectorXd energies = VectorXd::Zero(values_.size());
  for (const auto& [from, before] : recording.decays) {
    const Eigen::VectorXcd weights =
        inverse.solve(states.col(from).cast<std::complex<double>>().eval());
    VectorXd energy(values_.size());
    for (Index i = 0; i < energy.size(); ++i) {
      const Eigen::VectorXcd q = weights[i] * vectors_.col(i).head(N);
      const Eigen::VectorXcd v = weights[i] * vectors_.col(i).segment(N, N);
      energy[i] = q.dot(stiffness_ * q).real() + v.dot(mass_ * v).real();
      if (values_[i].imag() > 0) energy[i] *= 2;  // and its conjugate
      if (values_[i].imag() < 0) energy[i] = 0;
    }
    energies += energy / energy.sum();
  }
  for (TrueMode& mode : modes_) {
    const double frequency = std::abs(mode.value), ratio = -mode.value.real() / frequency;
    Index at = 0;
    (values_.array() - mode.value).abs().minCoeff(&at);
    const double share =
        energies[at] / static_cast<double>(std::max<std::size_t>(1, recording.decays.size()));
    constexpr double kBelow = 9 * 2 * std::numbers::pi, kLight = 0.9;
    mode.strong = mode.value.imag() > 1e-6 &&
                  (recipe_.motion == Motion::kAmbient ||
                   (recipe_.motion == Motion::kChirp ? frequency < kBelow && ratio < kLight
                                                     : share >= kEnergy));
  }
}

/// The inverse of Fisher's information of a release, with all amplitudes and rests unknown.
void RecordedArm::mark_determined(const MatrixXd& motion) {
  const auto every = static_cast<Index>(std::lround(1 / (kTick * recipe_.rate)));
  const MatrixXd y = motion(Eigen::all, Eigen::seq(0, Eigen::last, every)).transpose();
  const VectorXd t = kTick * static_cast<double>(every) *
                     VectorXd::LinSpaced(y.rows(), 0, static_cast<double>(y.rows() - 1));
  const auto width = static_cast<Index>(2 * modes_.size());
  MatrixXd waves(y.rows(), width + 1);
  waves.col(width).setOnes();
  for (Index k = 0; k < width; k += 2) {
    const Eigen::VectorXcd wave = (modes_[static_cast<std::size_t>(k / 2)].value * t).array().exp();
    waves.col(k) = wave.real();
    waves.col(k + 1) = wave.imag();
  }
  const VectorXd scale = waves.colwise().norm().transpose().cwiseMax(1e-300).cwiseInverse();
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(waves * scale.asDiagonal());
  const MatrixXd amplitudes = scale.asDiagonal() * qr.solve(y);
  const MatrixXd basis = qr.householderQ() * MatrixXd::Identity(y.rows(), qr.rank());
  MatrixXd slopes(y.size(), width);  // by the logarithm of each frequency, and by each ratio
  for (Index k = 0; k < width; k += 2) {
    const std::complex<double> value = modes_[static_cast<std::size_t>(k / 2)].value;
    const double w = std::abs(value), ratio = -value.real() / w;
    const VectorXd c = waves.col(k).cwiseProduct(t), s = waves.col(k + 1).cwiseProduct(t);
    const MatrixXd by_real = c * amplitudes.row(k) + s * amplitudes.row(k + 1);
    const MatrixXd by_imaginary = c * amplitudes.row(k + 1) - s * amplitudes.row(k);
    const double turn = w * ratio / std::sqrt(std::max(1e-12, 1 - ratio * ratio));
    for (const auto& [column, slope] :
         {std::pair<Index, MatrixXd>(k, value.real() * by_real + value.imag() * by_imaginary),
          {k + 1, -w * by_real - turn * by_imaginary}}) {
      slopes.col(column) = (slope - basis * (basis.transpose() * slope)).reshaped();
    }
  }
  const VectorXd size = slopes.colwise().norm().transpose().cwiseMax(1e-300).cwiseInverse();
  const MatrixXd correlation =
      size.asDiagonal() * (slopes.transpose() * slopes) * size.asDiagonal();
  const VectorXd variance =
      correlation.completeOrthogonalDecomposition().pseudoInverse().diagonal().cwiseProduct(
          size.cwiseAbs2());
  const double step = recipe_.bits > 0 ? 2 * std::numbers::pi / std::exp2(recipe_.bits) : 0;
  const double noise = std::hypot(recipe_.noise, step / std::sqrt(12.0));
  constexpr double kKnown = 0.05;
  for (Index k = 0; k < width; k += 2) {
    modes_[static_cast<std::size_t>(k / 2)].determined =
        noise * std::sqrt(variance.segment(k, 2).maxCoeff()) < kKnown;
  }
}

sim::Wall RecordedArm::wall_in_the_way(const MatrixXd& states, Dice& draw) {
  const auto tip = [&](const VectorXd& state) {
    ideal_->place(home_ + state.head(coordinates_), sim::JointVector::Zero(coordinates_));
    return ideal_->tip_pose().position;
  };
  const Eigen::Vector3d rest = tip(VectorXd::Zero(states.rows()));
  Eigen::Vector3d into = draw.vector(3).normalized();
  if (into.dot(tip(states.col(0)) - rest) > 0) into = -into;
  double farthest = 0;
  for (Index i = 0; i < states.cols(); i += 5) {
    farthest = std::max(farthest, into.dot(tip(states.col(i)) - rest));
  }
  sim::Wall wall;
  wall.point = rest + into * farthest / 3;
  wall.normal = -into;
  return wall;
}

MatrixXd RecordedArm::motors(const MatrixXd& states) const {
  const Index stride = coordinates_ / joints_;
  MatrixXd result(joints_, states.cols());
  for (Index i = 0; i < joints_; ++i) result.row(i) = states.row(i * stride);
  return result;
}

void RecordedArm::sense(const MatrixXd& motion, Dice& draw, Recording& recording) const {
  const auto every = static_cast<Index>(std::lround(1 / (kTick * recipe_.rate)));
  const Index samples = motion.cols() / every, stride = coordinates_ / joints_;
  recording.time.resize(samples);
  recording.output.resize(joints_, samples);
  const VectorXd drift = recipe_.drift * draw.vector(joints_);
  VectorXd phase(joints_);
  for (double& angle : phase) angle = draw.uniform(0, 2 * std::numbers::pi);
  for (Index i = 0; i < samples; ++i) {
    const double t = static_cast<double>(i * every) * kTick;
    const double late = recipe_.jitter * draw.normal(), most = 0.45 * kTick;
    recording.time[i] = t + std::clamp(late, -most, most);
    for (Index c = 0; c < joints_; ++c) {
      double& y = recording.output(c, i);
      y = home_[c * stride] + motion(c, i * every) + recipe_.noise * draw.normal() +
          drift[c] * static_cast<double>(i) / static_cast<double>(samples) +
          recipe_.hum * std::sin(100 * std::numbers::pi * t + phase[c]);
      const double step = 2 * std::numbers::pi / std::exp2(recipe_.bits);
      if (recipe_.bits > 0) y = step * std::round(y / step);
    }
  }
  for (auto& [from, before] : recording.decays) {
    from = (from + every - 1) / every;
    before = std::min(before / every, samples);
  }
}

Recording RecordedArm::record(Dice& draw) {
  Recording recording;
  VectorXd start = VectorXd::Zero(A_.rows());
  if (recipe_.motion == Motion::kRelease) {
    const VectorXd away = recipe_.size * draw.vector(joints_);
    start.head(coordinates_) = spread(away, coordinates_ / joints_);
    for (int i = 0; i < recipe_.delay; ++i) {
      start.segment(2 * coordinates_ + i * joints_, joints_) = -springs_.cwiseProduct(away);
    }
  }
  MatrixXd push = pushes(draw, recording);
  MatrixXd states = predicted(start, push);
  if (recipe_.motion != Motion::kRelease) {
    const double factor = recipe_.size / motors(states).cwiseAbs().maxCoeff();
    push *= factor;
    states *= factor;
  }
  mark_strong(states, recording);
  if (recipe_.motion == Motion::kRelease) mark_determined(motors(states));
  std::optional<sim::Wall> wall;
  if (recipe_.wall) wall = wall_in_the_way(states, draw);
  const auto arm = make_plant(draw.uniform(recipe_.least_friction, recipe_.most_friction), wall);
  const VectorXd limit = VectorXd::Constant(joints_, std::numeric_limits<double>::infinity());
  const VectorXd clip = recipe_.clip * recipe_.size * springs_;
  for (Index i = 1; i < push.cols(); ++i) {
    states.col(i) = tick(*arm, states.col(i - 1), push.col(i - 1), recipe_.clip > 0 ? clip : limit);
  }
  sense(motors(states), draw, recording);
  return recording;
}

}  // namespace dashpot::stress
