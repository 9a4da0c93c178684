#include <dashpot/analysis/design/damping_fit.hpp>
#include <dashpot/analysis/response/damping_gradients.hpp>
#include <dashpot/analysis/spectrum.hpp>

#include <Eigen/Cholesky>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMaxIterations = 200;
/// Violations below this are zero.
constexpr double kSolved = 1e-12;
/// A search ends when so many steps together gain less than this part of the sum of squares.
constexpr int kPatience = 6;
constexpr double kLittle = 1e-3;
/// Most bytes of a search, and the parts of them: of all gradients, of one system's
/// for several threads, and of three Hessians.
constexpr double kMostBytes = 8e8;

/// X = S R R' S as a function of the entries of R.
struct Factor {
  VectorXd scale;  // diagonal of S
  MatrixXd R;

  MatrixXd matrix() const {
    const MatrixXd SR = scale.asDiagonal() * R;
    MatrixXd X = SR * SR.transpose();
    return 0.5 * (X + X.transpose());
  }
};

/// Returns a factor of a positive semidefinite X of the structure.
Factor factor_of(const MatrixXd& X) {
  const Index k = X.rows();
  const double largest = X.diagonal().maxCoeff();
  if (!(largest > 0)) return {VectorXd::Ones(k), MatrixXd::Identity(k, k)};
  // Directions that the start does not damp get a little: at R = 0 nothing pulls.
  Factor factor{X.diagonal().cwiseMax(1e-6 * largest).cwiseSqrt(), {}};
  const VectorXd inverse = factor.scale.cwiseInverse();
  MatrixXd unit = inverse.asDiagonal() * X * inverse.asDiagonal();
  unit.diagonal().array() += 1e-10;
  factor.R = unit.llt().matrixL();
  return factor;
}

bool in_structure(Index i, Index j, DampingStructure structure) {
  return structure == DampingStructure::kFull || i == j ||
         (structure == DampingStructure::kBlock && (i < 3) == (j < 3));
}

}  // namespace

DampingSample damping_sample(const TaskImpedance& impedance) {
  if (impedance.jacobian_rate) {
    throw InvalidSystem("jacobian_rate", "depends on the damping that is sought: leave it out");
  }
  TaskImpedance bare = impedance;
  bare.task_damping.reset();
  if (impedance.jacobian && !impedance.task_stiffness) {
    throw InvalidSystem("task_stiffness", "missing; the damping is matched to it");
  }
  DampingSample sample{to_joint_space(bare), {}};
  const Index n = sample.system.dof();
  sample.map = MatrixXd::Identity(n, n);
  if (impedance.jacobian) sample.map = impedance.jacobian->transpose();
  return sample;
}

void for_each_in_parallel(std::size_t count, int threads,
                          const std::function<void(std::size_t)>& act) {
  const auto wanted = threads > 0 ? static_cast<std::size_t>(threads)
                                  : std::max<std::size_t>(1, std::thread::hardware_concurrency());
  const std::size_t used = std::min(wanted, count);
  std::vector<std::exception_ptr> errors(count);
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        act(i);
      } catch (...) {
        errors[i] = std::current_exception();
      }
    }
  };
  std::vector<std::thread> helpers;
  for (std::size_t k = 1; k < used; ++k) helpers.emplace_back(work);
  work();
  for (std::thread& helper : helpers) helper.join();
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

DampingFit::DampingFit(const std::vector<DampingSample>& samples, DampingStructure structure,
                       int threads)
    : samples_(samples), threads_(threads) {
  if (samples.empty()) throw std::invalid_argument("damping: there is no system to damp");
  const Index k = samples.front().map.cols();
  for (const DampingSample& sample : samples) {
    if (sample.map.cols() != k || sample.map.rows() != sample.system.dof()) {
      throw std::invalid_argument("damping: the systems differ in their directions");
    }
  }
  if (!fits(samples.size(), samples.front().system.dof(), k, structure)) {
    throw std::invalid_argument("damping: a search over " + std::to_string(samples.size()) +
                                " systems of " + std::to_string(samples.front().system.dof()) +
                                " coordinates with " + std::to_string(k) +
                                " directions would take more than 1 GB");
  }
  for (Index j = 0; j < k; ++j) {
    for (Index i = j; i < k; ++i) {
      if (in_structure(i, j, structure)) entries_.emplace_back(i, j);
    }
  }
}

bool DampingFit::fits(std::size_t samples, Index dof, Index directions,
                      DampingStructure structure) {
  constexpr double kThreads = 8;
  const auto n = static_cast<double>(dof), k = static_cast<double>(directions);
  double entries = 0;
  for (Index j = 0; j < directions; ++j) {
    for (Index i = j; i < directions; ++i) entries += in_structure(i, j, structure) ? 1 : 0;
  }
  const double numbers =
      static_cast<double>(samples) * n * k * k + kThreads * 2 * n * n * n + 3 * entries * entries;
  return numbers * sizeof(double) <= kMostBytes;
}

