#include <dashpot/text/quantity.hpp>
#include <dashpot/text/yaml_mapping.hpp>

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace dashpot::text {
namespace {

std::string join(std::span<const std::string_view> words) {
  std::string text;
  for (const std::string_view word : words) {
    if (!text.empty()) text += ", ";
    text += word;
  }
  return text;
}

std::string shortened(const std::string& text) {
  constexpr std::size_t kLongest = 40;
  return text.size() > kLongest ? text.substr(0, kLongest) + "..." : text;
}

}  // namespace

std::string describe(const YamlNode& node) {
  switch (node.kind) {
    case YamlNode::Kind::kNull:
      return "nothing";
    case YamlNode::Kind::kScalar:
      return "'" + shortened(node.text) + "'";
    case YamlNode::Kind::kSequence:
      return "a list";
    case YamlNode::Kind::kMap:
      return "a mapping";
  }
  return "";
}

YamlMapping::YamlMapping(const YamlNode& node, std::string prefix,
                         std::span<const std::string_view> known_keys)
    : prefix_(std::move(prefix)) {
  const std::string place = prefix_.substr(0, prefix_.empty() ? 0 : prefix_.size() - 1);
  if (node.kind == YamlNode::Kind::kScalar && node.text.starts_with('<')) {
    throw InputError(
        place,
        "is XML, such as a robot description, where YAML is wanted: a description is "
        "named by robot.urdf, or by --urdf for dashpot inspect, design, audit and tune",
        node.line);
  }
  if (node.kind != YamlNode::Kind::kMap) {
    throw InputError(place, "a mapping of keys to values is wanted, not " + describe(node),
                     node.line);
  }
  for (std::size_t i = 0; i + 1 < node.items.size(); i += 2) {
    const YamlNode& key = node.items[i];
    if (key.kind != YamlNode::Kind::kScalar) {
      throw InputError(place, "a key is " + describe(key), key.line);
    }
    if (std::find(known_keys.begin(), known_keys.end(), key.text) == known_keys.end()) {
      throw InputError(prefix_ + shortened(key.text),
                       "unknown key; the keys are " + join(known_keys), key.line);
    }
    if (!values_.emplace(key.text, &node.items[i + 1]).second) {
      throw InputError(prefix_ + key.text, "duplicate key", key.line);
    }
  }
}

const YamlNode* YamlMapping::find(std::string_view key) const {
  const auto found = values_.find(key);
  return found == values_.end() ? nullptr : found->second;
}

int YamlMapping::line(std::string_view key) const {
  const YamlNode* node = find(key);
  return node == nullptr ? 0 : node->line;
}

InputError YamlMapping::error(std::string_view key, const std::string& reason, int line) const {
  return {prefix_ + std::string(key), reason, line > 0 ? line : this->line(key)};
}

YamlMapping YamlMapping::mapping(std::string_view key,
                                 std::span<const std::string_view> known_keys) const {
  static const YamlNode empty{.kind = YamlNode::Kind::kMap, .text = {}, .items = {}};
  const YamlNode* node = find(key);
  return {node == nullptr ? empty : *node, prefix_ + std::string(key) + ".", known_keys};
}

void YamlMapping::require_list(std::string_view key, const YamlNode& node,
                               const std::string& what) const {
  if (node.kind != YamlNode::Kind::kSequence) {
    throw error(key, what + " is wanted, not " + describe(node), node.line);
  }
}

double YamlMapping::number(std::string_view key, const YamlNode& node,
                           const std::string& place) const {
  if (node.quoted) {
    throw error(key, place + " is not a number but the text " + describe(node), node.line);
  }
  return quantity(key, node, "", place);
}

double YamlMapping::quantity(std::string_view key, const YamlNode& node, const std::string& unit,
                             const std::string& place) const {
  const std::string subject = place.empty() ? "" : place + " ";
  if (node.kind != YamlNode::Kind::kScalar) {
    throw error(key, subject + "is not a number but " + describe(node), node.line);
  }
  try {
    return parse_quantity(node.text, unit);
  } catch (const std::invalid_argument& reason) {
    throw error(key, subject + reason.what(), node.line);
  }
}

Eigen::VectorXd YamlMapping::vector(std::string_view key, const YamlNode& node,
                                    const std::string& place) const {
  Eigen::VectorXd result(static_cast<Eigen::Index>(node.items.size()));
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    result[static_cast<Eigen::Index>(i)] =
        number(key, node.items[i], place + "entry " + std::to_string(i + 1));
  }
  return result;
}

Eigen::MatrixXd YamlMapping::matrix(std::string_view key, const YamlNode& node,
                                    const std::string& place) const {
  require_list(key, node, place + "a list of rows");
  Eigen::MatrixXd result;
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    const std::string row = place + "row " + std::to_string(i + 1);
    require_list(key, node.items[i], row + ": a list of numbers");
    if (i == 0) {
      result.resize(static_cast<Eigen::Index>(node.items.size()),
                    static_cast<Eigen::Index>(node.items[0].items.size()));
    }
    if (node.items[i].items.size() != static_cast<std::size_t>(result.cols())) {
      throw error(key,
                  row + " has " + std::to_string(node.items[i].items.size()) +
                      " entries, row 1 has " + std::to_string(result.cols()),
                  node.items[i].line);
    }
    result.row(static_cast<Eigen::Index>(i)) = vector(key, node.items[i], row + ", ").transpose();
  }
  return result;
}

std::optional<Eigen::VectorXd> YamlMapping::vector(std::string_view key) const {
  const YamlNode* node = find(key);
  if (node == nullptr) return {};
  require_list(key, *node, "a list of numbers");
  return vector(key, *node, "");
}

std::optional<Eigen::MatrixXd> YamlMapping::matrix(std::string_view key) const {
  const YamlNode* node = find(key);
  if (node == nullptr) return {};
  return matrix(key, *node, "");
}

std::optional<std::vector<Eigen::MatrixXd>> YamlMapping::matrices(std::string_view key) const {
  const YamlNode* node = find(key);
  if (node == nullptr) return {};
  require_list(key, *node, "a list of matrices");
  std::vector<Eigen::MatrixXd> result;
  for (std::size_t i = 0; i < node->items.size(); ++i) {
    result.push_back(matrix(key, node->items[i], "matrix " + std::to_string(i + 1) + ": "));
  }
  return result;
}

}  // namespace dashpot::text
