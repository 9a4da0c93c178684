// The spectrum of a moving arm, call by call: a Panda whose joints swing by 0.5 rad, sampled at 1
// kHz, held by a Cartesian impedance (7 joints, 6 modes, one zero mode). `tracked` goes from {M, C,
// W} to all modes with eigenvectors of both sides, frequencies, ratios and proved bounds;
// `values_only` leaves out the eigenvectors; `reused` solves one system repeatedly. For comparison,
// Eigen's fixed-size EigenSolver with right vectors and LAPACK's dgeev with both sides on the 12 x
// 12 state matrices of the same path, which are formed outside the clock. `tracked_full` and
// `eigen_full` (of run-time size) have n joints and n modes; `tracked/14` and `path_eigen/14` are a
// Panda with elastic joints, and `tracked_link/14` is one whose links are measured;
// `tracked_nonsymmetric` has the same path with a part of K and C that is not symmetric.
// `backward_error` is the worst along the path, of every kRivalSteps-th system. `paced` and
// `evicted`, and `eigen_...` and `lapack_...` of them, are timed call by call: one in a
// millisecond, and after 64 MB of other data have passed through the caches. Coefficients or state
// matrix, just written by a loop, are near the processor.
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/benchmarks/one_by_one.hpp>
#include <dashpot/tests/support/arm_path.hpp>
#include <dashpot/tests/support/panda_path.hpp>

#include <benchmark/benchmark.h>
#include <lapacke.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

