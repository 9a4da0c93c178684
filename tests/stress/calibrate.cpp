// Calibrates arms that MuJoCo moves, from records of ordinary motion of 30 s, and compares what is
// found with the truth, and with ordinary least squares.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/apps/check_model/calibrated_modes.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/identification/check_model.hpp>
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/support/least_squares_arm.hpp>
#include <dashpot/tests/support/moved_arm.hpp>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <vector>

namespace {

using namespace dashpot::testing;     // NOLINT(google-build-using-namespace)
using namespace dashpot::controller;  // NOLINT(google-build-using-namespace)
using dashpot::stress::Request;
using Eigen::Index;

constexpr double kKnownWithin = 0.1;  // of a rotor that is called determined
constexpr double kNominal = 0.95;     // share of truths within 95 % intervals
constexpr double kLeastHeld = 0.9, kMostHeld = 0.98;
constexpr int kFew = 40;  // of one record or two, whose errors belong together
constexpr double kAllRecords = 60;

/// A row of the table.
struct Row {
  const char* what;
  double records;  ///< of kAllRecords
  double speed = 1;
  double noise = 0;    ///< of torques, N m; 0: 0.01 to 0.2
  double payload = 0;  ///< kg
  double late = 0;     ///< s by which torques are measured late
  double tilt = 0;     ///< of the base, rad
  double heavier = 0;  ///< share that a link has beyond its description
};

constexpr std::array kRows = {
    Row{.what = "ordinary motion", .records = 60},
    Row{.what = "a third as fast", .records = 24, .speed = 0.33},
    Row{.what = "a third as fast, noise of 1 N m", .records = 24, .speed = 0.33, .noise = 1},
    Row{.what = "payload of 1 kg", .records = 24, .payload = 1},
    Row{.what = "torques 6 ms late", .records = 16, .late = 0.006},
    Row{.what = "torques 40 ms late", .records = 16, .late = 0.04},
    Row{.what = "base tilted by 5 deg", .records = 24, .tilt = 0.0873},
    Row{.what = "base tilted by 40 deg", .records = 16, .tilt = 0.7},
    Row{.what = "on the ceiling, 3 deg off", .records = 16, .tilt = 3.0892},
    Row{.what = "a link a quarter heavier", .records = 24, .heavier = 0.25},
    Row{.what = "a third as fast, torques as commanded",
        .records = 12,
        .speed = 0.33,
        .noise = 1e-6},
};

/// Counts estimates within their 95 % intervals.
struct Held {
  int inside = 0, all = 0;

