#include <dashpot/text/printable.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>

namespace dashpot::text {
namespace {

std::uint32_t byte_at(std::string_view text, std::size_t i) noexcept {
  return static_cast<unsigned char>(text[i]);
}

/// The character that the first `length` bytes encode.
std::uint32_t decode(std::string_view text, std::size_t length) noexcept {
  if (length == 1) return byte_at(text, 0);
  std::uint32_t code = byte_at(text, 0) & (0x7Fu >> length);
  for (std::size_t i = 1; i < length; ++i) code = code << 6 | (byte_at(text, i) & 0x3Fu);
  return code;
}

bool steers(std::uint32_t code) noexcept {
  return code < 0x20 || (code >= 0x7F && code < 0xA0) ||  // control characters
         code == 0xAD || code == 0x61C || code == 0xFEFF ||
         (code >= 0x200B && code <= 0x200F) ||  // invisible, or marks of direction
         (code >= 0x2028 && code <= 0x202E) ||  // separators of lines, changes of direction
         (code >= 0x2060 && code <= 0x206F) || (code >= 0xFFF9 && code <= 0xFFFB) ||
         (code >= 0xE0000 && code <= 0xE0FFF);
}

std::string escaped(const char* format, std::uint32_t code) {
  std::array<char, 16> buffer{};
  std::snprintf(buffer.data(), buffer.size(), format, static_cast<unsigned>(code));
  return buffer.data();
}

}  // namespace

std::size_t utf8_length(std::string_view text) noexcept {
  if (text.empty()) return 0;
  const std::uint32_t first = byte_at(text, 0);
  if (first < 0x80) return 1;
  const std::size_t length = first < 0xC2   ? 0
                             : first < 0xE0 ? 2
                             : first < 0xF0 ? 3
                             : first < 0xF5 ? 4
                                            : 0;
  if (length == 0 || text.size() < length) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte_at(text, i) & 0xC0u) != 0x80u) return 0;
  }
  const std::uint32_t code = decode(text, length);
  const bool overlong = (length == 3 && code < 0x800) || (length == 4 && code < 0x10000);
  const bool surrogate = code >= 0xD800 && code <= 0xDFFF;
  return overlong || surrogate || code > 0x10FFFF ? 0 : length;
}

std::string printable(std::string_view text, std::string_view kept) {
  std::string result;
  result.reserve(text.size());
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    const std::uint32_t code = length == 0 ? byte_at(text, 0) : decode(text, length);
    const std::string_view character = text.substr(0, std::max<std::size_t>(length, 1));
    const bool kept_as_it_is = length == 1 && kept.find(character) != std::string_view::npos;
    if (kept_as_it_is || (length > 0 && !steers(code))) {
      result += character;
    } else {
      result += escaped(length == 0 || code < 0x80 ? "\\x%02x" : "\\u%04x", code);
    }
    text.remove_prefix(character.size());
  }
  return result;
}

std::string number(double value, int digits) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.*g", digits, value);
  return text.data();
}

std::string fixed(double value, int decimals) {
  std::array<char, 400> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

}  // namespace dashpot::text