namespace {

using namespace dashpot::analysis;  // NOLINT: a program's own file
using dashpot::benchmarks::time_one_by_one;
using dashpot::testing::panda_impedance;
using dashpot::testing::swing;
using Eigen::MatrixXd;

constexpr int kSteps = 1000;
constexpr int kRivalSteps = 20;  ///< systems of the path for each that rivals solve
constexpr unsigned kSeed = 20210002;

/// One second of the path.
const std::vector<System<kMaxDof>>& panda_path(double ratio) {
  static std::vector<System<kMaxDof>> path;
  static double of = -1;
  if (of != ratio) {
    path.clear();
    for (int step = 0; step < kSteps; ++step) {
      path.push_back(panda_impedance(swing(1e-3 * step), ratio));
    }
    of = ratio;
  }
  return path;
}

/// One second of the path of a Panda with elastic joints and posture springs: 14 modes. If the
/// links are measured, the stiffness is not symmetric.
std::vector<System<kMaxDof>> elastic_path(dashpot::controller::PositionSensor sensor) {
  dashpot::controller::ModelOptions options;
  options.drives = "fr3";
  options.gear_stiffness = Eigen::VectorXd::LinSpaced(7, 1e4, 3e3);  // N m/rad
  options.gear_damping = Eigen::VectorXd::LinSpaced(7, 1, 0.5);      // N m s/rad
  options.position_sensor = sensor;
  dashpot::testing::ArmLoop loop(dashpot::testing::arm_model(dashpot::testing::arms()[0], options),
                                 {});
  std::vector<System<kMaxDof>> path;
  for (int step = 0; step < kSteps; ++step) {
    path.push_back(loop.at(swing(1e-3 * step)));
    const StiffnessFactor<kMaxDof>& W = path.back().stiffness_factor;
    if (W.rows() > 0) path.back().stiffness = W.transpose() * W;  // for the backward error
  }
  return path;
}

/// n joints and n modes; factors of the coefficients turn and swing smoothly.
std::vector<System<kMaxDof>> full_path(int n) {
  std::mt19937_64 generator(kSeed + static_cast<unsigned>(n));
  std::normal_distribution<double> normal;
  std::array<std::array<MatrixXd, 2>, 3> parts;
  for (auto& part : parts) {
    for (MatrixXd& matrix : part) {
      matrix = MatrixXd::NullaryExpr(n, n, [&] { return normal(generator); });
    }
  }
  std::vector<System<kMaxDof>> path;
  for (int step = 0; step < kSteps; ++step) {
    const double t = 1e-3 * step;
    System<kMaxDof> system(n);
    const std::array<Square<kMaxDof>*, 3> out = {&system.mass, &system.damping, &system.stiffness};
    const std::array<double, 3> size = {1, 10, 1000}, floor = {0.1, 0.1, 0.01};
    for (std::size_t k = 0; k < 3; ++k) {
      const MatrixXd F = parts[k][0] + 0.3 * std::sin(3 * t + static_cast<double>(k)) * parts[k][1];
      const MatrixXd product = F * F.transpose() / n;
      *out[k] =
          size[k] * (0.5 * (product + product.transpose()) + floor[k] * MatrixXd::Identity(n, n));
    }
    path.push_back(system);
  }
  return path;
}

/// A path whose stiffness and damping are not symmetric: n joints turn the forces of others by as
/// much as a twentieth of their own.
std::vector<System<kMaxDof>> nonsymmetric_path(int n) {
  std::vector<System<kMaxDof>> path = full_path(n);
  std::mt19937_64 generator(kSeed);
  std::normal_distribution<double> normal;
  std::array<MatrixXd, 2> parts;
  for (MatrixXd& matrix : parts) {
    matrix = MatrixXd::NullaryExpr(n, n, [&] { return normal(generator); });
  }
  for (std::size_t step = 0; step < path.size(); ++step) {
    const double t = 1e-3 * static_cast<double>(step);
    path[step].damping += 0.5 * std::cos(3 * t) * parts[0];
    path[step].stiffness += 50 * std::cos(2 * t) * parts[1];
  }
  return path;
}

/// A = [0 G; -G' -D] of the motions other than zero modes, in energy coordinates; the lower half y
/// of an eigenvector is the motion u = lift y of the joints.
struct StateMatrix {
  MatrixXd A, lift;
};

StateMatrix state_matrix(const System<kMaxDof>& system) {
  const MatrixXd L = MatrixXd(system.mass).llt().matrixL();
  const auto lower = L.triangularView<Eigen::Lower>();
  const MatrixXd CL = lower.solve(MatrixXd(system.damping));
  const MatrixXd D = lower.solve(MatrixXd(CL.transpose()));
  MatrixXd W = system.stiffness_factor;
  if (W.rows() == 0) W = MatrixXd(system.stiffness).llt().matrixU();
  const MatrixXd J = lower.solve(MatrixXd(W.transpose())).transpose();
  const Eigen::JacobiSVD<MatrixXd> svd(J, Eigen::ComputeFullV);
  const Eigen::Index m = J.rows();
  const MatrixXd P = svd.matrixV().leftCols(m);
  MatrixXd A = MatrixXd::Zero(2 * m, 2 * m);
  A.topRightCorner(m, m) = J * P;
  A.bottomLeftCorner(m, m) = -(J * P).transpose();
  A.bottomRightCorner(m, m) = -P.transpose() * D * P;
  return {A, L.transpose().triangularView<Eigen::Upper>().solve(P)};
}

double backward_error(const System<kMaxDof>& system, const Complex& value,
                      const ComplexVector<kMaxDof>& u) {
  const ComplexVector<kMaxDof> residual =
      value * value * (system.mass * u) + value * (system.damping * u) + system.stiffness * u;
  return residual.norm() / ((std::norm(value) * system.mass.norm() +
                             std::abs(value) * system.damping.norm() + system.stiffness.norm()) *
                            u.norm());
}

double worst_backward_error(const System<kMaxDof>& system, const TrackedSpectrum& spectrum) {
  double worst = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(spectrum.mode_count); ++i) {
    for (std::size_t k = 0; k < 2; ++k) {
      worst = std::max(
          worst, backward_error(system, spectrum.modes[i].eigenvalues[k], spectrum.shapes[i].u[k]));
    }
  }
  return worst;
}

/// Returns the worst error of eigenvectors of the state matrix, in the columns of X.
double worst_backward_error(const System<kMaxDof>& system, const MatrixXd& lift,
                            const Eigen::VectorXcd& values, const Eigen::MatrixXcd& X) {
  double worst = 0;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    worst = std::max(worst, backward_error(system, values[i], lift * X.col(i).tail(lift.cols())));
  }
  return worst;
}

