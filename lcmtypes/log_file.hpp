#pragma once
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::lcmtypes {

/// Reads the file format of LCM logs: events, each with a sync word, a number, a time, the lengths
/// of channel name and data, the channel name and the data, big-endian. LCM's own reader trusts the
/// lengths and crashes where they are wrong. This reader compares them with the remaining size of
/// the file, and keeps data in memory only up to kMaxMessageSize. After damage it continues at the
/// next sync word. Every byte is read once, so reading takes time in proportion to the file's size.
class LogFile {
 public:
  struct Event {
    std::int64_t utime = 0;  ///< us since 1970-01-01 UTC
    std::string channel;
    std::uint64_t size = 0;          ///< of the data, bytes
    std::vector<std::uint8_t> data;  ///< `size` bytes, or empty if there are too many to be kept
  };
  /// What is wrong with the log.
  struct Damage {
    std::int64_t places = 0;           ///< number of damaged places
    std::uint64_t first = 0;           ///< offset of the first damaged place, bytes
    std::uint64_t skipped = 0;         ///< bytes that belong to no event that was read
    std::optional<std::uint64_t> cut;  ///< offset of the event that the end of the file cuts off
  };

  /// Opens a log. Throws std::runtime_error that names the file and the reason.
  explicit LogFile(const std::string& path);

  /// Reads the next event. Returns false at the end of the file.
  bool read();
  const Event& event() const noexcept { return event_; }
  /// Returns where the sync word of the event read last begins, bytes.
  std::uint64_t offset() const noexcept { return offset_; }
  /// Continues reading at `offset`, which offset() returned. Does nothing for a pipe.
  void seek(std::uint64_t offset);
  const Damage& damage() const noexcept { return damage_; }

 private:
  enum class Found { kEvent, kDamage, kCut };

  /// Reads up to the end of the next sync word. Returns false at the end of the file.
  bool find_sync();
  /// Reads the part of an event after its sync word.
  Found read_event();
  bool take(void* bytes, std::size_t count);
  bool skip(std::uint64_t count);
  /// Returns true if the file has `count` more bytes, and for a pipe.
  bool may_hold(std::uint64_t count);
  void note_damage(std::uint64_t begin, std::uint64_t end);

  std::string path_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  std::uint64_t at_ = 0;          ///< offset of the next byte
  std::uint64_t offset_ = 0;      ///< of the event read last
  std::uint64_t known_size_ = 0;  ///< of the file, which may grow, bytes
  Event event_;
  Damage damage_;
};

/// Returns what is wrong with a log: "cut off in the event at byte 1234"; "" if nothing is wrong.
std::string describe(const LogFile::Damage& damage);

}  // namespace dashpot::lcmtypes
