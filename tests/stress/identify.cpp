// Identifies the modes of simulated motions of the four arms, with what sensors add, compares them
// with the true ones, and fails where frequencies or ratios miss their 95 % intervals too often.
// A case is an arm at a random posture with springs of 8 to 40 rad/s and ratios of 0.05 to 0.9 in
// its joints, with noise of 1e-5 rad and 2 % of the samples missing.
#include <dashpot/identification/identification.hpp>
#include <dashpot/tests/stress/identify_arms.hpp>
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/support/released_springs.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <numbers>
#include <optional>
#include <vector>

namespace {

using namespace dashpot::testing;  // NOLINT(google-build-using-namespace)
using dashpot::identification::Identification;
using dashpot::identification::MeasuredMode;
using dashpot::identification::MotionRecord;
using dashpot::stress::Request;

struct Tally {
  int modes = 0, found = 0, frequency_inside = 0, ratio_inside = 0;
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
MotionRecord excited(const SprungArm& arm, int r, int inputs, Dice& draw,
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
  const Eigen::MatrixXd motion = arm.drive(shape, u, kPeriod, shares);
  const double size = 0.02 / motion.cwiseAbs().maxCoeff();
  auto record = sensed(motion * size, kPeriod, {}, draw);
  record.input.setZero(inputs, kSamples);
  record.input.row(r) = u.transpose();
  return record;
}

/// Records of one motion or of several, and of each mode the share of their energy.
struct Motions {
  std::vector<MotionRecord> records;
  std::vector<double> shares;
};

Motions chirps(const SprungArm& arm, int inputs, Dice& draw) {
  Motions result;
  result.shares.resize(arm.modes.size());
  for (int r = 0; r < inputs; ++r) {
    std::vector<double> shares;
    result.records.push_back(excited(arm, r, inputs, draw, shares));
    for (std::size_t i = 0; i < shares.size(); ++i) result.shares[i] += shares[i] / inputs;
  }
  return result;
}

/// The energy of a release is in the springs; the shares belong to the last one.
Motions releases(const SprungArm& arm, int count, const std::optional<Flaw>& flaw,
                 Eigen::VectorXd start, Dice& draw) {
  constexpr int kSamples = 1500;
  Motions result;
  for (int r = 0; r < count; ++r) {
    for (Eigen::Index i = 0; r > 0 && i < start.size(); ++i) start[i] = 0.02 * draw.normal();
    const Eigen::MatrixXd motion =
        flaw ? arm.release(*flaw, start, kSamples) : arm.release(start, kSamples, 0.001);
    result.records.push_back(sensed(motion, 0.001, {}, draw));
  }
  const auto& M = arm.system.mass;
  for (const auto& mode : arm.modes) {
    const Eigen::VectorXcd u = mode.shapes[0];
    result.shares.push_back(std::norm(u.dot(M * start)) / (start.dot(M * start)));
  }
  return result;
}

Motions shaken(const SprungArm& arm, Dice& draw) {
  return {{sensed(arm.shake(60, 60'000, 0.002, draw), 0.002, {}, draw)},
          std::vector<double>(arm.modes.size(), 1)};
}

void print(const MeasuredMode& mode, const char* what, const char* reason) {
  std::printf("  %s %9.5f +- %7.5f %8.5f +- %7.5f  stability %.2f energy %.4f %s\n", what,
              mode.natural_frequency, mode.natural_frequency_std, mode.damping_ratio,
              mode.damping_ratio_std, mode.stability, mode.energy, reason);
}

void print(long number, const SprungArm& arm, const Identification& result) {
  std::printf("case %ld: order %d, whiteness %.3f, noise %.3g\n", number, result.order,
              result.whiteness, result.noise.mean());
  for (const auto& mode : arm.modes) {
    std::printf("  true  %9.5f           %8.5f\n", mode.natural_frequency, mode.damping_ratio);
  }
  for (const auto& mode : result.modes) print(mode, "found", "");
  for (const auto& mode : result.rejected) print(mode, "not  ", mode.reason.c_str());
}

/// Modes by their damping, and how many were found that there are none of.
struct Tallies {
  Tally ordinary, heavy;
  int false_modes = 0;

  /// Matches a true mode with the nearest one found within the relative distance `farthest`.
  void compare(const SprungArm& arm, const std::vector<double>& shares,
               const Identification& result, double farthest) {
    std::vector<bool> used(result.modes.size());
    for (std::size_t number = 0; number < arm.modes.size(); ++number) {
      const auto& mode = arm.modes[number];
      std::size_t nearest = result.modes.size();
      double distance = farthest * mode.natural_frequency;
      for (std::size_t i = 0; i < result.modes.size(); ++i) {
        const double there = std::abs(result.modes[i].eigenvalues[0] - mode.eigenvalues[0]);
        if (!used[i] && there < distance) distance = there, nearest = i;
      }
      if (nearest < used.size()) used[nearest] = true;
      if (shares[number] < 0.05) continue;
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
    false_modes += static_cast<int>(std::count(used.begin(), used.end(), false));
  }
};

void print(const Tally& tally, const char* what) {
  const auto percent = [](int part, int of) { return 100.0 * part / std::max(1, of); };
  std::printf(
      "%s: %d modes, %.2f %% found; inside 95 %%: frequency %.1f %%, ratio %.1f %%; error "
      "(median, 99 %%, largest): frequency %.2g %.2g %.2g, ratio %.2g %.2g %.2g\n",
      what, tally.modes, percent(tally.found, tally.modes),
      percent(tally.frequency_inside, tally.found), percent(tally.ratio_inside, tally.found),
      quantile(tally.frequency_error, 0.5), quantile(tally.frequency_error, 0.99),
      quantile(tally.frequency_error, 1), quantile(tally.ratio_error, 0.5),
      quantile(tally.ratio_error, 0.99), quantile(tally.ratio_error, 1));
}

bool identify(const Request& request) {
  const std::string& kind = request.kind;
  if (kind == "arms") return dashpot::stress::identify_arms(request);
  const bool ambient = kind == "shaken", driven = kind.starts_with("chirp");
  std::optional<Flaw> flaw;
  if (kind == "rubbing") flaw = {.friction = 0.005, .hardening = 0};
  if (kind == "stiffening") flaw = {.friction = 0, .hardening = 0.02};
  const int records = kind == "triples" || flaw ? 3 : kind == "chirp-pairs" ? 2 : 1;
  std::printf("%ld cases, seed %lu\n", request.whole(), request.seed);
  Tallies tallies;
  const auto begin = std::chrono::steady_clock::now();
  for (long k = 0; k < request.whole(); ++k) {
    Dice draw(1'000'003 * request.seed + static_cast<std::uint64_t>(k));
    const SprungArm arm(static_cast<std::size_t>(k), draw, flaw ? 0.03 : 0.05, flaw ? 0.3 : 0.9);
    Eigen::VectorXd start(arm.system.mass.rows());
    for (double& q : start) q = 0.02 * draw.normal();
    const Motions motions = driven    ? chirps(arm, records, draw)
                            : ambient ? shaken(arm, draw)
                                      : releases(arm, records, flaw, start, draw);
    try {
      const Identification result =
          driven    ? dashpot::identification::identify_excited(motions.records)
          : ambient ? dashpot::identification::identify_ambient(motions.records)
                    : dashpot::identification::identify_decays(motions.records);
      if (request.verbose) print(k, arm, result);
      tallies.compare(arm, motions.shares, result, ambient ? 0.2 : 0.1);
    } catch (const std::exception& error) {
      std::printf("case %ld: %s\n", k, error.what());
    }
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const Tally& ordinary = tallies.ordinary;
  print(ordinary, "ratio below 0.7");
  print(tallies.heavy, "above");
  std::printf("%d spurious modes; %.2f s a case\n", tallies.false_modes, seconds / request.count);
  // In few cases, fewer may be inside by chance.
  const double least = request.count >= 20 ? 0.88 : 0.75;
  return ordinary.found > 0 && ordinary.frequency_inside >= least * ordinary.found &&
         ordinary.ratio_inside >= least * ordinary.found;
}

const dashpot::stress::AddPart part(
    {"identify",
     7,
     "Identify the modes of simulated arms, and compare them with the true ones. A case is",
     "CASES",
     {{500, 12, "releases", "a release from about 0.02 rad, 1.5 s at 1 kHz"},
      {50, 4, "triples", "three of them"},
      {60, 2, "rubbing", "three of lightly damped arms whose joints rub"},
      {60, 6, "stiffening", "three of lightly damped arms whose springs stiffen"},
      {50, 2, "shaken", "two minutes of random torques, about 0.01 rad, at 500 Hz"},
      {20, 4, "chirps", "a chirp of torques, 0.3 to 12 Hz in 10 s at 1 kHz, about 0.02 rad"},
      {36, 1, "arms", "arms in MuJoCo with what real ones have: see docs/identify.md", false},
      {20, 2, "chirp-pairs", "two of them, with torques in two directions", false}},
     identify,
     {"SEED", "--verbose"}});

}  // namespace
