#include <dashpot/apps/cli/text_table.hpp>
#include <dashpot/apps/identify/calibration.hpp>
#include <dashpot/apps/identify/identify.hpp>
#include <dashpot/apps/identify/mode_match.hpp>
#include <dashpot/apps/identify/motion_file.hpp>
#include <dashpot/controller/input_error.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <stdexcept>

namespace dashpot::apps {
namespace {

using analysis::MotionRecord;
using controller::InputError;
using Eigen::Index;

/// Rest positions that are closer belong to one posture, rad or m.
constexpr double kSamePosture = 0.02;
/// Shorter parts of ambient motion are left out, s.
constexpr double kShortest = 10;
constexpr double kShortestExcited = 2;
constexpr double kMoment = 0.1;  // s
/// The share of the samples at which the wrench of an excitation changes, from which on the motion
/// is read as the wrench's, and not as the free decays that follow.
constexpr double kMuchChanges = 0.2;

/// A part of a file with what was measured in it.
struct Part {
  MotionRecord record;
  Eigen::VectorXd rest;
  std::size_t report = 0;  ///< its place in IdentifyReport::parts
};

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

class Task {
 public:
  explicit Task(const IdentifyCommand& command) : command_(command) {}

  IdentifyReport run() {
    for (const std::string& file : command_.files) {
      try {
        read(file);
      } catch (const std::invalid_argument& error) {
        throw InputError(file, error.what());
      }
    }
    identify();
    if (!command_.against.empty()) compare();
    return std::move(report_);
  }

