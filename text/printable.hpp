#pragma once
#include <string>
#include <string_view>

namespace dashpot::text {

/// Returns `text` such that a terminal shows it and does nothing else. Bytes and characters that
/// could steer the terminal or hide text are written as escapes. Bytes below 0x20, 0x7f, and bytes
/// that are not UTF-8 become escapes such as `\x1b`. The control characters from U+0080 on,
/// separators of lines, and marks that reverse or hide letters become escapes such as `\u202e`. The
/// bytes of `kept` (newlines) stay.
std::string printable(std::string_view text, std::string_view kept = "");

/// Returns the length of the UTF-8 character at the start of `text`, 1 to 4 bytes. Returns 0 if
/// there is none: a stray, overlong or cut sequence, a surrogate, or a number above U+10FFFF.
std::size_t utf8_length(std::string_view text) noexcept;

/// Returns a number in at most so many significant digits ("%.*g").
std::string number(double value, int digits = 6);
/// Returns a number with so many decimals ("%.*f").
std::string fixed(double value, int decimals);

}  // namespace dashpot::text