/// Brings a matrix near the processor.
void fetch(const double* data, Eigen::Index size) {
  constexpr Eigen::Index kCacheLine = 8;
  for (Eigen::Index k = 0; k < size; k += kCacheLine) __builtin_prefetch(data + k);
}

/// There and back again, so that the path has no jump. The system after next is fetched meanwhile:
/// a control loop has just written what it hands to the tracker, and the rivals' matrices are few.
class Sweep {
 public:
  explicit Sweep(const std::vector<System<kMaxDof>>& path) : path_(path) {}
  const System<kMaxDof>& next() {
    if (at_ + direction_ < 0 || at_ + direction_ >= kSteps) direction_ = -direction_;
    at_ += direction_;
    const int soon = std::clamp(at_ + 2 * direction_, 0, kSteps - 1);
    const System<kMaxDof>& system = path_[static_cast<std::size_t>(soon)];
    fetch(system.mass.data(), system.mass.size());
    fetch(system.damping.data(), system.damping.size());
    if (system.stiffness_factor.rows() == 0)
      fetch(system.stiffness.data(), system.stiffness.size());
    fetch(system.stiffness_factor.data(), system.stiffness_factor.size());
    return path_[static_cast<std::size_t>(at_)];
  }

 private:
  const std::vector<System<kMaxDof>>& path_;
  int at_ = 0, direction_ = 1;
};

enum class Input {
  kMoving,
  kFrozen,
};

void track(benchmark::State& state, const std::vector<System<kMaxDof>>& path,
           const TrackerOptions& options, Input input) {
  const auto tracker = std::make_unique<ModeTracker>(options);
  const auto spectrum = std::make_unique<TrackedSpectrum>();
  Sweep sweep(path);
  for (int step = 0; step < 10; ++step) tracker->update(sweep.next(), *spectrum);
  const TrackerCounters before = tracker->counters();
  const System<kMaxDof>* system = &sweep.next();
  tracker->update(*system, *spectrum);
  for (auto _ : state) {
    if (input == Input::kMoving) system = &sweep.next();
    benchmark::DoNotOptimize(tracker->update(*system, *spectrum));
    benchmark::ClobberMemory();
  }
  if (spectrum->status != Status::kOk) state.SkipWithError(to_text(spectrum->status));
  const TrackerCounters& counters = tracker->counters();
  state.counters["mean_iterations"] = static_cast<double>(counters.iterations - before.iterations) /
                                      static_cast<double>(counters.updates() - before.updates());
  state.counters["direct"] = static_cast<double>(counters.direct - before.direct);
  double bound = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(spectrum->mode_count); ++i) {
    const ModeNumbers& mode = spectrum->modes[i];
    bound = std::max(bound, mode.error_bound / std::abs(mode.eigenvalues[1]));
  }
  state.counters["relative_bound"] = bound;
  if (!options.shapes) return;
  double error = worst_backward_error(*system, *spectrum);
  for (int step = 0; step < kSteps && input == Input::kMoving; ++step) {
    system = &sweep.next();
    tracker->update(*system, *spectrum);
    if (step % kRivalSteps == 0) error = std::max(error, worst_backward_error(*system, *spectrum));
  }
  state.counters["backward_error"] = error;
}

/// Systems for the rivals.
struct RivalPath {
  std::vector<System<kMaxDof>> systems;
  std::vector<StateMatrix> matrices;

  explicit RivalPath(const std::vector<System<kMaxDof>>& path) {
    for (int step = 0; step < kSteps; step += kRivalSteps) {
      systems.push_back(path[static_cast<std::size_t>(step)]);
      matrices.push_back(state_matrix(systems.back()));
    }
  }
};

