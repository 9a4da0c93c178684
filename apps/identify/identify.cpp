#include <dashpot/apps/analyze/json_writer.hpp>
#include <dashpot/apps/cli/gnuplot.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/cli/text_table.hpp>
#include <dashpot/apps/identify/identify.hpp>
#include <dashpot/apps/identify/identify_plot.hpp>
#include <dashpot/apps/identify/identify_writer.hpp>
#include <dashpot/apps/identify/loop_prediction.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

namespace dashpot::apps {
namespace {

using analysis::MotionRecord;
using Eigen::Index;

/// Rest positions that are closer belong to one posture, rad or m.
constexpr double kSamePosture = 0.02;
/// Shorter parts of ambient motion are left out, s.
constexpr double kShortest = 10;
constexpr double kMoment = 0.1;  // s

struct IdentifyCommand {
  std::vector<std::string> files;
  std::string channels, against, calibrate, output, plot;
  std::optional<double> from, to;
  int order = 0;
  bool ambient = false;
  bool json = false;
};

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
    report_.ambient = command_.ambient;
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
    const std::vector<Index> chosen = chosen_channels(file.channels, command_.channels);
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
    Index first = 0, last = all.time.size();
    while (command_.from && first < last && all.time[first] < *command_.from) ++first;
    while (command_.to && last > first && all.time[last - 1] > *command_.to) --last;
    if (last - first < 20) {
      throw InputError(
          path, std::to_string(last - first) + " samples from --from to --to, need 20 or more");
    }
    const std::string name = std::filesystem::path(path).filename();
    if (command_.ambient) {
      add_ambient(all, first, last, file.free, name);
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

  /// The stretches in which the loop itself moves nothing. A limit that is touched for a moment
  /// does not end one.
  void add_ambient(const MotionRecord& all, Index first, Index last, const std::vector<bool>& free,
                   const std::string& file) {
    double too_short = 0;  // s
    const auto take = [&](Index from, Index to) {
      const double length = all.time[to - 1] - all.time[from];
      if (length < kShortest) {
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
                              " s left out, in stretches shorter than 10 s");
    }
  }

  void add(MotionRecord record, const std::string& file) {
    const Index N = record.time.size();
    const Index last = command_.ambient ? N : std::max<Index>(1, N / 10);
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
      report_.notes.emplace_back(command_.ambient
                                     ? "no part is long enough"
                                     : "no free decay was found: nothing moves by itself");
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
        posture.found = command_.ambient ? analysis::identify_ambient(records, options)
                                         : analysis::identify_decays(records, options);
      } catch (const std::invalid_argument& error) {
        for (const std::size_t i : group) report_.parts[parts_[i].report].reason = error.what();
        continue;
      }
      for (const std::size_t i : group) {
        report_.parts[parts_[i].report].posture = static_cast<int>(report_.postures.size());
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

constexpr const char* kHelp =
    R"(FILE is an LCM log of `dashpot run` or `dashpot drive`, or a CSV file with a line of names and
units ("time [s], q1 [rad], ..."). Several files are one experiment. Free decays, after a push, a
release or a step, are found unless --from or --to says where one is. With --ambient the motion is
that of an arm which many small unknown forces shake for a minute or more.
)";

}  // namespace

IdentifyReport identify_log(const std::string& log, const std::string& config) {
  IdentifyCommand command;
  command.files = {log};
  command.against = config;
  try {
    return Task(command).run();
  } catch (const std::exception& error) {
    IdentifyReport report;
    report.notes.push_back(std::string("no modes are identified: ") + error.what());
    return report;
  }
}

void add_identify(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("identify", "The modes that an arm really has, from recorded motion");
  const auto options = std::make_shared<IdentifyCommand>();
  command->add_option("FILE", options->files, "Records: LCM logs or CSV files")->required();
  command
      ->add_option("--channels", options->channels,
                   "Columns to use, by name; without it all positions, or else all velocities")
      ->option_text("NAME,...");
  command->add_flag("--ambient", options->ambient,
                    "The arm is shaken all the time by forces that nobody measured");
  command
      ->add_option("--from", options->from,
                   "Begin of a free decay, or of what is used, s of the file's time")
      ->option_text("S");
  command->add_option("--to", options->to, "End of it, s")->option_text("S");
  command
      ->add_option(
          "--order", options->order,
          "Largest order of the models tried, eigenvalues; 0: 2 for each channel, at least "
          "12; with --ambient 4 for each channel and 4")
      ->check(CLI::Range(0, 60));
  CLI::Option* against =
      command
          ->add_option("--against", options->against,
                       "Configuration of the controller; its predictions are shown beside")
          ->option_text("CONFIG");
  CLI::Option* calibrated =
      command
          ->add_option("--calibrate", options->calibrate,
                       "Explain the differences by payload, reflected_inertia, friction, delay: "
                       "those named")
          ->option_text("NAME,...")
          ->needs(against);
  command->add_option("--output", options->output, "The configuration with what --calibrate found")
      ->option_text("CONFIG")
      ->needs(calibrated);
  command
      ->add_option("--plot", options->plot,
                   "Picture of the stabilisation of the poles, and of measured beside predicted "
                   "modes; .svg or .png")
      ->option_text("FILE");
  command->add_flag("--json", options->json, "Print one JSON object");
  command->footer(std::string(kHelp) + kExitStatusHelp);
  command->callback([options] {
    std::vector<NamedFile> inputs = {{"--against", options->against}};
    for (const std::string& file : options->files) inputs.push_back({"a record", file});
    check_outputs({{"--output", options->output}, {"--plot", options->plot}}, inputs);
    if (!options->plot.empty()) check_plot_name(options->plot);
    const IdentifyReport report = Task(*options).run();
    if (!options->plot.empty()) draw_identification(options->plot, report);
    print(options->json ? json_text(identify_json(report)) : identify_table(report));
  });
}

}  // namespace dashpot::apps
