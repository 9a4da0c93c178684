// Identifies the modes of simulated releases of the four arms, with what sensors add, compares them
// with the true ones, and fails where frequencies or ratios miss their 95 % intervals too often:
//     identify_stress [CASES [SEED [RELEASES]]]
// A case is an arm at a random posture with springs of 8 to 40 rad/s and ratios of 0.05 to 0.9 in
// its joints, and RELEASES (1) records of 1.5 s at 1 kHz from 0.02 rad, with noise of 1e-5 rad and
// 2 % of the samples missing. Modes with less than 5 % of the energy do not count. With 0 releases,
// random torques shake the arm by about 0.01 rad for two minutes, sampled at 500 Hz, and all modes
// count. With -1 a chirp of torques, 0.3 to 12 Hz in 10 s at 1 kHz, moves it by about 0.02 rad, and
// is measured; with -2 there are two records with torques in two directions. VERBOSE shows each.
#include <dashpot/analysis/identification.hpp>
#include <dashpot/tests/support/released_springs.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <vector>

namespace {

using namespace dashpot::testing;  // NOLINT(google-build-using-namespace)
using dashpot::analysis::Identification;
using dashpot::analysis::MeasuredMode;

struct Tally {
  int modes = 0, found = 0, frequency_inside = 0, ratio_inside = 0, false_modes = 0;
  std::vector<double> frequency_error, ratio_error;
};

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// A record of a chirp, with `inputs` inputs of which it has number `r`.
dashpot::analysis::MotionRecord excited(const SprungArm& arm, int r, int inputs, Draws& draw,
                                        std::vector<double>& shares) {
  constexpr int kSamples = 10'000;
  constexpr double kPeriod = 0.001, kFrom = 0.3, kTo = 12;  // s, Hz
  Eigen::VectorXd u(kSamples), shape(arm.system.mass.rows());
  for (int i = 0; i < kSamples; ++i) {
    const double t = i * kPeriod;
    const double cycles = t * (kFrom + (kTo - kFrom) * t / (2 * kSamples * kPeriod));
    u[i] = std::sin(2 * std::numbers::pi * cycles);
  }
  for (Eigen::Index i = 0; i < shape.size(); ++i) {
    shape[i] = arm.system.mass(i, i) * draw.normal();
  }
  Eigen::MatrixXd motion = arm.drive(shape, u, kPeriod, shares);
  const double size = 0.02 / motion.cwiseAbs().maxCoeff();
  auto record = sensed(motion * size, kPeriod, {}, draw);
  record.input.setZero(inputs, kSamples);
  record.input.row(r) = u.transpose();
  return record;
}

}  // namespace

