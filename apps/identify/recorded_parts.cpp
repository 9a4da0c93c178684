#include <dashpot/apps/identify/identify.hpp>
#include <dashpot/apps/records/motion_file.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/identification/identification.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

namespace dashpot::apps {
namespace {

/// Motion over more than this is large, rad: the inertia that a joint sees changes by about as
/// large a share with the posture. The scale of a linear motion is free; the fit judges it.
constexpr double kLargeRange = 0.5;
/// A large cycle with a larger share at multiples of its frequency is a trajectory.
constexpr double kCycleHarmonics = 0.1;
constexpr Index kMoment = 100;  // samples
/// If the wrench of an excitation changes at a larger share of the samples, the motion counts as
/// the response to it, and not as the free decays that follow.
constexpr double kMuchChanges = 0.2;

/// Means of the last samples.
Eigen::VectorXd rest_of(const MotionRecord& record, Index last) {
  const Index N = record.time.size();
  Eigen::VectorXd rest(record.output.rows());
  for (Index c = 0; c < rest.size(); ++c) {
    double sum = 0;
    Index count = 0;
    for (Index i = N; i-- > 0 && (count < last || count == 0);) {
      const double y = record.output(c, i);
      if (std::isfinite(y)) sum += y, ++count;
    }
    rest[c] = count > 0 ? sum / static_cast<double>(count) : 0;
  }
  return rest;
}

/// Marks samples of a saturated sensor as missing: the channel stays at the end of its range for
/// some samples, and comes and goes at once. Returns how many.
int leave_out_clipped(Eigen::MatrixXd& values, Index channel) {
  constexpr Index kRun = 3;     // samples
  constexpr double kSteps = 3;  // times the least step of the channel: rounding stays as well
  const Eigen::VectorXd y = values.row(channel);
  double step = std::numeric_limits<double>::infinity(), least = step, most = -step;
  for (Index i = 0; i < y.size(); ++i) {
    if (!std::isfinite(y[i])) continue;
    least = std::min(least, y[i]), most = std::max(most, y[i]);
    const double change = i > 0 ? std::abs(y[i] - y[i - 1]) : 0;
    if (change > 0) step = std::min(step, change);
  }
  int count = 0;
  for (Index from = 1, to = 0; from < y.size(); from = to) {
    to = from + 1;
    if (y[from] != least && y[from] != most) continue;
    while (to < y.size() && y[to] == y[from]) ++to;
    if (to - from < kRun || to == y.size()) continue;
    if (std::min(std::abs(y[from] - y[from - 1]), std::abs(y[to] - y[from])) > kSteps * step) {
      values.row(channel)
          .segment(from, to - from)
          .setConstant(std::numeric_limits<double>::quiet_NaN());
      count += static_cast<int>(to - from);
    }
  }
  return count;
}

/// Names the columns of a file that may be inputs although --inputs does not list them: forces, and
/// torques if they are fewer than the joints, because a torque of each joint is the controller's.
std::vector<std::string> possible_inputs(const std::vector<MotionChannel>& channels,
                                         const std::vector<Index>& chosen) {
  const auto torques = std::count_if(channels.begin(), channels.end(),
                                     [](const auto& channel) { return channel.unit == "N m"; });
  const bool few = torques < static_cast<std::ptrdiff_t>(chosen.size());
  std::vector<std::string> notes;
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const auto& [name, unit, problem] = channels[i];
    if (unit != "N" && !(unit == "N m" && few)) continue;
    if (std::find(chosen.begin(), chosen.end(), static_cast<Index>(i)) != chosen.end()) continue;
    notes.push_back(std::string(name)
                        .append(unit == "N" ? " [N] is a force" : " [N m] is a torque")
                        .append(": if it was put in from outside, --inputs ")
                        .append(name));
  }
  return notes;
}

class PartsReader {
 public:
  PartsReader(const IdentifyCommand& command, IdentifyReport& report, RecordedParts& parts)
      : command_(command), report_(report), parts_(parts) {}

