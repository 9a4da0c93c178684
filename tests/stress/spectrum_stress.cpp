// Sweeps the conditioning of systems until the spectrum breaks, and says where and how it says so:
//     spectrum_stress [APART]
// APART: of the steps that are taken, for a coarser sweep. Every eigenvalue with a finite bound has
// to lie within it of a true one (33 digits). What cannot be proved has to be said: by an infinite
// bound, or by a status. Anything else ends with exit status 1.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/quad_spectrum.hpp>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace {

using namespace dashpot::analysis;  // NOLINT(google-build-using-namespace)
using dashpot::testing::Quad;
using dashpot::testing::QuadComplex;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kModes = 6;

MatrixXd random_matrix(unsigned seed) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  return MatrixXd::NullaryExpr(kModes, kModes, [&] { return normal(generator); });
}

void symmetrize(System<>& system) {
  for (MatrixXd* matrix : {&system.mass, &system.damping, &system.stiffness}) {
    *matrix = (0.5 * (*matrix + matrix->transpose())).eval();
  }
}

/// From 10^low to 10^high.
VectorXd powers(double low, double high) {
  return VectorXd::LinSpaced(kModes, low, high).unaryExpr([](double x) { return std::pow(10, x); });
}

/// M = L L' with rows of L scaled by `rows`, frequencies w, damping ratio zeta, coupled by a third.
System<> make(const VectorXd& rows, const VectorXd& w, double zeta, bool coupled = true) {
  const MatrixXd A = random_matrix(1), B = random_matrix(2);
  const MatrixXd V = Eigen::HouseholderQR<MatrixXd>(random_matrix(3)).householderQ();
  const MatrixXd unscaled =
      MatrixXd(A * A.transpose() / kModes + 0.1 * MatrixXd::Identity(kModes, kModes))
          .llt()
          .matrixL();
  const MatrixXd L = rows.asDiagonal() * unscaled;
  MatrixXd D = V * (2 * zeta * w).asDiagonal() * V.transpose();
  if (coupled) {
    const MatrixXd roots = V * w.cwiseSqrt().asDiagonal() * V.transpose();
    D += 0.3 * zeta * roots * B * B.transpose() * roots / kModes;
  }
  System<> system(kModes);
  system.mass = L * L.transpose();
  system.damping = L * D * L.transpose();
  system.stiffness = L * (V * w.cwiseAbs2().asDiagonal() * V.transpose()) * L.transpose();
  symmetrize(system);
  return system;
}

/// Two chains of three unit masses, joined by a spring: at zero they drift apart.
System<> two_chains(double spring) {
  System<> system(kModes);
  const auto join = [&](int i, int j, double k) {
    system.stiffness(i, i) += k;
    system.stiffness(j, j) += k;
    system.stiffness(i, j) -= k;
    system.stiffness(j, i) -= k;
  };
  for (const auto& [i, j] : {std::pair(0, 1), {1, 2}, {3, 4}, {4, 5}}) join(i, j, 1);
  join(2, 3, spring);
  system.damping = 0.125 * system.stiffness;
  return system;
}

enum class Verdict { kProved, kUnproved, kRefused, kWrong };

struct Judgement {
  Verdict verdict = Verdict::kProved;
  Status status = Status::kOk;
  int zero_modes = 0;
};

std::vector<QuadComplex> truth_of(const System<>& system, const Spectrum<>& spectrum) {
  std::vector<QuadComplex> start;
  for (const Mode<>& mode : spectrum.modes) {
    for (const Complex& value : mode.eigenvalues) start.push_back({value.real(), value.imag()});
  }
  const double size = start.empty() ? 1
                                    : std::hypot(static_cast<double>(start.back().re),
                                                 static_cast<double>(start.back().im));
  while (start.size() < 2 * kModes) {  // those of zero modes
    start.push_back({-1e-9 * size * static_cast<double>(start.size()), 1e-10 * size});
  }
  for (std::size_t i = 0; i < start.size(); ++i) {
    start[i].re *= 1 + 1e-10 * static_cast<double>(i + 1);
  }
  return dashpot::testing::refine_eigenvalues(system, start);
}

Judgement judge(const System<>& system) {
  SpectrumSolver<> solver;
  Spectrum<> spectrum;
  Judgement result;
  result.status = solver.solve(system, spectrum);
  if (result.status != Status::kOk && result.status != Status::kUncertified) {
    result.verdict = Verdict::kRefused;
    return result;
  }
  result.zero_modes = kModes - spectrum.modes.size();
  const std::vector<QuadComplex> truth = truth_of(system, spectrum);
  bool all = true;
  for (const Mode<>& mode : spectrum.modes) {
    if (!std::isfinite(mode.error_bound)) {
      all = false;
      continue;
    }
    for (const Complex& value : mode.eigenvalues) {
      Quad nearest = std::numeric_limits<double>::infinity();
      for (const QuadComplex& z : truth) {
        nearest = std::min(nearest, (z - QuadComplex{value.real(), value.imag()}).norm());
      }
      const Quad bound = mode.error_bound;
      if (!(nearest <= bound * bound)) result.verdict = Verdict::kWrong;
    }
  }
  if (!all && result.status == Status::kOk) result.verdict = Verdict::kWrong;
  if (result.status == Status::kUncertified && result.verdict == Verdict::kProved) {
    result.verdict = Verdict::kUnproved;
  }
  return result;
}

