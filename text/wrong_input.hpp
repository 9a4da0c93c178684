#pragma once
#include <dashpot/text/printable.hpp>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

namespace dashpot::text {

/// Returns `text` as one line that is safe to show in a terminal: white space becomes blanks, other
/// control characters become escapes, and a text that is too long to be read is cut off.
inline std::string one_line(std::string text) {
  constexpr std::size_t kLongest = 2000;  // bytes: names in files may have millions
  if (text.size() > kLongest) text.replace(kLongest, std::string::npos, "...");
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\r' || c == '\t'; }, ' ');
  return printable(text);
}

/// Says in one line what is wrong in a file that the user wrote. The program ends with status 2.
/// what() is "FILE: KEY: reason (line N)", without the parts that are not known.
class InputError : public std::runtime_error {
 public:
  /// `line` counts from 1; 0 if not known.
  InputError(std::string key, std::string reason, int line = 0)
      : InputError("", std::move(key), std::move(reason), line) {}

  /// Returns the same error with the file's name in front.
  InputError in_file(const std::string& file) const { return {file, key_, reason_, line_}; }

 private:
  InputError(const std::string& file, std::string key, std::string reason, int line)
      : std::runtime_error(one_line((file.empty() ? "" : file + ": ") +
                                    (key.empty() ? "" : key + ": ") + reason +
                                    (line > 0 ? " (line " + std::to_string(line) + ")" : ""))),
        key_(std::move(key)),
        reason_(std::move(reason)),
        line_(line) {}

  std::string key_;
  std::string reason_;
  int line_;
};

}  // namespace dashpot::text