  void add(const dashpot::identification::Estimate& one, double truth) {
    if (!std::isfinite(one.deviation)) return;
    ++all;
    inside += std::abs(one.value - truth) <= 1.96 * one.deviation ? 1 : 0;
  }
  /// Whether the share is 90 to 98 %, but for two standard deviations of chance.
  bool good() const {
    const double chance = 2 * std::sqrt(kNominal * (1 - kNominal) * all);
    return all < kFew ||
           (inside >= kLeastHeld * all - chance && inside <= kMostHeld * all + chance);
  }
};

struct Tally {
  Held rotors, friction, offsets, payload, delay, plain;
  int joints = 0, determined = 0, within = 0, plain_within = 0;
  int tilted = 0, linked = 0, either = 0, suspected = 0;
  Held frequencies, ratios;
  int modes = 0, modes_known = 0, modes_within = 0;
  double worst = 0, worst_mode = 0, worst_delay = 0, worst_tilt = 0, time = 0, plain_time = 0;
};

double processor_seconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

void add(const MovedArm& arm, const dashpot::identification::ModelCheck& check, Tally& tally) {
  for (Index j = 0; j < arm.n; ++j) {
    const dashpot::identification::JointCheck& joint = check.joints[static_cast<std::size_t>(j)];
    ++tally.joints;
    tally.rotors.add(joint.reflected_inertia, arm.rotors[j]);
    tally.friction.add(joint.coulomb_friction, arm.coulomb[j]);
    tally.friction.add(joint.viscous_friction, arm.viscous[j]);
    tally.offsets.add(joint.offset, arm.offset[j]);
    if (joint.reflected_inertia.determined) {
      const double error = std::abs(joint.reflected_inertia.value / arm.rotors[j] - 1);
      ++tally.determined;
      tally.within += error <= kKnownWithin ? 1 : 0;
      tally.worst = std::max(tally.worst, error);
    }
    tally.linked += joint.suspicious.find("the mass of link") != std::string::npos ? 1 : 0;
    const bool other = joint.suspicious.find("reflected inertia") == std::string::npos &&
                       joint.suspicious.find("the mass of link") == std::string::npos;
    tally.suspected += !joint.suspicious.empty() && other ? 1 : 0;
  }
  tally.payload.add(check.payload.mass, arm.payload.mass);
  tally.delay.add(check.delay, arm.delay_in_record());
  if (check.delay.determined) {
    tally.worst_delay =
        std::max(tally.worst_delay, std::abs(check.delay.value - arm.delay_in_record()));
  }
  for (const std::string& one : check.ambiguities) {
    tally.either += one.starts_with("link or payload") ? 1 : 0;
  }
  const Eigen::Vector3d gravity = check.gravity.value_or(arm.description.options.gravity);
  tally.tilted += check.gravity ? 1 : 0;
  tally.worst_tilt =
      std::max(tally.worst_tilt, Eigen::Quaterniond::FromTwoVectors(gravity, arm.gravity)
                                     .angularDistance(Eigen::Quaterniond::Identity()));
}

JointVector middle(const Config& config) {
  JointVector q(config.model.dof());
  for (Index j = 0; j < q.size(); ++j) {
    const Joint& joint = config.model.joints()[static_cast<std::size_t>(j)];
    q[j] = 0.5 * (std::max(joint.lower, -2.5) + std::min(joint.upper, 2.5)) + 0.3;
  }
  return q;
}

/// Springs in the joints of 15 to 60 rad/s and dampers for ratios of 0.4 to 1 of joints that do not
/// move each other, in a loop that knows the arm as its description has it.
Config loop_of(const MovedArm& arm, Dice& dice) {
  Config config{arm.description, arm.description.model(), {}};
  config.settings = default_settings(config.model);
  config.settings.initial.mode = Mode::kJoint;
  Gains& gains = config.settings.initial.gains;
  gains.joint_damping_ratio = 0;
  DynamicsResult at;
  DynamicsKernel(config.model).evaluate(middle(config), 0 * middle(config), at);
  for (Index j = 0; j < arm.n; ++j) {
    const double inertia = at.M(j, j) + arm.rotors[j], omega = dice.log_uniform(15, 60);
    gains.joint_stiffness(j, j) = inertia * omega * omega;
    gains.joint_damping(j, j) = 2 * dice.uniform(0.4, 1) * inertia * omega;
  }
  return config;
}

/// Compares the modes of the calibrated loop with the modes of the true arm's.
void add_modes(const MovedArm& arm, const dashpot::identification::ModelCheck& check, Dice& dice,
               Tally& tally) {
  const Config config = loop_of(arm, dice);
  RobotDescription robot = arm.description;
  robot.options.reflected_inertia = arm.rotors;
  robot.options.viscous_friction = arm.viscous;
  robot.options.payload = {arm.payload.mass, arm.payload.center, arm.payload.about_center};
  robot.options.gravity = arm.gravity;
  Settings settings = config.settings;
  settings.analysis.sampled.delay = arm.delay;
  PostureLoop posture_loop(robot.model(), settings);
  const LoopAt at = posture_loop.at(middle(config), settings.initial.gains, Mode::kJoint);
  const auto truth = sample_loop(at.system, dashpot::analysis::analyze(at.system), at.sampled);
  const dashpot::apps::CalibratedLoop found =
      dashpot::apps::calibrated_loop(config, check, middle(config));
  constexpr double kLeastRatio = 0.4, kMostRatio = 1, kNear = 0.05;
  for (const auto& mode : truth.modes) {
    if (!(mode.damping_ratio >= kLeastRatio && mode.damping_ratio <= kMostRatio)) continue;
    const auto far = [&mode](const dashpot::apps::CalibratedMode& one) {
      return std::max(std::abs(one.natural_frequency / mode.natural_frequency - 1),
                      std::abs(one.damping_ratio / mode.damping_ratio - 1));
    };
    const auto near =
        *std::min_element(found.modes.begin(), found.modes.end(),
                          [&far](const auto& a, const auto& b) { return far(a) < far(b); });
    ++tally.modes;
    if (1.96 * near.natural_frequency_std < kNear * near.natural_frequency &&
        1.96 * near.damping_ratio_std < kNear * near.damping_ratio) {
      ++tally.modes_known;
      tally.modes_within += far(near) <= kNear ? 1 : 0;
      tally.worst_mode = std::max(tally.worst_mode, far(near));
    }
    tally.frequencies.add({near.natural_frequency, near.natural_frequency_std, true},
                          mode.natural_frequency);
    tally.ratios.add({near.damping_ratio, near.damping_ratio_std, true}, mode.damping_ratio);
  }
}

void print(const std::string& what, int records, const Tally& tally) {
  const auto held = [](const Held& one) {
    return std::to_string(one.inside) + " of " + std::to_string(one.all);
  };
  constexpr double kDegree = 57.29577951308232;
  std::printf(
      "| %s | %d | %d of %d, %d, %.1f %% | %s | %s | %s | %s | %s, %.2f ms | %d, %.2f deg | "
      "%d of %d, %d, %.1f %% | %s, %s | %d, %d, %d | %.2f s | %d of %d, %s, %.2f s |\n",
      what.c_str(), records, tally.determined, tally.joints, tally.within, 100 * tally.worst,
      held(tally.rotors).c_str(), held(tally.friction).c_str(), held(tally.offsets).c_str(),
      held(tally.payload).c_str(), held(tally.delay).c_str(), 1e3 * tally.worst_delay, tally.tilted,
      kDegree * tally.worst_tilt, tally.modes_known, tally.modes, tally.modes_within,
      100 * tally.worst_mode, held(tally.frequencies).c_str(), held(tally.ratios).c_str(),
      tally.linked, tally.either, tally.suspected, tally.time / records, tally.plain_within,
      tally.joints, held(tally.plain).c_str(), tally.plain_time / records);
  std::fflush(stdout);
}

bool calibrate(const Request& request) {
  if (!MujocoArm::available()) {
    std::printf("skipped: this build has no MuJoCo\n");
    return true;
  }
  std::printf(
      "seed %lu\n| records | | rotors determined, within 10 %%, worst | inside 95 %%: rotors | "
      "friction | offsets | payload | delay, worst of those determined | gravity: told, worst | "
      "modes of ratio 0.4 to 1 known to 5 %%, within 5 %%, worst | inside 95 %%: frequencies, "
      "ratios | link named, link or payload, "
      "other suspicions | time | least squares: rotors within 10 %%, "
      "inside, time |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
      request.seed);
  const std::vector<dashpot::testing::Arm> arms = all_arms();
  bool good = true;
  for (std::size_t r = 0; r < kRows.size(); ++r) {
    const Row& row = kRows[r];
    const int records =
        std::max(1, static_cast<int>(std::lround(request.count * row.records / kAllRecords)));
    Tally tally;
    for (int k = 0; k < records; ++k) {
      Dice dice(1'000'003 * request.seed + 1000 * r + static_cast<std::uint64_t>(k));
      MovedArm arm(arms[static_cast<std::size_t>(k) % arms.size()], dice);
      arm.speed = row.speed;
      if (row.noise > 0) arm.torque_noise = row.noise;
      arm.recorded_late = row.late;
      arm.payload = {row.payload,
                     {0.03 * dice.normal(), 0.03 * dice.normal(), 0.06},
                     0.002 * row.payload * Eigen::Matrix3d::Identity()};
      const double heading = dice.uniform(0, 6.28);
      arm.gravity =
          Eigen::AngleAxisd(row.tilt, Eigen::Vector3d(std::cos(heading), std::sin(heading), 0)) *
          arm.gravity;
      if (row.heavier > 0) arm.make_heavier(arm.n - 3, row.heavier);
      const dashpot::identification::TorqueRecord record = arm.record(dice);
      double begin = processor_seconds();
      const dashpot::identification::ModelCheck check =
          dashpot::identification::check_model(arm.description, {record}, {0.2, false});
      tally.time += processor_seconds() - begin;
      add(arm, check, tally);
      if (row.late == 0 && row.heavier == 0) add_modes(arm, check, dice, tally);
      begin = processor_seconds();
      const std::vector<dashpot::identification::Estimate> plain =
          rotors_by_least_squares(arm.description, record);
      tally.plain_time += processor_seconds() - begin;
      for (Index j = 0; j < arm.n; ++j) {
        const dashpot::identification::Estimate& one = plain[static_cast<std::size_t>(j)];
        tally.plain.add(one, arm.rotors[j]);
        tally.plain_within += std::abs(one.value / arm.rotors[j] - 1) <= kKnownWithin ? 1 : 0;
      }
      if (request.verbose) print(std::string(row.what) + ", " + record_name(arm), k + 1, tally);
    }
    print(row.what, records, tally);
    good = good && tally.within >= 0.98 * tally.determined && tally.rotors.good() &&
           tally.friction.good() && tally.offsets.good() && tally.frequencies.good() &&
           tally.ratios.good() &&
           (tally.modes_known < kFew || tally.modes_within >= kLeastHeld * tally.modes_known);
  }
  return good;
}

const dashpot::stress::AddPart part(
    {"calibrate",
     8,
     "Calibrate arms that MuJoCo moves, and compare with the truth and with least squares. A case "
     "is a record of ordinary motion; other rows have fewer",
     "CASES",
     {{kAllRecords, 3}},
     calibrate,
     {"SEED", "--verbose"}});

}  // namespace
