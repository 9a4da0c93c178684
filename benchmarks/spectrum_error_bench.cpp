// Run time against error of spectra: spectrum_error/DAMPING_SCALING/METHOD/m for m modes. `error`
// is the largest relative error of an eigenvalue against the proved ones of FLINT/Arb, `bound` our
// proved bound of it.
//   ours_direct, ours_tracked (from a system that differs by 1e-4), ours_values (the same without
//     shapes), ours_reused (the same system again): {M, C, K} to modes, with proved bounds
//   ours_working, ours_extended: directly, with residuals in working precision or in twice that
//   ours_moved_1e-K: tracked from a system that differs by 1e-K, with `mean_iterations`
//   eigen, eigen_values, dgeev (both sides), dgeev_values, dggev, dggev3: from the 2m x 2m
//     matrices, which are formed outside the clock
//   quadeig: from {M, C, K}, scaled and deflated, with right vectors
//   arb_BITS: from {M, C, K} to eigenvalues that FLINT/Arb proves with this precision
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/benchmarks/quadeig.hpp>
#include <dashpot/tests/support/proved_eigenvalues.hpp>

#include <benchmark/benchmark.h>
#include <lapacke.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <memory>
#include <random>
#include <string>

namespace {

using namespace dashpot::analysis;  // NOLINT(google-build-using-namespace)
using dashpot::testing::LongComplex;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Values = std::vector<std::complex<double>>;

constexpr unsigned kSeed = 20210007;

struct Family {
  std::string name;
  double damping_ratio;
  bool coupled;  ///< by damping, so that modes are complex
  bool badly_scaled;
};

/// M = L L', K = L V diag(w^2) V' L', C = L (V diag(2 zeta w) V' + coupling) L'; badly scaled: L of
/// rows from 1e-3 to 1e3, w from 0.1 to 1e4 rad/s instead of 10 to 100.
System<> make_system(const Family& family, int m) {
  std::mt19937_64 generator(kSeed + static_cast<unsigned>(m));
  std::normal_distribution<double> normal;
  const auto random = [&] {
    return MatrixXd(MatrixXd::NullaryExpr(m, m, [&] { return normal(generator); }));
  };
  const MatrixXd A = random();
  MatrixXd L =
      MatrixXd(MatrixXd(A * A.transpose() / m + 0.1 * MatrixXd::Identity(m, m)).llt().matrixL());
  const MatrixXd V = Eigen::HouseholderQR<MatrixXd>(random()).householderQ();
  const MatrixXd B = random();
  VectorXd w(m);
  for (int i = 0; i < m; ++i) {
    const double part = m > 1 ? static_cast<double>(i) / (m - 1) : 0;
    w[i] = family.badly_scaled ? std::pow(10, -1 + 5 * part) : std::pow(10, 1 + part);
    if (family.badly_scaled) L.row(i) *= std::pow(10, 3 - 6 * part);
  }
  MatrixXd D = V * (2 * family.damping_ratio * w).asDiagonal() * V.transpose();
  if (family.coupled) {
    const MatrixXd roots = V * w.cwiseSqrt().asDiagonal() * V.transpose();
    D += 0.3 * family.damping_ratio * roots * B * B.transpose() * roots / m;
  }
  System<> system(m);
  system.mass = L * L.transpose();
  system.damping = L * D * L.transpose();
  system.stiffness = L * (V * w.cwiseAbs2().asDiagonal() * V.transpose()) * L.transpose();
  for (MatrixXd* matrix : {&system.mass, &system.damping, &system.stiffness}) {
    *matrix = (0.5 * (*matrix + matrix->transpose())).eval();
  }
  return system;
}

/// [0 I; -M^-1 K  -M^-1 C]
MatrixXd state_matrix(const System<>& system) {
  const Eigen::Index m = system.dof();
  const Eigen::LLT<MatrixXd> mass(system.mass);
  MatrixXd A = MatrixXd::Zero(2 * m, 2 * m);
  A.topRightCorner(m, m).setIdentity();
  A.bottomLeftCorner(m, m) = -mass.solve(system.stiffness);
  A.bottomRightCorner(m, m) = -mass.solve(system.damping);
  return A;
}

/// A system, and its eigenvalues.
struct Problem {
  System<> system;
  std::vector<LongComplex> truth;
};

/// Counts the largest relative error, each value matched with the nearest remaining true one.
void report(benchmark::State& state, const Problem& problem, const Values& found) {
  std::vector<LongComplex> left = problem.truth;
  double largest = found.size() == left.size() ? 0 : 1;
  for (const std::complex<double>& value : found) {
    if (left.empty()) break;
    const auto nearest = dashpot::testing::nearest_to(value, left);
    const auto error = std::abs(*nearest - LongComplex(value)) / std::abs(*nearest);
    largest = std::max(largest, static_cast<double>(error));
    left.erase(nearest);
  }
  state.counters["error"] = largest;
}

template <int N>
void direct(benchmark::State& state, const Problem& problem, SpectrumOptions::Residual residual) {
  System<N> system(problem.system.dof());
  system.mass = problem.system.mass;
  system.damping = problem.system.damping;
  system.stiffness = problem.system.stiffness;
  SpectrumOptions options;
  options.residual = residual;
  SpectrumSolver<N> solver(options);
  Spectrum<N> spectrum;
  for (auto _ : state) {
    benchmark::DoNotOptimize(solver.solve(system, spectrum));
    benchmark::ClobberMemory();
  }
  Values found;
  double bound = 0;
  for (const Mode<N>& mode : spectrum.modes) {
    found.insert(found.end(), mode.eigenvalues.begin(), mode.eigenvalues.end());
    bound = std::max(bound, mode.error_bound / std::abs(mode.eigenvalues[1]));
  }
  report(state, problem, found);
  state.counters["bound"] = bound;
}

/// There and back by a relative `change`.
void track(benchmark::State& state, const Problem& problem, bool shapes, double change) {
  System<kMaxDof> system(problem.system.dof());
  system.mass = problem.system.mass;
  system.damping = problem.system.damping;
  system.stiffness = problem.system.stiffness;
  System<kMaxDof> other = system;
  other.stiffness *= 1 + change;
  other.mass *= 1 - change;
  TrackerOptions options;
  options.shapes = shapes;
  const auto tracker = std::make_unique<ModeTracker>(options);
  const auto spectrum = std::make_unique<TrackedSpectrum>();
  tracker->update(system, *spectrum);
  long runs = 0;
  const TrackerCounters before = tracker->counters();
  for (auto _ : state) {
    ++runs;
    benchmark::DoNotOptimize(tracker->update(runs % 2 == 0 ? system : other, *spectrum));
    benchmark::ClobberMemory();
  }
  const TrackerCounters& after = tracker->counters();
  state.counters["direct_share"] =
      static_cast<double>(after.direct - before.direct) / static_cast<double>(runs);
  state.counters["mean_iterations"] =
      static_cast<double>(after.iterations - before.iterations) / static_cast<double>(runs);
  if (runs % 2 != 0) tracker->update(system, *spectrum);
  Values found;
  double bound = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(spectrum->mode_count); ++i) {
    const ModeNumbers& mode = spectrum->modes[i];
    found.insert(found.end(), mode.eigenvalues.begin(), mode.eigenvalues.end());
    bound = std::max(bound, mode.error_bound / std::abs(mode.eigenvalues[1]));
  }
  report(state, problem, found);
  state.counters["bound"] = bound;
}

