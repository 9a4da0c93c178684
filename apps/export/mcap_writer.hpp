#pragma once
#include <dashpot/apps/cli/output_file.hpp>

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace dashpot::apps {

/// Writes an MCAP file of JSON messages (https://mcap.dev/spec): chunks without compression, an
/// index of each, and a summary, so that readers can seek.
class McapWriter {
 public:
  /// `file` must outlive the writer. All functions throw std::runtime_error if writing fails.
  explicit McapWriter(OutputFile& file);

  /// Adds a channel with the JSON schema of its messages; returns its number.
  std::uint16_t add_channel(const std::string& topic, const std::string& schema_name,
                            const std::string& schema);
  /// Adds a message; `time` is in ns since 1970-01-01 UTC.
  void add_message(std::uint16_t channel, std::uint64_t time, std::string_view json);
  /// Writes the summary. Nothing may be added afterwards.
  void finish();

 private:
  struct Chunk {
    std::uint64_t start = 0, end = 0;    ///< times, ns
    std::uint64_t offset = 0, size = 0;  ///< of the record in the file, bytes
    std::uint64_t index_size = 0, data_size = 0;
    std::map<std::uint16_t, std::uint64_t> indexes;  ///< offset of each channel's index
  };
  using Index = std::map<std::uint16_t, std::vector<std::array<std::uint64_t, 2>>>;

  void write(std::string_view bytes);
  void end_chunk();

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

}  // namespace dashpot::apps
