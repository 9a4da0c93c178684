#pragma once
#include <string>
#include <vector>

namespace dashpot::text {

/// One value of a YAML document, with its place. Aliases are already replaced by what they name.
struct YamlNode {
  enum class Kind { kNull, kScalar, kSequence, kMap };
  Kind kind = Kind::kNull;
  bool quoted = false;          ///< a scalar in quotes: text, whatever it looks like
  int line = 0;                 ///< counts from 1
  std::string text;             ///< of a scalar
  std::vector<YamlNode> items;  ///< of a sequence; of a map key, value, key, value, ...
};

/// The bytes of the file at `path`, or of standard input if it is "-". Throws InputError.
std::string read_input(const std::string& path);

/// Reads a regular file; rejects pipes and devices, which may never end or keep the caller waiting.
std::string read_regular_file(const std::string& path);

/// Parses text that holds one YAML (or JSON) document. Throws InputError on anything else, and on
/// text that is too large or too deeply nested to be what Dashpot reads.
YamlNode parse_yaml(const std::string& text);
/// The same, of text that a program made: errors name no lines.
YamlNode parse_made_yaml(const std::string& text);

}  // namespace dashpot::text