 private:
  void read(const std::string& path) {
    const MotionFile file = read_motion_file(path);
    const std::string name = std::filesystem::path(path).filename();
    const std::vector<Index> driving = input_channels(file);
    const std::vector<Index> chosen = chosen_channels(
        file.channels, command_.channels, command_.inputs.empty() ? std::vector<Index>{} : driving);
    std::vector<MotionChannel> channels;
    channels.reserve(chosen.size());
    for (const Index i : chosen) channels.push_back(file.channels[static_cast<std::size_t>(i)]);
    if (report_.channels.empty()) {
      report_.channels = channels;
    } else if (!std::equal(channels.begin(), channels.end(), report_.channels.begin(),
                           report_.channels.end(), [](const auto& a, const auto& b) {
                             return a.name == b.name && a.unit == b.unit;
                           })) {
      throw InputError(path, "its channels differ from those of " + command_.files.front());
    }
    for (const std::string& note : file.notes)
      report_.notes.push_back(std::string(name).append(": ").append(note));
    const auto note = [this, &path](int count, const std::string& what) {
      if (count > 0) report_.notes.push_back(path + ": " + std::to_string(count) + what);
    };
    note(file.duplicates, " samples left out, because another has the same time");
    note(file.out_of_order, " samples left out, because their time runs backwards");

    MotionRecord all{file.time,
                     Eigen::MatrixXd(static_cast<Index>(chosen.size()), file.time.size())};
    for (std::size_t c = 0; c < chosen.size(); ++c) {
      all.output.row(static_cast<Index>(c)) = file.values.row(chosen[c]);
    }
    set_kind(file, driving);
    if (report_.kind == MotionKind::kExcited) all.input = inputs_of(file, driving);
    Index first = 0, last = all.time.size();
    while (command_.from && first < last && all.time[first] < *command_.from) ++first;
    while (command_.to && last > first && all.time[last - 1] > *command_.to) --last;
    if (last - first < 20) {
      throw InputError(
          path, std::to_string(last - first) + " samples from --from to --to, need 20 or more");
    }
    if (report_.kind != MotionKind::kDecays) {
      add_stretches(all, first, last, report_.kind == MotionKind::kAmbient ? file.free : file.rests,
                    name);
      return;
    }
    if (command_.from || command_.to) {  // the user says what is free
      add(part_of(all, first, last), name);
      return;
    }
    for (const analysis::FreeDecay& found : analysis::find_decays(all, file.free)) {
      const double from = all.time[found.from], to = all.time[std::max(found.from, found.to - 1)];
      if (found.reason.empty()) {
        add(part_of(all, found.from, found.to), name);
      } else {
        report_.parts.push_back({name, from, to, -1, found.reason});
      }
    }
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

  /// Of the first file: the kind that the user wants, or what a wrench in it suggests.
  void set_kind(const MotionFile& file, const std::vector<Index>& driving) {
    const bool known = file.wrench || command_.excitation;
    if (command_.excited && command_.inputs.empty() && !known) {
      throw InputError("--excited",
                       file.rests.empty()
                           ? "needs --inputs, the columns of what moved the arm"
                           : "has springs at the tip, whose wrench is in the log together with "
                             "what was added; only the end of run or drive --excite knows it");
    }
    if (!report_.parts.empty() || !parts_.empty()) return;
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
    report_.kind = command_.ambient                                       ? MotionKind::kAmbient
                   : command_.excited || !command_.inputs.empty() || much ? MotionKind::kExcited
                                                                          : MotionKind::kDecays;
  }

  /// inputs x samples; what is missing holds its last value.
  Eigen::MatrixXd inputs_of(const MotionFile& file, const std::vector<Index>& driving) {
    Eigen::MatrixXd inputs(static_cast<Index>(driving.size()), file.time.size());
    for (std::size_t i = 0; i < driving.size(); ++i) {
      inputs.row(static_cast<Index>(i)) = file.values.row(driving[i]);
    }
    if (!file.wrench && command_.inputs.empty()) {  // what the loop was told, from its first tick
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

  /// The stretches in which the loop itself moves nothing. A limit that is touched for a moment
  /// does not end one.
  void add_stretches(const MotionRecord& all, Index first, Index last,
                     const std::vector<bool>& free, const std::string& file) {
    const double shortest = report_.kind == MotionKind::kAmbient ? kShortest : kShortestExcited;
    double too_short = 0;  // s
    const auto take = [&](Index from, Index to) {
      const double length = all.time[to - 1] - all.time[from];
      if (length < shortest) {
        too_short += length;
      } else {
        add(part_of(all, from, to), file);
      }
    };
    Index from = first, to = first;  // of the present stretch
    for (Index i = first; i < last; ++i) {
      if (!free.empty() && !free[static_cast<std::size_t>(i)]) continue;
      if (to > from && all.time[i] - all.time[to - 1] > kMoment) {
        take(from, to);
        to = from = i;
      }
      if (to == from) from = i;
      to = i + 1;
    }
    if (to > from) take(from, to);
    if (too_short > 0) {
      report_.notes.push_back(file + ": " + format_number(too_short, 3) +
                              " s left out, in stretches shorter than " +
                              format_number(shortest, 2) + " s");
    }
  }

  void add(MotionRecord record, const std::string& file) {
    const Index N = record.time.size();
    const Index last = report_.kind == MotionKind::kDecays ? std::max<Index>(1, N / 10) : N;
    report_.parts.push_back({file, record.time[0], record.time[N - 1], -1, {}});
    Eigen::VectorXd rest = rest_of(record, last);
    parts_.push_back({std::move(record), std::move(rest), report_.parts.size() - 1});
  }

  /// Parts by posture, most of them first.
  std::vector<std::vector<std::size_t>> by_posture() const {
    std::vector<std::vector<std::size_t>> groups;
    const bool positions =
        report_.channels.front().unit == "rad" || report_.channels.front().unit == "m";
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const auto near = [&](const std::vector<std::size_t>& group) {
        return !positions ||
               (parts_[group.front()].rest - parts_[i].rest).cwiseAbs().maxCoeff() < kSamePosture;
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
    if (parts_.empty()) {
      report_.notes.emplace_back(
          report_.kind != MotionKind::kDecays
              ? "no part is long enough"
              : "no free decay stands out of the noise: --from and --to say where one is");
    }
    analysis::IdentifyOptions options;
    options.max_order = command_.order;
    for (const std::vector<std::size_t>& group : by_posture()) {
      PostureReport posture;
      std::vector<MotionRecord> records;
      posture.rest = Eigen::VectorXd::Zero(parts_.front().rest.size());
      for (const std::size_t i : group) {
        records.push_back(parts_[i].record);
        posture.rest += parts_[i].rest / static_cast<double>(group.size());
      }
      posture.parts = static_cast<int>(group.size());
      try {
        posture.found =
            report_.kind == MotionKind::kAmbient   ? analysis::identify_ambient(records, options)
            : report_.kind == MotionKind::kExcited ? analysis::identify_excited(records, options)
                                                   : analysis::identify_decays(records, options);
      } catch (const std::invalid_argument& error) {
        for (const std::size_t i : group) report_.parts[parts_[i].report].reason = error.what();
        continue;
      }
      for (const std::size_t i : group) {
        report_.parts[parts_[i].report].posture = static_cast<int>(report_.postures.size());
      }
      for (Index c = 0; c < posture.found.noise.size(); ++c) {
        if (posture.found.noise[c] > 0) continue;
        report_.notes.push_back(report_.channels[static_cast<std::size_t>(c)].name +
                                " never moves, and says nothing");
      }
      report_.postures.push_back(std::move(posture));
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
    if (!command_.output.empty()) loop.write(command_.output, report_.calibration->correction);
  }

  const IdentifyCommand& command_;
  IdentifyReport report_;
  std::vector<Part> parts_;
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
