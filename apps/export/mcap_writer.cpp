#include <dashpot/apps/export/mcap_writer.hpp>

#include <algorithm>
#include <concepts>

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

}  // namespace

McapWriter::McapWriter(OutputFile& file) : file_(file) {
  write(kMagic);
  write(Fields().text("").text("dashpot").record(kHeader));
}

void McapWriter::write(std::string_view bytes) {
  file_.write(bytes);
  at_ += bytes.size();
}

std::uint16_t McapWriter::add_channel(const std::string& topic, const std::string& schema_name,
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

void McapWriter::add_message(std::uint16_t channel, std::uint64_t time, std::string_view json) {
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

void McapWriter::end_chunk() {
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

void McapWriter::finish() {
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

}  // namespace dashpot::apps
