#pragma once
#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

namespace dashpot::controller {

/// `text` with control characters replaced, so that it takes one line and is printed whole.
inline std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(),
      [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, ' ');
  return text;
}

/// Something in a file that the user wrote is wrong; said in one line. The program ends with
/// status 2. what() is "FILE: KEY: reason (line N)", without the parts that are not known.
class InputError : public std::runtime_error {
 public:
  /// `line` counts from 1; 0 if not known.
  InputError(std::string key, std::string reason, int line = 0)
      : InputError("", std::move(key), std::move(reason), line) {}

  /// The same error with the file's name in front.
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

}  // namespace dashpot::controller
