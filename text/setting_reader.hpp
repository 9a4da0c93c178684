#pragma once
// Reads one setting each. Where the key is not there, the value keeps what it holds: its default.
// Everything wrong is an InputError that names key, entry, value, unit and line.

#include <dashpot/text/aligned_eigen.hpp>
#include <dashpot/text/range.hpp>
#include <dashpot/text/yaml_document.hpp>

#include <array>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace dashpot::text {

inline constexpr double kNoNone = std::numeric_limits<double>::quiet_NaN();

/// SI units, one for each entry of a vector.
using Units = std::vector<std::string>;

/// Not empty.
void read_text(const YamlMapping& keys, std::string_view key, std::string& value);
/// true or false
void read_switch(const YamlMapping& keys, std::string_view key, bool& value);
/// A whole number from `lowest` to a million.
void read_count(const YamlMapping& keys, std::string_view key, int lowest, int& value);
/// A number in the range, or, unless `none` is NaN, the word none, which sets `none`.
void read_number(const YamlMapping& keys, std::string_view key, const std::string& unit,
                 const Range& range, double& value, double none = kNoNone);
/// units.size() such entries: a list, or one for all if they have the same unit.
void read_numbers(const YamlMapping& keys, std::string_view key, const Units& units,
                  const Range& range, Eigen::Ref<Eigen::VectorXd> value, double none = kNoNone);

/// A list of three numbers in one unit.
void read_vector3(const YamlMapping& keys, std::string_view key, const std::string& unit,
                  Eigen::Vector3d& value);

/// units.size() rows: a list of rows (numbers in SI units), or the diagonal, as in read_numbers;
/// `units` belong to the diagonal.
void read_matrix(const YamlMapping& keys, std::string_view key, const Units& units,
                 Eigen::Ref<Eigen::MatrixXd> value);

/// The index of the word in `node` among `words`. In an error, `place` says which entry it is.
std::size_t find_word(const YamlMapping& keys, std::string_view key, const YamlNode& node,
                      std::span<const std::string_view> words, const std::string& place = "");

/// One of several words, each with what it stands for.
template <class Value, std::size_t Count>
void read_choice(const YamlMapping& keys, std::string_view key,
                 const std::array<std::pair<std::string_view, Value>, Count>& choices,
                 Value& value) {
  const YamlNode* node = keys.find(key);
  if (node == nullptr) return;
  std::array<std::string_view, Count> words;
  for (std::size_t i = 0; i < Count; ++i) words[i] = choices[i].first;
  value = choices[find_word(keys, key, *node, words)].second;
}

}  // namespace dashpot::text
