#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/modes.hpp>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <concepts>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace dashpot::apps {
namespace {

constexpr std::string_view kMagic{"\x89MCAP0\r\n", 8};
constexpr std::size_t kChunkSize = 1 << 20;  // bytes

enum Op : char {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0B,
  kDataEnd = 0x0F,
};

/// The fields of a record, little-endian.
class Fields {
 public:
  template <std::unsigned_integral T>
  Fields& number(T value) {
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      bytes_ += static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i) & 0xFF);
    }
    return *this;
  }
  Fields& text(std::string_view value) {
    return number(static_cast<std::uint32_t>(value.size())).raw(value);
  }
  Fields& raw(std::string_view value) {
    bytes_ += value;
    return *this;
  }
  Fields& map(const std::map<std::uint16_t, std::uint64_t>& values) {
    number(static_cast<std::uint32_t>(10 * values.size()));
    for (const auto& [key, value] : values) number(key).number(value);
    return *this;
  }
  std::string record(Op op) const {
    Fields head;
    head.number(std::uint64_t{bytes_.size()});
    return std::string(1, op) + head.bytes_ + bytes_;
  }

 private:
  std::string bytes_;
};

/// Writes an MCAP file of JSON messages (https://mcap.dev/spec): chunks without compression, an
/// index of each, and a summary, so that readers can seek.
class McapWriter {
 public:
  /// `file` must outlive the writer. All functions throw std::runtime_error if writing fails.
  explicit McapWriter(OutputFile& file) : file_(file) {
    write(kMagic);
    write(Fields().text("").text("dashpot").record(kHeader));
  }

  /// Adds a channel with the JSON schema of its messages; returns its number.
  std::uint16_t add_channel(const std::string& topic, const std::string& schema_name,
                            const std::string& schema) {
    const auto id = static_cast<std::uint16_t>(counts_.size() + 1);
    const std::string records =
        Fields().number(id).text(schema_name).text("jsonschema").text(schema).record(kSchema) +
        Fields().number(id).number(id).text(topic).text("json").number(0U).record(kChannel);
    summary_ += records;
    chunk_ += records;
    counts_[id] = 0;
    return id;
  }
  /// Adds a message; `time` is in ns since 1970-01-01 UTC.
  void add_message(std::uint16_t channel, std::uint64_t time, std::string_view json) {
    const std::uint64_t number = ++counts_[channel];
    const bool first = index_.empty();
    open_.start = first ? time : std::min(open_.start, time);
    open_.end = first ? time : std::max(open_.end, time);
    index_[channel].push_back({time, chunk_.size()});
    chunk_ += Fields()
                  .number(channel)
                  .number(static_cast<std::uint32_t>(number))
                  .number(time)
                  .number(time)
                  .raw(json)
                  .record(kMessage);
    if (chunk_.size() >= kChunkSize) end_chunk();
  }
  /// Writes the summary. Nothing may be added afterwards.
  void finish() {
    end_chunk();
    write(Fields().number(0U).record(kDataEnd));
    const std::uint64_t start = at_;
    write(summary_);
    std::uint64_t messages = 0;
    for (const auto& [channel, count] : counts_) messages += count;
    const auto channels = static_cast<std::uint32_t>(counts_.size());
    write(Fields()
              .number(messages)
              .number(static_cast<std::uint16_t>(channels))
              .number(channels)
              .number(0U)
              .number(0U)
              .number(static_cast<std::uint32_t>(chunks_.size()))
              .number(start_)
              .number(end_)
              .map(counts_)
              .record(kStatistics));
    for (const Chunk& chunk : chunks_) {
      write(Fields()
                .number(chunk.start)
                .number(chunk.end)
                .number(chunk.offset)
                .number(chunk.size)
                .map(chunk.indexes)
                .number(chunk.index_size)
                .text("")
                .number(chunk.data_size)
                .number(chunk.data_size)
                .record(kChunkIndex));
    }
    write(Fields().number(start).number(std::uint64_t{0}).number(0U).record(kFooter));
    write(kMagic);
  }

 private:
  struct Chunk {
    std::uint64_t start = 0, end = 0;    ///< times, ns
    std::uint64_t offset = 0, size = 0;  ///< of the record in the file, bytes
    std::uint64_t index_size = 0, data_size = 0;
    std::map<std::uint16_t, std::uint64_t> indexes;  ///< offset of each channel's index
  };
  using Index = std::map<std::uint16_t, std::vector<std::array<std::uint64_t, 2>>>;

  void write(std::string_view bytes) {
    file_.write(bytes);
    at_ += bytes.size();
  }
  void end_chunk() {
    if (index_.empty()) return;
    start_ = chunks_.empty() ? open_.start : std::min(start_, open_.start);
    end_ = std::max(end_, open_.end);
    open_.offset = at_;
    open_.data_size = chunk_.size();
    write(Fields()
              .number(open_.start)
              .number(open_.end)
              .number(open_.data_size)
              .number(0U)  // no checksum
              .text("")    // no compression
              .number(open_.data_size)
              .raw(chunk_)
              .record(kChunk));
    open_.size = at_ - open_.offset;
    for (auto& [channel, entries] : index_) {
      std::sort(entries.begin(), entries.end());
      Fields fields;
      fields.number(channel).number(static_cast<std::uint32_t>(16 * entries.size()));
      for (const auto& entry : entries) fields.number(entry[0]).number(entry[1]);
      open_.indexes[channel] = at_;
      write(fields.record(kMessageIndex));
    }
    open_.index_size = at_ - open_.offset - open_.size;
    chunks_.push_back(open_);
    open_ = {};
    index_.clear();
    chunk_.clear();
  }

  OutputFile& file_;
  std::uint64_t at_ = 0;  ///< bytes written
  std::string summary_;   ///< schemas and channels, as records
  std::string chunk_;     ///< records of the open chunk
  Chunk open_;
  Index index_;  ///< time and offset of the messages in the open chunk
  std::vector<Chunk> chunks_;
  std::map<std::uint16_t, std::uint64_t> counts_;
  std::uint64_t start_ = 0, end_ = 0;
};

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
