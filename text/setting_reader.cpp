#include <dashpot/text/setting_reader.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <sstream>

namespace dashpot::text {
namespace {

std::string to_text(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

double number(const YamlMapping& keys, std::string_view key, const YamlNode& node,
              const std::string& unit, const Range& range, double none, const std::string& place) {
  if (!std::isnan(none) && node.text == "none") return none;
  const double value = keys.quantity(key, node, unit, place);
  if (range.has(value)) return value;
  throw keys.error(key, (place.empty() ? "" : place + " ") + complaint(range, value, unit),
                   node.line);
}

/// Calls read(node, i, place) for each entry i of a list, or for each with the same single value,
/// which makes sense only if all units are the same.
template <class Read>
void for_each_entry(const YamlMapping& keys, std::string_view key, const YamlNode& node,
                    const Units& units, const Read& read) {
  const bool list = node.kind == YamlNode::Kind::kSequence;
  const bool one_unit =
      std::adjacent_find(units.begin(), units.end(), std::not_equal_to<>()) == units.end();
  const std::string size = std::to_string(units.size());
  if (!list && !one_unit) {
    const auto other = std::find_if(units.begin(), units.end(),
                                    [&](const std::string& unit) { return unit != units[0]; });
    throw keys.error(key,
                     "is not a list, and the unit of entry 1 is " + units[0] +
                         ", the unit of entry " + std::to_string(other - units.begin() + 1) +
                         " is " + *other + "; a list of " + size + " is wanted",
                     node.line);
  }
  if (list && node.items.size() != units.size()) {
    throw keys.error(key,
                     "has " + std::to_string(node.items.size()) + " entries; a list of " + size +
                         (one_unit ? ", or one number for all, is wanted" : " is wanted"),
                     node.line);
  }
  for (std::size_t i = 0; i < units.size(); ++i) {
    read(list ? node.items[i] : node, i, list ? "entry " + std::to_string(i + 1) : "");
  }
}

}  // namespace

void read_text(const YamlMapping& keys, std::string_view key, std::string& value) {
  const YamlNode* node = keys.find(key);
  if (node == nullptr) return;
  if (node->kind != YamlNode::Kind::kScalar || node->text.empty()) {
    throw keys.error(key, "a text is wanted, not " + describe(*node));
  }
  value = node->text;
}

void read_switch(const YamlMapping& keys, std::string_view key, bool& value) {
  read_choice(keys, key,
              std::array<std::pair<std::string_view, bool>, 2>{{{"true", true}, {"false", false}}},
              value);
}

void read_count(const YamlMapping& keys, std::string_view key, int lowest, int& value) {
  constexpr double kHighest = 1e6;
  const YamlNode* node = keys.find(key);
  if (node == nullptr) return;
  const double number = keys.quantity(key, *node, "", "");
  if (number < lowest || number > kHighest || number != std::floor(number)) {
    throw keys.error(key, "is " + to_text(number) + "; a whole number, " + std::to_string(lowest) +
                              " or more, is wanted");
  }
  value = static_cast<int>(number);
}

void read_number(const YamlMapping& keys, std::string_view key, const std::string& unit,
                 const Range& range, double& value, double none) {
  const YamlNode* node = keys.find(key);
  if (node != nullptr) value = number(keys, key, *node, unit, range, none, "");
}

void read_numbers(const YamlMapping& keys, std::string_view key, const Units& units,
                  const Range& range, Eigen::Ref<Eigen::VectorXd> value, double none) {
  const YamlNode* node = keys.find(key);
  if (node == nullptr) return;
  const auto read = [&](const YamlNode& item, std::size_t i, const std::string& place) {
    value[static_cast<Eigen::Index>(i)] = number(keys, key, item, units[i], range, none, place);
  };
  for_each_entry(keys, key, *node, units, read);
}

void read_vector3(const YamlMapping& keys, std::string_view key, const std::string& unit,
                  Eigen::Vector3d& value) {
  const YamlNode* node = keys.find(key);
  if (node == nullptr) return;
  if (node->kind != YamlNode::Kind::kSequence) {
    throw keys.error(key, "a list of 3 numbers is wanted, not " + describe(*node));
  }
  read_numbers(keys, key, {unit, unit, unit}, kAnyNumber, value);
}

void read_matrix(const YamlMapping& keys, std::string_view key, const Units& units,
                 Eigen::Ref<Eigen::MatrixXd> value) {
  const YamlNode* node = keys.find(key);
  if (node == nullptr) return;
  const bool rows = node->kind == YamlNode::Kind::kSequence && !node->items.empty() &&
                    node->items[0].kind == YamlNode::Kind::kSequence;
  if (!rows) {
    Eigen::VectorXd diagonal(value.rows());
    read_numbers(keys, key, units, kAnyNumber, diagonal);
    value = diagonal.asDiagonal();
    return;
  }
  const Eigen::MatrixXd matrix = keys.matrix(key).value();
  if (matrix.rows() != value.rows() || matrix.cols() != value.cols()) {
    const std::string size = std::to_string(value.rows());
    throw keys.error(key, "is " + std::to_string(matrix.rows()) + " x " +
                              std::to_string(matrix.cols()) + "; " + size + " x " + size +
                              ", or a list of " + size + " numbers, is wanted");
  }
  value = matrix;
}

std::size_t find_word(const YamlMapping& keys, std::string_view key, const YamlNode& node,
                      std::span<const std::string_view> words, const std::string& place) {
  const auto found = std::find(words.begin(), words.end(), node.text);
  if (node.kind == YamlNode::Kind::kScalar && found != words.end()) {
    return static_cast<std::size_t>(found - words.begin());
  }
  std::string list;
  for (const std::string_view word : words) {
    list += (list.empty() ? "" : word == words.back() ? " or " : ", ") + std::string(word);
  }
  throw keys.error(key,
                   (place.empty() ? "" : place + ": ") + list + " is wanted, not " + describe(node),
                   node.line);
}

}  // namespace dashpot::text
