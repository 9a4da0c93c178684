#pragma once
#include <dashpot/text/aligned_eigen.hpp>
#include <dashpot/text/wrong_input.hpp>

#include <array>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
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

/// "a list", "'12 m'", ...: a value in an error message.
std::string describe(const YamlNode& node);

/// The keys that a YamlMapping may have.
template <class... Keys>
constexpr std::array<std::string_view, sizeof...(Keys)> key_list(Keys... keys) {
  return {keys...};
}

/// Typed access to the keys of a YAML mapping. Everything wrong is an InputError that names the key
/// (after `prefix`, such as "[2]." for the third entry of a list) and the line.
class YamlMapping {
 public:
  /// Throws if `node` is not a mapping, or has a key twice, or one that is not in `known_keys`.
  /// Refers to `node`, which has to outlive it.
  YamlMapping(const YamlNode& node, std::string prefix,
              std::span<const std::string_view> known_keys);

  bool has(std::string_view key) const { return find(key) != nullptr; }
  /// Null if the key is not there.
  const YamlNode* find(std::string_view key) const;
  /// The line of the key's value; 0 if the key is not there.
  int line(std::string_view key) const;

  /// A list of finite numbers; nothing if the key is not there.
  std::optional<Eigen::VectorXd> vector(std::string_view key) const;
  /// A list of rows, each a list of equally many finite numbers; [] is 0 x 0.
  std::optional<Eigen::MatrixXd> matrix(std::string_view key) const;
  /// A list of matrices.
  std::optional<std::vector<Eigen::MatrixXd>> matrices(std::string_view key) const;

  /// An error about the value of `key`; `line` 0 stands for the value's own line.
  InputError error(std::string_view key, const std::string& reason, int line = 0) const;

  /// The mapping under `key`; an empty one if the key is not there.
  YamlMapping mapping(std::string_view key, std::span<const std::string_view> known_keys) const;
  /// The number in `node`, which stands under `key`, in SI: see parse_quantity. In an error,
  /// `place` says which entry it is ("entry 2"; "" if it is the only one).
  double quantity(std::string_view key, const YamlNode& node, const std::string& unit,
                  const std::string& place) const;

 private:
  /// Throws unless `node` is a list; `what` says what it should list.
  void require_list(std::string_view key, const YamlNode& node, const std::string& what) const;
  double number(std::string_view key, const YamlNode& node, const std::string& place) const;
  Eigen::VectorXd vector(std::string_view key, const YamlNode& node,
                         const std::string& place) const;
  Eigen::MatrixXd matrix(std::string_view key, const YamlNode& node,
                         const std::string& place) const;

  std::string prefix_;
  std::map<std::string_view, const YamlNode*> values_;
};

}  // namespace dashpot::text