struct Sweep {
  const char* what;
  double first, last, step;  ///< of an exponent of ten
  std::function<System<>(double exponent)> make;
};

std::vector<Sweep> sweeps() {
  const VectorXd even = VectorXd::Ones(kModes), w = powers(1, 2);
  return {
      {"masses from 1 to 10^x kg, each moving alone", 0, 40, 1,
       [=](double x) {
         System<> system(kModes);
         system.mass = powers(0, x).asDiagonal();
         system.stiffness = two_chains(1).stiffness + MatrixXd::Identity(kModes, kModes);
         system.damping = 0.25 * system.stiffness;
         return system;
       }},
      {"mass matrix graded by 10^x", 0, 24, 0.5,
       [=](double x) { return make(powers(0, x / 2), w, 0.1); }},
      {"mass matrix of condition 10^x", 0, 20, 0.5,
       [=](double x) {
         System<> system = make(even, w, 0.1);
         const MatrixXd V = Eigen::HouseholderQR<MatrixXd>(random_matrix(4)).householderQ();
         system.mass = V * powers(-x, 0).asDiagonal() * V.transpose();
         symmetrize(system);
         return system;
       }},
      {"stiffness from 1e-6 to 10^(x-6) N/m", 0, 40, 0.5,
       [=](double x) { return make(even, powers(-3, x / 2 - 3), 0.1); }},
      {"all stiffness times 10^-x", 0, 320, 8,
       [=](double x) {
         System<> system = make(even, w, 0.1);
         system.stiffness *= std::pow(10, -x);
         system.damping *= std::pow(10, -x / 2);
         return system;
       }},
      {"everything times 10^-x, to denormal numbers", 0, 320, 8,
       [=](double x) {
         System<> system = make(even, w, 0.1);
         for (MatrixXd* matrix : {&system.mass, &system.damping, &system.stiffness}) {
           *matrix *= std::pow(10, -x / 2);
           *matrix *= std::pow(10, -x / 2);
         }
         return system;
       }},
      {"everything times 10^x, to overflow", 0, 308, 7,
       [=](double x) {
         System<> system = make(even, w, 0.1);
         for (MatrixXd* matrix : {&system.mass, &system.damping, &system.stiffness}) {
           *matrix *= std::pow(10, x);
         }
         return system;
       }},
      {"denormal and zero entries beside ordinary ones", 0, 23, 1,
       [=](double x) {
         System<> system = make(even, w, 0.1);
         std::mt19937_64 generator(static_cast<std::uint64_t>(x));
         for (MatrixXd* matrix : {&system.mass, &system.damping, &system.stiffness}) {
           for (int i = 0; i < kModes; ++i) {
             for (int j = 0; j < i; ++j) {
               const double factor =
                   generator() % 2 == 0 ? 0 : 5e-324 * static_cast<double>(1 + generator() % 1000);
               (*matrix)(i, j) = (*matrix)(j, i) = factor;
             }
           }
         }
         return system;
       }},
      {"two chains joined by 10^-x N/m", 0, 40, 0.5,
       [](double x) { return two_chains(std::pow(10, -x)); }},
      {"damping ratio 1 + 10^-x", 0, 17, 0.5,
       [=](double x) { return make(even, w, 1 + std::pow(10, -x), false); }},
      {"damping ratio 10^x", -2, 12, 0.5, [=](double x) { return make(even, w, std::pow(10, x)); }},
      {"frequencies that differ by 10^-x", 0, 17, 0.5, [=](double x) {
         const VectorXd near = VectorXd::LinSpaced(kModes, 10, 10 + std::pow(10, -x));
         return make(even, near, 0.1);
       }}};
}

const char* name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::kProved:
      return "proved";
    case Verdict::kUnproved:
      return "some bounds are missing, and it says so";
    case Verdict::kRefused:
      return "refused";
    case Verdict::kWrong:
      return "WRONG";
  }
  return "";
}

/// Prints where the outcome changes. Whether nothing is wrong.
bool run(const Sweep& sweep, int apart) {
  std::printf("%s\n", sweep.what);
  bool good = true;
  std::string last;
  const int steps = static_cast<int>(std::lround((sweep.last - sweep.first) / sweep.step));
  for (int i = 0; i <= steps; i += apart) {
    const double x = sweep.first + i * sweep.step;
    const Judgement found = judge(sweep.make(x));
    good &= found.verdict != Verdict::kWrong;
    std::string text = name_of(found.verdict);
    if (found.verdict != Verdict::kProved) text += std::string(" (") + to_text(found.status) + ")";
    if (found.zero_modes > 0) text += ", " + std::to_string(found.zero_modes) + " zero modes";
    if (text != last) std::printf("  from x = %-5g %s\n", x, text.c_str());
    last = text;
  }
  return good;
}

}  // namespace

int main(int argc, char** argv) {
  const int apart = argc > 1 ? std::max(1, std::atoi(argv[1])) : 1;
  bool good = true;
  for (const Sweep& sweep : sweeps()) good &= run(sweep, apart);
  std::printf(good ? "Every finite bound held, and whatever has none was said.\n"
                   : "Some bound did not hold, or was missing without a word.\n");
  return good ? 0 : 1;
}