int main(int argc, char** argv) {
  const long cases = argc > 1 ? std::atol(argv[1]) : 1000;
  const auto seed = static_cast<std::uint64_t>(argc > 2 ? std::atoll(argv[2]) : 1);
  const int releases = argc > 3 ? std::atoi(argv[3]) : 1;
  const bool verbose = std::getenv("VERBOSE") != nullptr;
  std::printf("%ld cases of %d releases, seed %llu\n", cases, releases,
              static_cast<unsigned long long>(seed));
  Tally ordinary, heavy;
  const auto begin = std::chrono::steady_clock::now();
  for (long k = 0; k < cases; ++k) {
    Draws draw(1'000'003 * seed + static_cast<std::uint64_t>(k));
    const SprungArm arm(static_cast<std::size_t>(k), draw, 0.05, 0.9);
    Eigen::VectorXd start(arm.system.mass.rows());
    for (double& q : start) q = 0.02 * draw.normal();
    std::vector<dashpot::analysis::MotionRecord> records;
    std::vector<double> shares;
    for (int r = 0; r < -releases; ++r) {
      std::vector<double> of_record;
      records.push_back(excited(arm, r, -releases, draw, of_record));
      for (std::size_t i = 0; i < of_record.size(); ++i) {
        if (r == 0) shares.push_back(0);
        shares[i] += of_record[i] / -releases;
      }
    }
    for (int r = 0; r < releases; ++r) {
      if (r > 0) {
        for (double& q : start) q = 0.02 * draw.normal();
      }
      records.push_back(sensed(arm, start, 1500, 0.001, {}, draw));
    }
    Identification result;
    if (releases == 0) {
      records.push_back(sensed(arm.shake(60, 60'000, 0.002, draw), 0.002, {}, draw));
    }
    try {
      result = releases == 0  ? dashpot::analysis::identify_ambient(records)
               : releases < 0 ? dashpot::analysis::identify_excited(records)
                              : dashpot::analysis::identify_decays(records);
    } catch (const std::exception& error) {
      std::printf("case %ld: %s\n", k, error.what());
      continue;
    }
    if (verbose) {
      std::printf("case %ld: order %d, whiteness %.3f, noise %.3g\n", k, result.order,
                  result.whiteness, result.noise.mean());
      for (const auto& mode : arm.modes) {
        std::printf("  true  %9.5f           %8.5f\n", mode.natural_frequency, mode.damping_ratio);
      }
      for (const auto& mode : result.modes) {
        std::printf("  found %9.5f +- %7.5f %8.5f +- %7.5f  stability %.2f energy %.4f\n",
                    mode.natural_frequency, mode.natural_frequency_std, mode.damping_ratio,
                    mode.damping_ratio_std, mode.stability, mode.energy);
      }
      for (const auto& mode : result.rejected) {
        std::printf("  not   %9.5f +- %7.5f %8.5f +- %7.5f  stability %.2f energy %.4f %s\n",
                    mode.natural_frequency, mode.natural_frequency_std, mode.damping_ratio,
                    mode.damping_ratio_std, mode.stability, mode.energy, mode.reason.c_str());
      }
    }
    // Of the energy of the release, which is in the springs.
    std::vector<bool> used(result.modes.size());
    for (std::size_t number = 0; number < arm.modes.size(); ++number) {
      const auto& mode = arm.modes[number];
      const auto& M = arm.system.mass;
      const Eigen::VectorXcd u = mode.shapes[0];
      const double share = releases == 0  ? 1
                           : releases < 0 ? shares[number]
                                          : std::norm(u.dot(M * start)) / (start.dot(M * start));
      std::size_t nearest = result.modes.size();
      double distance = (releases == 0 ? 0.2 : 0.1) * mode.natural_frequency;
      for (std::size_t i = 0; i < result.modes.size(); ++i) {
        const double there = std::abs(result.modes[i].eigenvalues[0] - mode.eigenvalues[0]);
        if (!used[i] && there < distance) distance = there, nearest = i;
      }
      if (nearest < used.size()) used[nearest] = true;
      if (share < 0.05) continue;
      Tally& tally = mode.damping_ratio < 0.7 ? ordinary : heavy;
      ++tally.modes;
      if (nearest == used.size()) continue;
      const MeasuredMode& found = result.modes[nearest];
      ++tally.found;
      const double dw = std::abs(found.natural_frequency - mode.natural_frequency);
      const double dz = std::abs(found.damping_ratio - mode.damping_ratio);
      tally.frequency_inside += dw <= 1.96 * found.natural_frequency_std;
      tally.ratio_inside += dz <= 1.96 * found.damping_ratio_std;
      tally.frequency_error.push_back(dw / mode.natural_frequency);
      tally.ratio_error.push_back(dz);
    }
    ordinary.false_modes += static_cast<int>(std::count(used.begin(), used.end(), false));
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  for (const Tally* tally : {&ordinary, &heavy}) {
    std::printf(
        "%s: %d modes, %.2f %% found; inside 95 %%: frequency %.1f %%, ratio %.1f %%; error "
        "(median, 99 %%, largest): frequency %.2g %.2g %.2g, ratio %.2g %.2g %.2g\n",
        tally == &ordinary ? "ratio below 0.7" : "above", tally->modes,
        100.0 * tally->found / std::max(1, tally->modes),
        100.0 * tally->frequency_inside / std::max(1, tally->found),
        100.0 * tally->ratio_inside / std::max(1, tally->found),
        quantile(tally->frequency_error, 0.5), quantile(tally->frequency_error, 0.99),
        quantile(tally->frequency_error, 1), quantile(tally->ratio_error, 0.5),
        quantile(tally->ratio_error, 0.99), quantile(tally->ratio_error, 1));
  }
  std::printf("%d modes that are none; %.2f s a case\n", ordinary.false_modes,
              seconds / static_cast<double>(std::max(1L, cases)));
  // Of few cases, fewer may be inside by chance.
  const double least = cases >= 40 ? 0.88 : 0.75;
  const bool good = ordinary.found > 0 && ordinary.frequency_inside >= least * ordinary.found &&
                    ordinary.ratio_inside >= least * ordinary.found;
  return good ? 0 : 1;
}