  void read(const std::string& path) {
    const MotionFile file = read_motion_file(path, command_.hints);
    const std::string name = std::filesystem::path(path).filename();
    const std::vector<Index> driving = input_channels(file);
    const std::vector<Index> others = command_.inputs.empty() ? std::vector<Index>{} : driving;
    const std::vector<Index> chosen = chosen_channels(file.channels, command_.channels, others);
    std::vector<MotionChannel> channels;
    channels.reserve(chosen.size());
    for (const Index i : chosen) channels.push_back(file.channels[static_cast<std::size_t>(i)]);
    if (!command_.inputs.empty()) {
      for (const Index i : driving) check_numbers(path, file.channels[static_cast<std::size_t>(i)]);
    }
    for (const MotionChannel& channel : channels) check_numbers(path, channel);
    if (report_.channels.empty()) {
      report_.channels = channels;
    } else if (!std::equal(channels.begin(), channels.end(), report_.channels.begin(),
                           report_.channels.end(), [](const auto& a, const auto& b) {
                             return a.name == b.name && a.unit == b.unit;
                           })) {
      throw InputError(path, "its channels differ from the channels of " + command_.files.front());
    }
    const auto say = [this, &name](const std::vector<std::string>& notes) {
      for (const std::string& note : notes) {
        report_.notes.push_back(std::string(name).append(": ").append(note));
      }
    };
    say(file.notes);
    if (command_.channels.empty()) say(left_out_positions(file.channels, chosen, others));
    if (file.rests.empty() && command_.inputs.empty() && !command_.ambient) {
      say(possible_inputs(file.channels, chosen));
    }
    const auto note = [this, &path](int count, const std::string& what) {
      if (count > 0) report_.notes.push_back(path + ": " + std::to_string(count) + what);
    };
    note(file.duplicates, " samples left out, because another has the same time");
    note(file.out_of_order, " samples left out, because their time runs backwards");

    MotionRecord all{file.time,
                     Eigen::MatrixXd(static_cast<Index>(chosen.size()), file.time.size())};
    for (std::size_t c = 0; c < chosen.size(); ++c) {
      all.output.row(static_cast<Index>(c)) = file.values.row(chosen[c]);
      note(leave_out_clipped(all.output, static_cast<Index>(c)),
           " samples of " + channels[c].name + " left out, because they are clipped");
    }
    const bool driven = is_driven(file, driving);
    if (driven) all.input = inputs_of(file, driving);
    Index first = 0, last = all.time.size();
    while (command_.from && first < last && all.time[first] < *command_.from) ++first;
    while (command_.to && last > first && all.time[last - 1] > *command_.to) --last;
    if (last - first < 20) {
      throw InputError(
          path,
          std::to_string(last - first) +
              " samples from --from to --to, s after the file's first sample; need 20 or more");
    }
    const MotionRecord chosen_part = part_of(all, first, last);
    const MotionKind kind = kind_of(chosen_part, driven, file.free);
    if (!parts_.list.empty() && kind != report_.kind) {
      leave_out(chosen_part, name, std::string("is another kind of motion than the first"));
      return;
    }
    report_.kind = kind;
    if (kind == MotionKind::kLimitCycle || kind == MotionKind::kLargeMotion ||
        kind == MotionKind::kNothing) {
      leave_out(chosen_part, name, report_.advice);
    } else if (kind != MotionKind::kDecays) {
      add_stretches(all, first, last, kind == MotionKind::kAmbient ? file.free : file.rests, name);
    } else if (command_.from || command_.to) {  // the user names the free decay
      add(chosen_part, name);
    } else {
      for (const identification::FreeDecay& found : identification::find_decays(all, file.free)) {
        MotionRecord part = part_of(all, found.from, std::max(found.from + 1, found.to));
        if (found.reason.empty()) {
          add(std::move(part), name);
        } else {
          leave_out(part, name, found.reason);
        }
      }
    }
  }

 private:
  static void check_numbers(const std::string& path, const MotionChannel& channel) {
    if (!channel.problem.empty()) throw InputError(path, channel.problem);
  }

  void leave_out(const MotionRecord& record, const std::string& file, const std::string& reason) {
    report_.parts.push_back(
        {file, record.time[0], record.time[record.time.size() - 1], -1, reason});
  }

  /// Returns the kind of motion; if that has no modes, the report says why.
  MotionKind kind_of(const MotionRecord& record, bool driven, const std::vector<bool>& free) {
    const identification::MotionVerdict verdict = identification::judge_motion(record);
    const bool large = !command_.large_motion && is_large(record, report_.channels);
    parts_.large = parts_.large || large;
    MotionKind kind = verdict.kind;
    if (kind == MotionKind::kNothing) {
      report_.advice = "nothing moves beyond the noise; push harder, or name other --channels";
      return kind;
    }
    if (driven || command_.ambient) {
      kind = large ? MotionKind::kLargeMotion : driven ? MotionKind::kDriven : MotionKind::kAmbient;
    }
    if (!driven && verdict.kind == MotionKind::kLimitCycle) {
      kind = large && verdict.harmonics > kCycleHarmonics ? MotionKind::kLargeMotion
                                                          : MotionKind::kLimitCycle;
    }
    if (kind == MotionKind::kAmbient && !command_.ambient &&
        std::find(free.begin(), free.end(), false) != free.end()) {
      kind = MotionKind::kDecays;  // a log with a moving reference
    }
    if (kind == MotionKind::kAmbient && large) kind = MotionKind::kLargeMotion;
    if (kind == MotionKind::kLimitCycle) {
      report_.advice =
          "it repeats itself at " + format_number(verdict.frequency, 5) +
          " rad/s with one amplitude, whatever it began with: less gain, or less delay, ends it; "
          "then push";
    } else if (kind == MotionKind::kLargeMotion) {
      report_.advice = kLargeAdvice;
    }
    return kind;
  }