void eigen(benchmark::State& state, const Problem& problem, bool vectors) {
  const MatrixXd A = state_matrix(problem.system);
  Eigen::EigenSolver<MatrixXd> solver(A.rows());
  for (auto _ : state) {
    solver.compute(A, vectors);
    benchmark::DoNotOptimize(solver.eigenvalues().data());
    benchmark::ClobberMemory();
  }
  const Eigen::VectorXcd values = solver.eigenvalues();
  report(state, problem, Values(values.begin(), values.end()));
}

Values values_of(const VectorXd& re, const VectorXd& im, const VectorXd& divisor) {
  Values values;
  for (Eigen::Index i = 0; i < re.size(); ++i) {
    values.emplace_back(re[i] / divisor[i], im[i] / divisor[i]);
  }
  return values;
}

void dgeev(benchmark::State& state, const Problem& problem, bool vectors) {
  const MatrixXd A = state_matrix(problem.system);
  const auto n = static_cast<lapack_int>(A.rows());
  MatrixXd copy = A, left(n, n), right(n, n);
  VectorXd re(n), im(n), work(16 * n);
  const char job = vectors ? 'V' : 'N';
  for (auto _ : state) {
    copy = A;
    LAPACKE_dgeev_work(LAPACK_COL_MAJOR, job, job, n, copy.data(), n, re.data(), im.data(),
                       left.data(), n, right.data(), n, work.data(), 16 * n);
    benchmark::ClobberMemory();
  }
  report(state, problem, values_of(re, im, VectorXd::Ones(n)));
}

/// [0 I; -K -C] x = l [I 0; 0 M] x
void dggev(benchmark::State& state, const Problem& problem, bool blocked) {
  const System<>& system = problem.system;
  const Eigen::Index m = system.dof();
  MatrixXd A = MatrixXd::Zero(2 * m, 2 * m), B = MatrixXd::Identity(2 * m, 2 * m);
  A.topRightCorner(m, m).setIdentity();
  A.bottomLeftCorner(m, m) = -system.stiffness;
  A.bottomRightCorner(m, m) = -system.damping;
  B.bottomRightCorner(m, m) = system.mass;
  const auto n = static_cast<lapack_int>(2 * m);
  MatrixXd a = A, b = B, left(n, n), right(n, n);
  VectorXd re(n), im(n), beta(n), work = dashpot::bench::qz_work_space(n);
  const auto size = static_cast<lapack_int>(work.size());
  const auto solve = blocked ? LAPACKE_dggev3_work : LAPACKE_dggev_work;
  for (auto _ : state) {
    a = A;
    b = B;
    solve(LAPACK_COL_MAJOR, 'V', 'V', n, a.data(), n, b.data(), n, re.data(), im.data(),
          beta.data(), left.data(), n, right.data(), n, work.data(), size);
    benchmark::ClobberMemory();
  }
  report(state, problem, values_of(re, im, beta));
}

