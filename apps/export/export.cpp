#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/export/mcap_writer.hpp>
#include <dashpot/apps/report/message_json.hpp>
#include <dashpot/apps/report/modes.hpp>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <vector>

namespace dashpot::apps {
namespace {

struct ExportOptions {
  std::string log, mcap, csv;
};

/// ns; a time before 1970, or beyond the range of 64 bits, becomes the nearest possible one.
std::uint64_t nanoseconds(std::int64_t utime) {
  constexpr std::int64_t kLatest = INT64_MAX / 1000;
  return static_cast<std::uint64_t>(std::clamp<std::int64_t>(utime, 0, kLatest)) * 1000;
}

/// A channel for each kind of message, which appears with its first message.
class McapExport {
 public:
  explicit McapExport(const std::string& path) : file_("--mcap", path), writer_(file_) {}

  template <class Message>
  void take(const char* topic, const std::string& type, const Message& message) {
    const nlohmann::ordered_json json = message_json(message);
    auto& channel = channels_[topic];
    if (channel == 0) channel = writer_.add_channel(topic, type, json_schema(json, type).dump());
    writer_.add_message(channel, nanoseconds(message.utime), json.dump());
  }
  void finish() {
    writer_.finish();
    file_.finish();
  }

 private:
  OutputFile file_;
  McapWriter writer_;
  std::map<std::string, std::uint16_t> channels_;
};

/// A line for each mode of each message.
class CsvExport {
 public:
  explicit CsvExport(const std::string& path) : file_("--csv", path) {
    file_.write(csv_of({}, fields_));
  }
  void take(const modes_t& message) {
    if (!first_) first_ = message.utime;
    std::vector<LoopMode> modes = loop_modes(message);
    for (LoopMode& mode : modes) {
      mode.time = 1e-6 * (static_cast<double>(message.utime) - static_cast<double>(*first_));
    }
    file_.write(csv_of(modes, fields_, false));
  }
  void finish() { file_.finish(); }

 private:
  const std::vector<Field<LoopMode>> fields_ = mode_fields();
  OutputFile file_;
  std::optional<std::int64_t> first_;
};

void export_log(const ExportOptions& options) {
  if (options.mcap.empty() && options.csv.empty()) {
    throw InputError("--mcap, --csv", "one of them is needed");
  }
  check_outputs({{"--mcap", options.mcap}, {"--csv", options.csv}}, {{"the log", options.log}});
  lcmtypes::MessageHandlers handlers;
  std::int64_t count = 0;
  std::unique_ptr<lcmtypes::LogReader> reader;
  try {
    reader = std::make_unique<lcmtypes::LogReader>(options.log, handlers);
  } catch (const std::runtime_error& error) {
    throw InputError("", error.what());
  }
  // An input that is not a log is refused before an output is emptied.
  if (!reader->read()) throw InputError(options.log, "is not an LCM log");
  std::optional<McapExport> mcap;
  std::optional<CsvExport> csv;
  if (!options.mcap.empty()) mcap.emplace(options.mcap);
  if (!options.csv.empty()) csv.emplace(options.csv);
  const auto take = [&](const char* topic, const char* type) {
    return [&, topic, type](const auto& message) {
      ++count;
      if (mcap) mcap->take(topic, type, message);
    };
  };
  handlers.on_state = take(lcmtypes::kStateChannel, "dashpot.state_t");
  handlers.on_contact = take(lcmtypes::kContactChannel, "dashpot.contact_t");
  handlers.on_sampled_modes = take(lcmtypes::kSampledModesChannel, "dashpot.sampled_modes_t");
  handlers.on_modes =
      [&, take = take(lcmtypes::kModesChannel, "dashpot.modes_t")](const modes_t& message) {
        take(message);
        if (csv) csv->take(message);
      };
  std::error_code none;
  const auto size = static_cast<double>(std::filesystem::file_size(options.log, none));
  const StopSignal stop;
  bool more = true;
  while (more && !StopSignal::given()) {
    reader->handle();
    show_progress(none ? 0 : static_cast<double>(reader->offset()) / size);
    more = reader->read();
  }
  if (!reader->foreign().empty()) throw InputError(options.log, reader->foreign());
  if (mcap) mcap->finish();
  if (csv) csv->finish();
  const std::string damage = reader->damage();
  print(std::to_string(count) + " messages exported, " + std::to_string(handlers.malformed) +
        " malformed\n" + (damage.empty() ? "" : "The log is " + damage + ".\n"));
  if (StopSignal::given()) throw Interrupted("the files hold what was exported until then");
}

}  // namespace

void add_export(CLI::App& program) {
  CLI::App* command = program.add_subcommand("export", "A log for other tools: MCAP, CSV");
  const auto options = std::make_shared<ExportOptions>();
  command->add_option("LOG", options->log, "LCM log to read")->required();
  command
      ->add_option("--mcap", options->mcap,
                   "JSON messages with their schemas, for Foxglove, PlotJuggler and others")
      ->option_text("FILE");
  command->add_option("--csv", options->csv, "Modes against time, a line for each mode")
      ->option_text("FILE");
  command->footer(kExitStatusHelp);
  command->callback([options] { export_log(*options); });
}

}  // namespace dashpot::apps
