#include <dashpot/apps/identify/identify.hpp>
#include <dashpot/apps/identify/loop_prediction.hpp>
#include <dashpot/controller/input_error.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string_view>

namespace dashpot::apps {
namespace {

/// Rest positions that are closer belong to one posture, rad or m.
constexpr double kSamePosture = 0.02;
/// A linear model is believed if it explains this share of a large motion.
constexpr double kExplains = 0.999;
constexpr double kFades = 0.5;  // and if some mode decays by exp(-kFades)

constexpr const char* kNotLinear =
    "most of the motion is not explained by modes, as if joints rub, reach a limit or touch "
    "something: larger pushes or a measured excitation (--inputs) show more, and dashpot calibrate "
    "finds rotors and friction from torques, and the modes that follow";
constexpr const char* kNoneBelieved =
    "none of those found is believed: more pushes, in other directions, or a longer record; where "
    "friction or damping hides modes, dashpot calibrate finds rotors and friction from torques, "
    "and the modes that follow";

/// True if at most as many modes are rejected as not linear as are believed.
bool is_linear(const identification::Identification& found) {
  const auto doubted = std::count_if(found.rejected.begin(), found.rejected.end(),
                                     [](const auto& mode) { return mode.not_linear; });
  return static_cast<std::size_t>(doubted) <= found.modes.size();
}

/// Returns the message without the name of the call in front.
std::string reason_of(const std::invalid_argument& error) {
  constexpr std::string_view kCall = "identify: ";
  std::string text = error.what();
  if (text.starts_with(kCall)) text.erase(0, kCall.size());
  return text;
}

class Task {
 public:
  explicit Task(const IdentifyCommand& command) : command_(command) {}

  IdentifyReport run() {
    for (const auto& [option, time] :
         {std::pair("--from", command_.from), std::pair("--to", command_.to)}) {
      if (time && !std::isfinite(*time)) throw InputError(option, "has to be a finite time, s");
    }
    if (command_.from && command_.to && *command_.from >= *command_.to) {
      throw InputError("--from", "has to be before --to");
    }
    for (const std::string& file : command_.files) {
      try {
        read_parts(file, command_, report_, parts_);
      } catch (const std::invalid_argument& error) {
        throw InputError(file, reason_of(error));
      }
    }
    identify();
    if (!command_.against.empty()) compare();
    return std::move(report_);
  }

 private:
  /// Parts by posture, most of them first.
  std::vector<std::vector<std::size_t>> by_posture() const {
    std::vector<std::vector<std::size_t>> groups;
    const bool positions =
        report_.channels.front().unit == "rad" || report_.channels.front().unit == "m";
    for (std::size_t i = 0; i < parts_.list.size(); ++i) {
      const auto near = [&](const std::vector<std::size_t>& group) {
        return !positions ||
               (parts_.list[group.front()].rest - parts_.list[i].rest).cwiseAbs().maxCoeff() <
                   kSamePosture;
      };
      const auto group = std::find_if(groups.begin(), groups.end(), near);
      if (group != groups.end()) {
        group->push_back(i);
      } else {
        groups.push_back({i});
      }
    }
    std::stable_sort(groups.begin(), groups.end(),
                     [](const auto& a, const auto& b) { return a.size() > b.size(); });
    return groups;
  }