  /// The channels named by --inputs, or the tip's wrench.
  std::vector<Index> input_channels(const MotionFile& file) const {
    std::vector<Index> driving;
    if (!command_.inputs.empty()) {
      driving = chosen_channels(file.channels, command_.inputs, {}, "--inputs");
    } else {
      for (std::size_t i = 0; i < file.channels.size(); ++i) {
        if (file.channels[i].name.starts_with("wrench_")) driving.push_back(static_cast<Index>(i));
      }
    }
    return driving;
  }

  /// True if, by the options or the wrench in the file, the input that moved the arm is known.
  bool is_driven(const MotionFile& file, const std::vector<Index>& driving) const {
    const bool known = file.wrench || command_.excitation;
    if (command_.excited && command_.inputs.empty() && !known) {
      throw InputError("--excited",
                       file.rests.empty()
                           ? "needs --inputs, the columns of what moved the arm"
                           : "has springs at the tip, whose wrench is in the log together with "
                             "what was added; only the end of run or drive --excite knows it");
    }
    bool much = command_.excitation && command_.excitation->chirp;
    if (file.wrench && !command_.ambient) {
      double changes = 0;
      for (Index i = 1; i < file.time.size(); ++i) {
        bool changed = false;
        for (const Index c : driving) {
          changed = changed || std::abs(file.values(c, i) - file.values(c, i - 1)) > 1e-9;
        }
        changes += changed ? 1 : 0;
      }
      much = much || changes > kMuchChanges * static_cast<double>(file.time.size());
    }
    return !command_.ambient && (command_.excited || !command_.inputs.empty() || much);
  }

  /// inputs x samples; a missing value is replaced by the last one.
  Eigen::MatrixXd inputs_of(const MotionFile& file, const std::vector<Index>& driving) {
    Eigen::MatrixXd inputs(static_cast<Index>(driving.size()), file.time.size());
    for (std::size_t i = 0; i < driving.size(); ++i) {
      inputs.row(static_cast<Index>(i)) = file.values.row(driving[i]);
    }
    if (!file.wrench && command_.inputs.empty()) {  // the excitation, from the first tick
      for (Index k = 0; k < file.time.size(); ++k) {
        inputs.col(k) = command_.excitation->wrench(file.time[k]);
      }
    }
    for (auto row : inputs.rowwise()) {
      double held = 0;
      for (double& value : row) {
        if (std::isfinite(value)) held = value;
        value = held;
      }
    }
    return inputs;
  }

  /// Adds the stretches in which the loop moves no reference. A limit that is touched for a moment
  /// does not end a stretch.
  void add_stretches(const MotionRecord& all, Index first, Index last,
                     const std::vector<bool>& free, const std::string& file) {
    constexpr Index kShortest = 20;  // samples
    double too_short = 0;            // s
    const auto take = [&](Index from, Index to) {
      if (to - from < kShortest) {
        too_short += all.time[to - 1] - all.time[from];
      } else {
        add(part_of(all, from, to), file);
      }
    };
    Index from = first, to = first;  // of the present stretch
    for (Index i = first; i < last; ++i) {
      if (!free.empty() && !free[static_cast<std::size_t>(i)]) continue;
      if (to > from && i - to > kMoment) {
        take(from, to);
        to = from = i;
      }
      if (to == from) from = i;
      to = i + 1;
    }
    if (to > from) take(from, to);
    if (too_short > 0) {
      report_.notes.push_back(file + ": " + format_number(too_short, 3) +
                              " s left out, in stretches of less than " +
                              std::to_string(kShortest) + " samples");
    }
  }

  void add(MotionRecord record, const std::string& file) {
    const Index N = record.time.size();
    const Index last = report_.kind == MotionKind::kDecays ? std::max<Index>(1, N / 10) : N;
    report_.parts.push_back({file, record.time[0], record.time[N - 1], -1, {}});
    Eigen::VectorXd rest = rest_of(record, last);
    parts_.list.push_back({std::move(record), std::move(rest), report_.parts.size() - 1});
  }

  const IdentifyCommand& command_;
  IdentifyReport& report_;
  RecordedParts& parts_;
};

}  // namespace

bool is_large(const MotionRecord& record, const std::vector<MotionChannel>& channels) {
  for (std::size_t c = 0; c < channels.size(); ++c) {
    if (channels[c].unit != "rad") continue;
    double least = 0, most = 0;
    bool any = false;
    for (const double y : record.output.row(static_cast<Index>(c))) {
      if (!std::isfinite(y)) continue;
      least = any ? std::min(least, y) : y, most = any ? std::max(most, y) : y;
      any = true;
    }
    if (most - least > kLargeRange) return true;
  }
  return false;
}

void read_parts(const std::string& path, const IdentifyCommand& command, IdentifyReport& report,
                RecordedParts& parts) {
  PartsReader(command, report, parts).read(path);
}

}  // namespace dashpot::apps