/// Matrix is 12 x 12 or of run-time size.
template <typename Matrix>
void eigen(benchmark::State& state, const std::vector<System<kMaxDof>>& path) {
  const RivalPath rival(path);
  std::vector<Matrix, Eigen::aligned_allocator<Matrix>> matrices;
  for (const StateMatrix& matrix : rival.matrices) matrices.push_back(matrix.A);
  Eigen::EigenSolver<Matrix> solver(matrices[0].rows());
  std::size_t next = 0;
  for (auto _ : state) {
    solver.compute(matrices[next++ % matrices.size()], true);
    benchmark::DoNotOptimize(solver.eigenvalues().data());
    benchmark::ClobberMemory();
  }
  double error = 0;
  for (std::size_t k = 0; k < matrices.size(); ++k) {
    solver.compute(matrices[k], true);
    error = std::max(error, worst_backward_error(rival.systems[k], rival.matrices[k].lift,
                                                 solver.eigenvalues(), solver.eigenvectors()));
  }
  state.counters["backward_error"] = error;
}

/// LAPACK's dgeev with both sides.
class Dgeev {
 public:
  explicit Dgeev(Eigen::Index size)
      : n_(static_cast<lapack_int>(size)),
        copy_(size, size),
        left_(size, size),
        right_(size, size),
        re_(size),
        im_(size),
        work_(16 * size) {}

  void solve(const MatrixXd& A) {
    copy_ = A;
    LAPACKE_dgeev_work(LAPACK_COL_MAJOR, 'V', 'V', n_, copy_.data(), n_, re_.data(), im_.data(),
                       left_.data(), n_, right_.data(), n_, work_.data(), 16 * n_);
  }
  Eigen::VectorXcd values() const {
    Eigen::VectorXcd result(n_);
    result.real() = re_;
    result.imag() = im_;
    return result;
  }
  Eigen::MatrixXcd vectors() const {
    Eigen::MatrixXcd X = right_.cast<Complex>();
    for (Eigen::Index i = 0; i < n_; ++i) {
      if (im_[i] <= 0) continue;
      X.col(i).imag() = right_.col(i + 1);
      X.col(i + 1) = X.col(i).conjugate();
    }
    return X;
  }

 private:
  lapack_int n_;
  MatrixXd copy_, left_, right_;
  Eigen::VectorXd re_, im_, work_;
};

void lapack(benchmark::State& state, const std::vector<System<kMaxDof>>& path) {
  const RivalPath rival(path);
  Dgeev solver(rival.matrices[0].A.rows());
  std::size_t next = 0;
  for (auto _ : state) {
    solver.solve(rival.matrices[next++ % rival.matrices.size()].A);
    benchmark::ClobberMemory();
  }
  double error = 0;
  for (std::size_t k = 0; k < rival.matrices.size(); ++k) {
    solver.solve(rival.matrices[k].A);
    error = std::max(error, worst_backward_error(rival.systems[k], rival.matrices[k].lift,
                                                 solver.values(), solver.vectors()));
  }
  state.counters["backward_error"] = error;
}

template <typename Function>
void add(const std::string& name, Function function) {
  benchmark::RegisterBenchmark(name.c_str(), function)->Unit(benchmark::kMicrosecond);
}

/// A solver that is called once for each system of a path.
struct Caller {
  std::function<void()> fetch_input;
  std::function<void()> solve;
};

Caller tracker_caller() {
  struct Tracked {
    ModeTracker tracker;
    TrackedSpectrum spectrum;
    Sweep sweep{panda_path(0.1)};
    System<kMaxDof> system;
  };
  const auto tracked = std::make_shared<Tracked>();
  const auto next = [tracked] { tracked->system = tracked->sweep.next(); };
  const auto solve = [tracked] { tracked->tracker.update(tracked->system, tracked->spectrum); };
  for (int step = 0; step < 10; ++step) {
    next();
    solve();
  }
  return {next, solve};
}

