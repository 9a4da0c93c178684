// Sweeps the conditioning of systems until the spectrum, solved or tracked from a system nearby,
// breaks, and says where and how it says so. Every eigenvalue with a finite bound has
// to lie within it of one that FLINT/Arb proves. What cannot be proved has to be said: by an
// infinite bound, or by a status.
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/support/enclosure.hpp>
#include <dashpot/tests/support/proved_eigenvalues.hpp>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

namespace {

using namespace dashpot::analysis;  // NOLINT(google-build-using-namespace)
using dashpot::testing::LongComplex;
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

/// Modes of any kind, from `begin` to `end`.
template <typename Iterator>
Verdict judge_modes(Iterator begin, Iterator end, Status status,
                    const std::vector<LongComplex>& truth) {
  bool all = true;
  std::vector<LongComplex> values;
  std::vector<long double> bounds;
  for (Iterator mode = begin; mode != end; ++mode) {
    all = all && std::isfinite(mode->error_bound);
    if (!std::isfinite(mode->error_bound)) continue;
    values.insert(values.end(), mode->eigenvalues.begin(), mode->eigenvalues.end());
    bounds.resize(values.size(), static_cast<long double>(mode->error_bound));
  }
  const bool enclosed = dashpot::testing::Matching(values, truth, bounds).complete();
  if (!enclosed || (!all && status == Status::kOk)) return Verdict::kWrong;
  return status == Status::kUncertified ? Verdict::kUnproved : Verdict::kProved;
}

bool is_refusal(Status status) {
  return status != Status::kOk && status != Status::kUncertified;
}

/// The solver's results for a system, and the tracker's, which comes from a system nearby.
struct Judgements {
  Judgement direct, tracked;
};

Judgements judge(const System<>& system, dashpot::analysis::ModeTracker& tracker) {
  Judgements result;
  Spectrum<> spectrum;
  result.direct.status = SpectrumSolver<>().solve(system, spectrum);
  if (is_refusal(result.direct.status)) {
    result.direct.verdict = Verdict::kRefused;
    result.tracked = result.direct;
    return result;
  }
  result.direct.zero_modes = kModes - spectrum.modes.size();
  const auto truth = dashpot::testing::proved_eigenvalues(system);
  result.direct.verdict =
      judge_modes(spectrum.modes.begin(), spectrum.modes.end(), result.direct.status, truth);

  System<kMaxDof> here(kModes);
  here.mass = system.mass;
  here.damping = system.damping;
  here.stiffness = (1 + 1e-7) * system.stiffness;
  const auto tracked = std::make_unique<TrackedSpectrum>();
  tracker.reset();
  tracker.update(here, *tracked);
  here.stiffness = system.stiffness;
  result.tracked.status = tracker.update(here, *tracked);
  result.tracked.zero_modes = tracked->zero_mode_count;
  result.tracked.verdict =
      is_refusal(result.tracked.status)
          ? Verdict::kRefused
          : judge_modes(tracked->modes.begin(), tracked->modes.begin() + tracked->mode_count,
                        result.tracked.status, truth);
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

std::string text_of(const Judgement& found) {
  std::string text = name_of(found.verdict);
  if (found.verdict != Verdict::kProved) text += std::string(" (") + to_text(found.status) + ")";
  if (found.zero_modes > 0) text += ", " + std::to_string(found.zero_modes) + " zero modes";
  return text;
}

/// Prints where the outcome changes. Whether nothing is wrong.
bool walk(const Sweep& sweep, int apart) {
  std::printf("%s\n", sweep.what);
  bool good = true;
  std::string last, last_tracked;
  const auto tracker = std::make_unique<dashpot::analysis::ModeTracker>();
  const int steps = static_cast<int>(std::lround((sweep.last - sweep.first) / sweep.step));
  for (int i = 0; i <= steps; i += apart) {
    const double x = sweep.first + i * sweep.step;
    const Judgements found = judge(sweep.make(x), *tracker);
    good &= found.direct.verdict != Verdict::kWrong && found.tracked.verdict != Verdict::kWrong;
    const std::string text = text_of(found.direct), tracked = text_of(found.tracked);
    if (text != last) std::printf("  from x = %-5g %s\n", x, text.c_str());
    if (tracked != last_tracked && tracked != text) {
      std::printf("  from x = %-5g tracked: %s\n", x, tracked.c_str());
    }
    last = text;
    last_tracked = tracked;
  }
  return good;
}

bool sweep_all(const dashpot::stress::Request& request) {
  const int apart = std::max(1, static_cast<int>(request.count));
  bool good = true;
  for (const Sweep& sweep : sweeps()) good &= walk(sweep, apart);
  std::printf(good ? "Every finite bound held, and whatever has none was said.\n"
                   : "Some bound did not hold, or was missing without a word.\n");
  return good;
}

const dashpot::stress::AddPart part({"spectrum",
                                     4,
                                     "Sweep the conditioning of systems until their spectrum "
                                     "breaks, taking each APARTth step",
                                     "APART",
                                     {{1, 5}},
                                     sweep_all});

}  // namespace