std::vector<DampingFit::Residual> DampingFit::of_sample(const DampingSample& sample,
                                                        const MatrixXd& X,
                                                        const RatioGoal& goal) const {
  System<> system = sample.system;
  const MatrixXd C = sample.map * X * sample.map.transpose();
  system.damping += 0.5 * (C + C.transpose());
  system.has_low_words = false;
  SpectrumOptions options;
  options.residual = SpectrumOptions::Residual::kWorking;
  SpectrumSolver<> solver(options);
  Spectrum<> spectrum;
  const Status status = solver.solve(system, spectrum);
  if (status == Status::kOverflow || status == Status::kNotFinite) {
    throw InvalidSystem("system", to_text(Status::kOverflow));
  }
  if (status != Status::kOk && status != Status::kUncertified) {
    throw std::runtime_error(to_text(status));
  }
  const std::vector<MatrixXd> gradients = damping_gradients(system, spectrum);
  std::vector<Residual> result;
  const double fastest = spectrum.modes.empty() ? 0 : spectrum.modes[0].natural_frequency;
  const double soft = goal.target.soft_limit(fastest);
  for (int i = 0; i < spectrum.modes.size(); ++i) {
    const double omega = spectrum.modes[i].natural_frequency;
    const double zeta = spectrum.modes[i].damping_ratio;
    if (!(omega >= soft)) continue;
    const MatrixXd& gradient = gradients[static_cast<std::size_t>(i)];
    const double lowest = goal.level * goal.target.ratio;
    const double highest = goal.ceiling.value_or(lowest);
    if (zeta >= lowest && zeta <= highest) continue;
    result.push_back({zeta < lowest ? zeta - lowest : zeta - highest,
                      sample.map.transpose() * gradient * sample.map});
  }
  return result;
}

std::vector<std::vector<DampingFit::Residual>> DampingFit::of_all(const MatrixXd& X,
                                                                  const RatioGoal& goal) const {
  std::vector<std::vector<Residual>> result(samples_.size());
  for_each_in_parallel(samples_.size(), threads_,
                       [&](std::size_t i) { result[i] = of_sample(samples_[i], X, goal); });
  return result;
}

MatrixXd DampingFit::within_structure(const MatrixXd& X) const {
  MatrixXd result = MatrixXd::Zero(X.rows(), X.cols());
  for (const auto& [i, j] : entries_) result(i, j) = result(j, i) = X(i, j);
  return result;
}

FitResult DampingFit::search(const MatrixXd& start, const RatioGoal& goal) const {
  Factor factor = factor_of(within_structure(start));
  const auto count = static_cast<Index>(entries_.size());
  MatrixXd H(count, count);
  VectorXd slope(count), row(count);
  double sum = 0, worst = 0;
  // Sum of squares at `at`, its Gauss-Newton Hessian and its slope.
  const auto evaluate = [&](const Factor& at, MatrixXd& H_out, VectorXd& slope_out,
                            double& worst_out) {
    const auto all = of_all(at.matrix(), goal);
    H_out.setZero(count, count);
    slope_out.setZero(count);
    double total = worst_out = 0;
    for (const auto& residuals : all) {
      for (const Residual& residual : residuals) {
        const MatrixXd G =
            2 * at.scale.asDiagonal() * residual.gradient * at.scale.asDiagonal() * at.R;
        for (Index p = 0; p < count; ++p) {
          const auto& [i, j] = entries_[static_cast<std::size_t>(p)];
          row[p] = G(i, j);
        }
        H_out.selfadjointView<Eigen::Lower>().rankUpdate(row);
        slope_out += residual.value * row;
        total += residual.value * residual.value;
        worst_out = std::max(worst_out, std::abs(residual.value));
      }
    }
    return total;
  };
  sum = evaluate(factor, H, slope, worst);
  double mu = 1e-3, sum_before = sum;
  MatrixXd H_next;
  VectorXd slope_next;
  int steps = 0;
  for (int k = 0; k < kMaxIterations && worst > kSolved && mu < 1e10; ++k) {
    MatrixXd A = H;
    A.diagonal().array() += mu * std::max(1e-300, H.diagonal().maxCoeff());
    const VectorXd step = A.selfadjointView<Eigen::Lower>().ldlt().solve(slope);
    Factor next = factor;
    for (Index p = 0; p < count; ++p) {
      const auto& [i, j] = entries_[static_cast<std::size_t>(p)];
      next.R(i, j) -= step[p];
    }
    double worst_next = 0;
    const double sum_next = evaluate(next, H_next, slope_next, worst_next);
    if (!(sum_next < sum)) {
      mu *= 5;
      continue;
    }
    factor = std::move(next);
    std::swap(H, H_next);
    std::swap(slope, slope_next);
    sum = sum_next;
    worst = worst_next;
    mu = std::max(1e-15, 0.1 * mu);
    if (++steps % kPatience == 0) {
      if (sum > (1 - kLittle) * sum_before) break;
      sum_before = sum;
    }
  }
  return {factor.matrix(), worst};
}

}  // namespace dashpot::analysis
