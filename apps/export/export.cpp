#include <dashpot/analysis/mode.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/export/mcap_writer.hpp>
#include <dashpot/apps/messages/message_json.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>
#include <optional>

namespace dashpot::apps {
namespace {

struct ExportOptions {
  std::string log, mcap, csv;
};

/// ns; a time before 1970, or beyond what 64 bits hold, is taken as the nearest that can be said.
std::uint64_t nanoseconds(std::int64_t utime) {
  constexpr std::int64_t kLatest = INT64_MAX / 1000;
  return static_cast<std::uint64_t>(std::clamp<std::int64_t>(utime, 0, kLatest)) * 1000;
}

/// A channel for each kind of message, which appears with its first message.
class McapExport {
 public:
  explicit McapExport(const std::string& path) : file_(open_output("--mcap", path)) {
    writer_.emplace(file_.get());
  }
  template <class Message>
  void take(const char* topic, const char* type, std::uint16_t& channel, const Message& message) {
    const nlohmann::ordered_json json = message_json(message);
    if (channel == 0) {
      channel = writer_->add_channel(topic, type, json_schema(json, type).dump());
    }
    writer_->add_message(channel, nanoseconds(message.utime), json.dump());
  }
  void finish() {
    writer_->finish();
    if (std::fclose(file_.release()) != 0) throw std::runtime_error("--mcap: cannot write");
  }

  std::uint16_t state = 0, modes = 0, sampled = 0;

 private:
  OutputFile file_;
  std::optional<McapWriter> writer_;
};

/// A line for each mode of each message.
class CsvExport {
 public:
  explicit CsvExport(const std::string& path) : file_(open_output("--csv", path)) {
    std::fputs(
        "time,tick,label,natural_frequency,damping_ratio,real_1,imag_1,real_2,imag_2,kind,"
        "natural_frequency_bound,damping_ratio_bound\n",
        file_.get());
  }
  void take(const modes_t& m) {
    if (!first_) first_ = m.utime;
    const double time = 1e-6 * (static_cast<double>(m.utime) - static_cast<double>(*first_));
    for (std::size_t i = 0; i < m.label.size(); ++i) {
      std::fprintf(file_.get(), "%.6f,%lld,%d,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%s,%.17g,%.17g\n",
                   time, static_cast<long long>(m.tick), m.label[i], m.natural_frequency[i],
                   m.damping_ratio[i], m.eigenvalue_real[i][0], m.eigenvalue_imag[i][0],
                   m.eigenvalue_real[i][1], m.eigenvalue_imag[i][1],
                   analysis::to_text(static_cast<analysis::ModeKind>(m.kind[i])),
                   m.natural_frequency_bound[i], m.damping_ratio_bound[i]);
    }
  }
  void finish() {
    const bool failed = std::ferror(file_.get()) != 0;
    if (std::fclose(file_.release()) != 0 || failed) {
      throw std::runtime_error("--csv: cannot write");
    }
  }

 private:
  OutputFile file_;
  std::optional<std::int64_t> first_;
};

void export_log(const ExportOptions& options) {
  if (options.mcap.empty() && options.csv.empty()) {
    throw CLI::ValidationError("export", "--mcap or --csv is needed");
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
  // A file that is no log is refused before an output is emptied.
  if (!reader->read()) throw InputError(options.log, "is no LCM log");
  std::optional<McapExport> mcap;
  std::optional<CsvExport> csv;
  if (!options.mcap.empty()) mcap.emplace(options.mcap);
  if (!options.csv.empty()) csv.emplace(options.csv);
  handlers.on_state = [&](const state_t& message) {
    ++count;
    if (mcap) mcap->take("DASHPOT_STATE", "dashpot.state_t", mcap->state, message);
  };
  handlers.on_modes = [&](const modes_t& message) {
    ++count;
    if (mcap) mcap->take("DASHPOT_MODES", "dashpot.modes_t", mcap->modes, message);
    if (csv) csv->take(message);
  };
  handlers.on_sampled_modes = [&](const sampled_modes_t& message) {
    ++count;
    if (mcap) {
      mcap->take("DASHPOT_SAMPLED_MODES", "dashpot.sampled_modes_t", mcap->sampled, message);
    }
  };
  const StopSignal stop;
  do {
    reader->handle();
  } while (!StopSignal::given() && reader->read());
  if (!reader->foreign().empty()) throw InputError(options.log, reader->foreign());
  if (mcap) mcap->finish();
  if (csv) csv->finish();
  const std::string damage = reader->damage();
  print(std::string(StopSignal::given() ? "Interrupted. " : "") + std::to_string(count) +
        " messages exported, " + std::to_string(handlers.malformed) + " malformed\n" +
        (damage.empty() ? "" : "The log is " + damage + ".\n"));
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
