#include <dashpot/lcmtypes/log_file.hpp>
#include <dashpot/lcmtypes/message_check.hpp>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <system_error>

namespace dashpot::lcmtypes {
namespace {

constexpr std::uint32_t kSync = 0xEDA1DA01;
constexpr std::uint64_t kSyncSize = 4;
constexpr std::size_t kHeaderSize = 24;        // number, time, and two lengths
constexpr std::uint32_t kLongestChannel = 63;  // LCM sends no longer ones

/// Returns nothing for a pipe or a device.
std::optional<std::uint64_t> size_of(const std::string& path) {
  std::error_code unknown;
  const std::uint64_t size = std::filesystem::file_size(path, unknown);
  return unknown ? std::nullopt : std::optional(size);
}

}  // namespace

LogFile::LogFile(const std::string& path)
    : path_(path), file_(std::fopen(path.c_str(), "rb"), std::fclose) {
  std::error_code unknown;
  if (file_ && std::filesystem::is_directory(path, unknown)) {
    file_.reset();
    errno = EISDIR;
  }
  if (!file_) throw std::runtime_error(path + ": cannot read the log: " + std::strerror(errno));
}

bool LogFile::read() {
  const std::uint64_t begin = at_;
  std::optional<std::uint64_t> unfinished;
  while (find_sync()) {
    const std::uint64_t start = at_ - kSyncSize;
    const Found found = read_event();
    if (found == Found::kEvent) {
      note_damage(begin, start);
      offset_ = start;
      return true;
    }
    // Either the file ends too early, or the length is wrong: then there is another sync word.
    unfinished = found == Found::kCut ? std::optional(start) : std::nullopt;
  }
  if (!unfinished && at_ > begin && at_ - begin < kSyncSize) unfinished = begin;
  note_damage(begin, unfinished.value_or(at_));
  if (unfinished) damage_.cut = unfinished;
  return false;
}

void LogFile::seek(std::uint64_t offset) {
  if (fseeko(file_.get(), static_cast<off_t>(offset), SEEK_SET) == 0) at_ = offset;
}

bool LogFile::find_sync() {
  std::uint32_t word = 0;
  while (word != kSync) {
    const int byte = std::fgetc(file_.get());
    if (byte == EOF) return false;
    ++at_;
    word = word << 8 | static_cast<std::uint32_t>(byte);
  }
  return true;
}

LogFile::Found LogFile::read_event() {
  std::array<std::uint8_t, kHeaderSize> header{};
  if (!take(header.data(), header.size())) return Found::kCut;
  event_.utime = static_cast<std::int64_t>(read_big_endian(header.data() + 8, 8));
  const std::uint64_t channel = read_big_endian(header.data() + 16, 4);
  event_.size = read_big_endian(header.data() + 20, 4);
  if (channel < 1 || channel > kLongestChannel) return Found::kDamage;
  if (!may_hold(channel + event_.size)) return Found::kCut;
  event_.channel.resize(channel);
  event_.data.resize(event_.size <= kMaxMessageSize ? event_.size : 0);
  const bool whole = take(event_.channel.data(), channel) &&
                     take(event_.data.data(), event_.data.size()) &&
                     skip(event_.size - event_.data.size());
  return whole ? Found::kEvent : Found::kCut;
}

bool LogFile::take(void* bytes, std::size_t count) {
  const std::size_t got = count == 0 ? 0 : std::fread(bytes, 1, count, file_.get());
  at_ += got;
  return got == count;
}

bool LogFile::skip(std::uint64_t count) {
  std::array<std::uint8_t, 4096> part{};
  while (count > 0) {
    const auto next = static_cast<std::size_t>(std::min<std::uint64_t>(count, part.size()));
    if (!take(part.data(), next)) return false;
    count -= next;
  }
  return true;
}

bool LogFile::may_hold(std::uint64_t count) {
  if (at_ + count > known_size_) known_size_ = size_of(path_).value_or(at_ + count);
  return at_ + count <= known_size_;
}

void LogFile::note_damage(std::uint64_t begin, std::uint64_t end) {
  if (begin == end) return;
  if (damage_.places == 0) damage_.first = begin;
  ++damage_.places;
  damage_.skipped += end - begin;
}

std::string describe(const LogFile::Damage& damage) {
  std::string text;
  if (damage.places > 0) {
    text = "damaged at byte " + std::to_string(damage.first) +
           (damage.places == 1
                ? ""
                : " and " + std::to_string(damage.places - 1) + " more times after it") +
           ", " + std::to_string(damage.skipped) + " bytes skipped";
  }
  if (damage.cut) {
    text += std::string(text.empty() ? "" : "; ") + "cut off in the event at byte " +
            std::to_string(*damage.cut);
  }
  return text;
}

}  // namespace dashpot::lcmtypes
