#pragma once
#include <string>
#include <string_view>

namespace dashpot::text {

/// Returns `text` such that a terminal shows it and does nothing else. What could steer the
/// terminal or hide text is written as an escape: bytes below 0x20, 0x7f, and bytes that are not
/// UTF-8 as `\x1b`, and as `\u202e` the control characters from U+0080 on, separators of lines, and
/// marks that reverse or hide letters. The bytes of `kept` (newlines) stay.
std::string printable(std::string_view text, std::string_view kept = "");

/// Returns the length of the UTF-8 character at the start of `text`, 1 to 4 bytes; 0 if there is
/// none: a stray, overlong or cut sequence, a surrogate, or a number above U+10FFFF.
std::size_t utf8_length(std::string_view text) noexcept;

}  // namespace dashpot::text