/// `solve(solver, matrix)` finds the spectrum of a state matrix.
template <class Solver, class Matrix, class Solve>
Caller rival_caller(const Solve& solve) {
  struct Rival {
    std::vector<StateMatrix> matrices = RivalPath(panda_path(0.1)).matrices;
    Matrix A;
    Solver solver{12};
    std::size_t next = 0;
  };
  const auto rival = std::allocate_shared<Rival>(Eigen::aligned_allocator<Rival>());
  return {[rival] { rival->A = rival->matrices[rival->next++ % rival->matrices.size()].A; },
          [rival, solve] { solve(rival->solver, rival->A); }};
}

template <class Prepare>
void add_one_by_one(const std::string& name, int calls, const std::function<Caller()>& make) {
  benchmark::RegisterBenchmark(name.c_str(),
                               [=](benchmark::State& state) {
                                 const Caller caller = make();
                                 Prepare prepare;
                                 const auto before = [&] {
                                   prepare();
                                   caller.fetch_input();
                                 };
                                 time_one_by_one(state, before, caller.solve);
                               })
      ->Iterations(calls)
      ->UseManualTime()
      ->Unit(benchmark::kMicrosecond);
}

template <class Prepare>
void add_cold(const std::string& how, int calls) {
  using Matrix = Eigen::Matrix<double, 12, 12>;
  add_one_by_one<Prepare>("spectrum/" + how + "/6", calls, tracker_caller);
  add_one_by_one<Prepare>("spectrum/eigen_" + how + "/6", calls, [] {
    return rival_caller<Eigen::EigenSolver<Matrix>, Matrix>(
        [](Eigen::EigenSolver<Matrix>& solver, const Matrix& A) { solver.compute(A, true); });
  });
  add_one_by_one<Prepare>("spectrum/lapack_" + how + "/6", calls, [] {
    return rival_caller<Dgeev, MatrixXd>([](Dgeev& solver, const MatrixXd& A) { solver.solve(A); });
  });
}

void add_full(int n) {
  const std::string size = "/" + std::to_string(n);
  add("spectrum/tracked_full" + size,
      [=](benchmark::State& state) { track(state, full_path(n), {}, Input::kMoving); });
  add("spectrum/eigen_full" + size,
      [=](benchmark::State& state) { eigen<MatrixXd>(state, full_path(n)); });
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  TrackerOptions values_only;
  values_only.shapes = false;
  for (const auto& [suffix, ratio] :
       {std::pair<std::string, double>{"", 0.1}, {"_heavy", 1.0}, {"_undamped", 0.0}}) {
    const double damping = ratio;
    const std::string end = suffix + "/6";
    add("spectrum/tracked" + end,
        [=](auto& state) { track(state, panda_path(damping), {}, Input::kMoving); });
    add("spectrum/values_only" + end,
        [=](auto& state) { track(state, panda_path(damping), values_only, Input::kMoving); });
    add("spectrum/reused" + end,
        [=](auto& state) { track(state, panda_path(damping), {}, Input::kFrozen); });
    add("spectrum/path_eigen" + end,
        [=](auto& state) { eigen<Eigen::Matrix<double, 12, 12>>(state, panda_path(damping)); });
    add("spectrum/path_lapack" + end, [=](auto& state) { lapack(state, panda_path(damping)); });
  }
  using dashpot::controller::PositionSensor;
  add("spectrum/tracked/14",
      [](auto& state) { track(state, elastic_path(PositionSensor::kMotor), {}, Input::kMoving); });
  add("spectrum/path_eigen/14",
      [](auto& state) { eigen<MatrixXd>(state, elastic_path(PositionSensor::kMotor)); });
  add("spectrum/tracked_link/14",
      [](auto& state) { track(state, elastic_path(PositionSensor::kLink), {}, Input::kMoving); });
  for (int n = 2; n <= kMaxDof; ++n) add_full(n);
  for (const int n : {7, kMaxDof}) {
    add("spectrum/tracked_nonsymmetric/" + std::to_string(n),
        [=](benchmark::State& state) { track(state, nonsymmetric_path(n), {}, Input::kMoving); });
  }
  add_cold<dashpot::benchmarks::Paced>("paced", 2000);
  add_cold<dashpot::benchmarks::Evicted>("evicted", 200);
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