void quadeig(benchmark::State& state, const Problem& problem) {
  dashpot::bench::Quadeig solver(problem.system.dof());
  Values values;
  for (auto _ : state) {
    values = solver.solve(problem.system);
    benchmark::ClobberMemory();
  }
  report(state, problem, values);
}

#ifdef DASHPOT_HAVE_ARB
void arb(benchmark::State& state, const Problem& problem, int bits) {
  dashpot::testing::CertifiedEigenvalues found;
  for (auto _ : state) {
    found = dashpot::testing::certify_eigenvalues(problem.system, bits);
    benchmark::ClobberMemory();
  }
  if (found.bits == 0) return state.SkipWithError("nothing is proved with so few bits");
  Values values;
  double bound = 0;
  for (std::size_t i = 0; i < found.center.size(); ++i) {
    values.emplace_back(found.center[i]);
    bound = std::max(bound, static_cast<double>(found.radius[i]) / std::abs(values.back()));
  }
  report(state, problem, values);
  state.counters["bound"] = bound;
}
#endif

void add_problem(const Family& family, int m) {
  // Made by the first benchmark that runs.
  const auto problem = std::make_shared<Problem>();
  const auto add = [&](const std::string& method, auto function) {
    const std::string name =
        "spectrum_error/" + family.name + "/" + method + "/" + std::to_string(m);
    benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) {
      if (problem->truth.empty()) {
        problem->system = make_system(family, m);
        problem->truth = dashpot::testing::proved_eigenvalues(problem->system);
      }
      function(state, *problem);
    })->Unit(benchmark::kMicrosecond);
  };
  using Residual = SpectrumOptions::Residual;
  const auto add_direct = [&](const std::string& method, Residual residual) {
    add(method, [=](auto& state, const Problem& p) {
      m <= kMaxDof ? direct<kMaxDof>(state, p, residual) : direct<kDynamic>(state, p, residual);
    });
  };
  const auto add_tracked = [&](const std::string& method, bool shapes, double change) {
    add(method, [=](auto& state, const Problem& p) { track(state, p, shapes, change); });
  };
  add_direct("ours_direct", Residual::kAutomatic);
  if (m <= kMaxDof) {
    add_tracked("ours_tracked", true, 1e-4);
    add_tracked("ours_values", false, 1e-4);
    add_tracked("ours_reused", true, 0);
  }
  if (m == 6) {
    add_direct("ours_working", Residual::kWorking);
    add_direct("ours_extended", Residual::kExtended);
    for (const int digits : {1, 2, 3, 5, 7, 9, 11}) {
      add_tracked("ours_moved_1e-" + std::to_string(digits), true, std::pow(10, -digits));
    }
  }
  add("eigen", [](auto& state, const Problem& p) { eigen(state, p, true); });
  add("eigen_values", [](auto& state, const Problem& p) { eigen(state, p, false); });
  add("dgeev", [](auto& state, const Problem& p) { dgeev(state, p, true); });
  add("dgeev_values", [](auto& state, const Problem& p) { dgeev(state, p, false); });
  add("dggev", [](auto& state, const Problem& p) { dggev(state, p, false); });
  add("dggev3", [](auto& state, const Problem& p) { dggev(state, p, true); });
  add("quadeig", quadeig);
#ifdef DASHPOT_HAVE_ARB
  for (const int bits : {64, 128}) {
    if (m > 10) continue;  // 10 modes take 10 ms
    add("arb_" + std::to_string(bits), [=](auto& state, const Problem& p) { arb(state, p, bits); });
  }
#endif
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  const auto context = [](const char* what, std::initializer_list<int> version) {
    std::string text;
    for (const int part : version) text += (text.empty() ? "" : ".") + std::to_string(part);
    benchmark::AddCustomContext(what, text);
  };
  lapack_int major = 0, minor = 0, patch = 0;
  LAPACKE_ilaver(&major, &minor, &patch);
  context("LAPACK", {major, minor, patch});
  context("Eigen", {EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION});
#ifdef DASHPOT_HAVE_ARB
  benchmark::AddCustomContext("Arb", ARB_VERSION);
#endif
  for (const bool badly_scaled : {false, true}) {
    for (const auto& [name, ratio] :
         {std::pair<std::string, double>{"light", 0.05}, {"critical", 1}, {"heavy", 20}}) {
      const Family family = {name + (badly_scaled ? "_badly" : "_well"), ratio, ratio != 1,
                             badly_scaled};
      for (const int m : {2, 3, 4, 6, 8, 10, 12, 16, 20}) add_problem(family, m);
    }
  }
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