  void identify() {
    if (parts_.list.empty() && report_.advice.empty()) {
      report_.advice = report_.kind != MotionKind::kDecays
                           ? "no part is long enough"
                           : "no free decay stands out of the noise: push harder; or --from and "
                             "--to say where one is";
      report_.kind = MotionKind::kNothing;
      if (parts_.large) report_.kind = MotionKind::kLargeMotion, report_.advice = kLargeAdvice;
    }
    std::size_t silent = 0;  // postures without modes, because the motion is not linear
    bool bent = false;       // one of them has modes
    identification::IdentifyOptions options;
    options.max_order = command_.order;
    const std::vector<std::vector<std::size_t>> groups = by_posture();
    double done = 0;  // postures
    if (command_.stop) {
      options.stop = [&](double share) {
        return command_.stop((done - 1 + share) / static_cast<double>(groups.size()));
      };
    }
    for (const std::vector<std::size_t>& group : groups) {
      if (done > 0 && options.stop && options.stop(0)) {
        report_.notes.push_back(
            "interrupted: " + std::to_string(groups.size() - static_cast<std::size_t>(done)) +
            " postures were not looked at");
        break;
      }
      ++done;
      PostureReport posture;
      std::vector<MotionRecord> records;
      posture.rest = Eigen::VectorXd::Zero(parts_.list.front().rest.size());
      for (const std::size_t i : group) {
        records.push_back(parts_.list[i].record);
        posture.rest += parts_.list[i].rest / static_cast<double>(group.size());
      }
      posture.parts = static_cast<int>(group.size());
      try {
        posture.found = report_.kind == MotionKind::kAmbient
                            ? identification::identify_ambient(records, options)
                        : report_.kind == MotionKind::kDriven
                            ? identification::identify_excited(records, options)
                            : identification::identify_decays(records, options);
      } catch (const std::invalid_argument& error) {
        for (const std::size_t i : group)
          report_.parts[parts_.list[i].report].reason = reason_of(error);
        if (report_.advice.empty()) report_.advice = reason_of(error);
        continue;
      }
      // A linear model cannot show that a motion is far from linear, however good it looks; with
      // more modes than joints it does not describe the arm.
      const bool large = std::any_of(group.begin(), group.end(), [this](std::size_t i) {
        return is_large(parts_.list[i].record, report_.channels);
      });
      const double length = parts_.list[group.front()].record.time(Eigen::last) -
                            parts_.list[group.front()].record.time[0];
      const bool fades =
          posture.found.friction > 0 ||
          std::any_of(posture.found.modes.begin(), posture.found.modes.end(),
                      [length](const auto& mode) {
                        return mode.damping_ratio * mode.natural_frequency * length > kFades;
                      });
      const bool linear = posture.found.explained > kExplains &&
                          posture.found.modes.size() <= report_.channels.size();
      if (large && !(linear && fades)) {
        if (!command_.large_motion) {
          for (const std::size_t i : group)
            report_.parts[parts_.list[i].report].reason = kLargeAdvice;
          report_.advice = kLargeAdvice;
          continue;
        }
        report_.notes.emplace_back(
            "joints move by more than 0.5 rad: frequencies and ratios may change with the size of "
            "the motion, which deviations do not count; smaller pushes tell");
      }
      for (const std::size_t i : group) {
        report_.parts[parts_.list[i].report].posture = static_cast<int>(report_.postures.size());
      }
      for (Index c = 0; c < posture.found.noise.size(); ++c) {
        if (posture.found.noise[c] > 0) continue;
        report_.notes.push_back(report_.channels[static_cast<std::size_t>(c)].name +
                                " never moves, and says nothing");
      }
      if (report_.kind == MotionKind::kDecays && !is_linear(posture.found)) {
        silent += posture.found.modes.empty();
        bent = bent || !posture.found.modes.empty();
      }
      report_.postures.push_back(std::move(posture));
    }
    if (bent) report_.notes.emplace_back(kNotLinear);
    if (!report_.postures.empty()) {
      const bool any =
          std::any_of(report_.postures.begin(), report_.postures.end(),
                      [](const PostureReport& posture) { return !posture.found.modes.empty(); });
      report_.advice = any ? "" : silent == report_.postures.size() ? kNotLinear : kNoneBelieved;
    } else if (report_.advice == kLargeAdvice) {
      report_.kind = MotionKind::kLargeMotion;
    } else if (report_.kind != MotionKind::kLimitCycle) {
      report_.kind = MotionKind::kNothing;
    }
  }

  void compare() {
    report_.against = true;
    LoopPrediction loop(command_.against, report_.channels);
    for (PostureReport& posture : report_.postures) {
      posture.predicted = loop.predict(posture.rest, {});
      match(posture.found.modes, posture.predicted);
    }
    if (command_.calibrate.empty()) return;
    report_.calibration = calibrate(loop, command_.calibrate, report_.postures);
    if (report_.calibration->numbers == 0) {
      report_.calibration.reset();
      return;
    }
    if (!command_.output.empty()) loop.write(command_.output, report_.calibration->correction);
  }

  const IdentifyCommand& command_;
  IdentifyReport report_;
  RecordedParts parts_;
};

}  // namespace

IdentifyReport identify_files(const IdentifyCommand& command) {
  return Task(command).run();
}

IdentifyReport identify_log(const std::string& log, const std::string& config,
                            const LogExcitation& excitation) {
  IdentifyCommand command;
  command.excitation = excitation;
  command.files = {log};
  command.against = config;
  try {
    return identify_files(command);
  } catch (const std::exception& error) {
    IdentifyReport report;
    report.notes.push_back(std::string("no modes are identified: ") + error.what());
    return report;
  }
}

}  // namespace dashpot::apps
