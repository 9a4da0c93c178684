// Cold solve of a damped second-order system with m modes: from {M, C, K} to modes with both
// eigenvector sides, backward errors and proved bounds (direct), compared with solvers that return
// less: Eigen's EigenSolver with right vectors and LAPACK's dgeev with both sides, each on the 2m x
// 2m state matrix, which is formed outside the clock. The worst backward error is printed beside
// each time.
#include <dashpot/analysis/spectrum.hpp>

#include <benchmark/benchmark.h>
#include <lapacke.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <random>
#include <string>

namespace {

using dashpot::analysis::Complex;
using dashpot::analysis::kDynamic;
using dashpot::analysis::kMaxDof;
using dashpot::analysis::Mode;
using dashpot::analysis::Spectrum;
using dashpot::analysis::SpectrumOptions;
using dashpot::analysis::SpectrumSolver;
using dashpot::analysis::Status;
using dashpot::analysis::System;
using dashpot::analysis::to_text;

constexpr unsigned kSeed = 20210001;

/// Masses and stiffnesses of an arm's size, mixed by a random congruence, damping ratios 0.05 to
/// 0.7 (or `damping` times that), not proportional.
System<> random_system(Eigen::Index m, double damping) {
  std::mt19937_64 generator(kSeed + static_cast<unsigned>(m));
  std::normal_distribution<double> normal;
  const auto random = [&] {
    return Eigen::MatrixXd(Eigen::MatrixXd::NullaryExpr(m, m, [&] { return normal(generator); }));
  };
  System<> system(m);
  const Eigen::MatrixXd A = random(), B = random(), D = random();
  system.mass = A * A.transpose() / static_cast<double>(m) + 0.1 * Eigen::MatrixXd::Identity(m, m);
  system.stiffness =
      1000 * (B * B.transpose() / static_cast<double>(m) + 0.01 * Eigen::MatrixXd::Identity(m, m));
  system.damping =
      10 * damping *
      (D * D.transpose() / static_cast<double>(m) + 0.1 * Eigen::MatrixXd::Identity(m, m));
  for (Eigen::MatrixXd* matrix : {&system.mass, &system.damping, &system.stiffness}) {
    *matrix = (0.5 * (*matrix + matrix->transpose())).eval();
  }
  return system;
}

/// [0 I; -M^-1 K  -M^-1 C]
Eigen::MatrixXd state_matrix(const System<>& system) {
  const Eigen::Index m = system.dof();
  const Eigen::LLT<Eigen::MatrixXd> mass(system.mass);
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(2 * m, 2 * m);
  A.topRightCorner(m, m).setIdentity();
  A.bottomLeftCorner(m, m) = -mass.solve(system.stiffness);
  A.bottomRightCorner(m, m) = -mass.solve(system.damping);
  return A;
}

double backward_error(const System<>& system, Complex value, const Eigen::VectorXcd& u) {
  const Eigen::VectorXcd residual =
      value * value * (system.mass * u) + value * (system.damping * u) + system.stiffness * u;
  const double size = std::norm(value) * system.mass.norm() +
                      std::abs(value) * system.damping.norm() + system.stiffness.norm();
  return residual.norm() / (size * u.norm());
}

template <int N>
void direct(benchmark::State& state, double damping, SpectrumOptions options) {
  const System<> source = random_system(state.range(0), damping);
  System<N> system(source.dof());
  system.mass = source.mass;
  system.damping = source.damping;
  system.stiffness = source.stiffness;
  SpectrumSolver<N> solver(options);
  Spectrum<N> spectrum;
  for (auto _ : state) {
    benchmark::DoNotOptimize(solver.solve(system, spectrum));
    benchmark::ClobberMemory();
  }
  double worst = 0, bound = 0;
  for (const Mode<N>& mode : spectrum.modes) {
    worst = std::max(worst, mode.backward_error);
    bound = std::max(bound, mode.error_bound / std::abs(mode.eigenvalues[0]));
  }
  state.counters["backward_error"] = worst;
  state.counters["relative_bound"] = bound;
  if (spectrum.status != Status::kOk) state.SkipWithError(to_text(spectrum.status));
}

void eigen(benchmark::State& state, double damping) {
  const System<> system = random_system(state.range(0), damping);
  const Eigen::MatrixXd A = state_matrix(system);
  Eigen::EigenSolver<Eigen::MatrixXd> solver(A.rows());
  for (auto _ : state) {
    solver.compute(A, true);
    benchmark::DoNotOptimize(solver.eigenvalues().data());
    benchmark::ClobberMemory();
  }
  double worst = 0;
  const Eigen::MatrixXcd vectors = solver.eigenvectors();
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    worst = std::max(
        worst, backward_error(system, solver.eigenvalues()[i], vectors.col(i).head(system.dof())));
  }
  state.counters["backward_error"] = worst;
}

/// Eigen's solver with fixed-size matrices, its fastest form.
template <int M>
void eigen_fixed(benchmark::State& state, double damping) {
  using Matrix = Eigen::Matrix<double, 2 * M, 2 * M>;
  const Matrix A = state_matrix(random_system(M, damping));
  Eigen::EigenSolver<Matrix> solver;
  for (auto _ : state) {
    solver.compute(A, true);
    benchmark::DoNotOptimize(solver.eigenvalues().data());
    benchmark::ClobberMemory();
  }
}

void lapack(benchmark::State& state, double damping) {
  const System<> system = random_system(state.range(0), damping);
  const Eigen::MatrixXd A = state_matrix(system);
  const auto n = static_cast<lapack_int>(A.rows());
  Eigen::MatrixXd copy = A, left(n, n), right(n, n);
  Eigen::VectorXd re(n), im(n), work(16 * n);
  for (auto _ : state) {
    copy = A;
    LAPACKE_dgeev_work(LAPACK_COL_MAJOR, 'V', 'V', n, copy.data(), n, re.data(), im.data(),
                       left.data(), n, right.data(), n, work.data(), 16 * n);
    benchmark::ClobberMemory();
  }
  double worst = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::VectorXcd u = right.col(i).head(system.dof()).cast<Complex>();
    if (im[i] > 0) u.imag() = right.col(i + 1).head(system.dof());
    if (im[i] < 0) continue;
    worst = std::max(worst, backward_error(system, Complex(re[i], im[i]), u));
  }
  state.counters["backward_error"] = worst;
}

void add(const std::string& name, void (*function)(benchmark::State&, double), int m,
         double damping) {
  benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& s) { function(s, damping); })
      ->Arg(m)
      ->Unit(benchmark::kMicrosecond);
}

template <int N>
void add_direct(const std::string& name, int m, double damping) {
  benchmark::RegisterBenchmark(
      name.c_str(), [=](benchmark::State& s) { direct<N>(s, damping, SpectrumOptions{}); })
      ->Arg(m)
      ->Unit(benchmark::kMicrosecond);
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  for (const auto& [suffix, damping] :
       {std::pair<std::string, double>{"", 1.0}, {"_light", 0.1}, {"_heavy", 10.0}}) {
    for (const int m : {2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 20, 40}) {
      if (!suffix.empty() && m != 6) continue;
      if (m <= kMaxDof) {
        add_direct<kMaxDof>("spectrum/direct" + suffix, m, damping);
      } else {
        add_direct<kDynamic>("spectrum/direct" + suffix, m, damping);
      }
      add("spectrum/eigen" + suffix, eigen, m, damping);
      if (m == 6) add("spectrum/eigen_fixed" + suffix, eigen_fixed<6>, m, damping);
      add("spectrum/lapack" + suffix, lapack, m, damping);
    }
  }
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
