#include <dashpot/text/quantity.hpp>
#include <dashpot/text/yaml_document.hpp>

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace dashpot::text {
namespace {

// yaml-cpp keeps unfinished tokens (about 130 bytes each) and recurses into nested values, so both
// are limited before it sees the text. A million numbers are well within the limits.
constexpr std::size_t kLargestText = 64u << 20;
constexpr std::size_t kMostValues = 4'000'000;
constexpr int kDeepestNesting = 16;

void check_limits(const std::string& text) {
  if (text.size() > kLargestText) throw InputError("", "larger than 64 MiB");
  std::size_t values = 0;
  int depth = 0;
  int line = 1;
  for (const char c : text) {
    if (c == '\n') ++line;
    if (c == ',' || c == '[' || c == '{' || c == '\n') ++values;
    if (c == '[' || c == '{') ++depth;
    if (c == ']' || c == '}') depth = std::max(depth - 1, 0);
    // Brackets in comments and quoted text count too; hence the wide margin.
    if (depth > 8 * kDeepestNesting) throw InputError("", "nested too deeply", line);
  }
  if (values > kMostValues) throw InputError("", "holds more than 4000000 values");
}

/// Builds the tree of one document from the parser's events.
class TreeBuilder : public YAML::EventHandler {
 public:
  YamlNode take() { return std::move(root_); }

  void OnDocumentStart(const YAML::Mark& /*mark*/) override {}
  void OnDocumentEnd() override {}

  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    YamlNode& node = open(YamlNode::Kind::kNull, mark, anchor);
    // The mark of a missing value points to the next token: use its key's line.
    const YamlNode* parent = open_.size() > 1 ? &open_[open_.size() - 2].node : nullptr;
    if (parent != nullptr && parent->kind == YamlNode::Kind::kMap &&
        parent->items.size() % 2 == 1) {
      node.line = parent->items.back().line;
    }
    close();
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    YamlNode& node = open(YamlNode::Kind::kScalar, mark, anchor);
    node.quoted = tag == "!";
    node.text = value;
    count({0, value.size()}, mark.line + 1);
    close();
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& /*tag*/, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value /*style*/) override {
    open(YamlNode::Kind::kSequence, mark, anchor);
  }
  void OnSequenceEnd() override { close(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& /*tag*/, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value /*style*/) override {
    open(YamlNode::Kind::kMap, mark, anchor);
  }
  void OnMapEnd() override { close(); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    const auto found = anchored_.find(anchor);
    if (found == anchored_.end()) throw InputError("", "an alias refers to itself", mark.line + 1);
    count(found->second.size, mark.line + 1);
    attach(YamlNode(found->second.node));
  }

 private:
  /// The size of a node with all that is in it.
  struct Size {
    std::size_t values = 0;
    std::size_t text = 0;  ///< bytes
  };
  struct Open {
    YamlNode node;
    YAML::anchor_t anchor;
    Size before;
  };
  struct Anchored {
    YamlNode node;
    Size size;
  };

  /// Aliases and what is kept for them count in full: a few lines can stand for any number.
  void count(const Size& more, int line) {
    total_.values += more.values;
    total_.text += more.text;
    if (total_.values > kMostValues) throw InputError("", "holds more than 4000000 values", line);
    if (total_.text > kLargestText) throw InputError("", "holds more than 64 MiB of text", line);
  }

  YamlNode& open(YamlNode::Kind kind, const YAML::Mark& mark, YAML::anchor_t anchor) {
    if (open_.size() >= kDeepestNesting) throw InputError("", "nested too deeply", mark.line + 1);
    const Size before = total_;
    count({1, 0}, mark.line + 1);
    open_.push_back(
        {YamlNode{.kind = kind, .line = mark.line + 1, .text = {}, .items = {}}, anchor, before});
    return open_.back().node;
  }

  void close() {
    Open done = std::move(open_.back());
    open_.pop_back();
    if (done.anchor != 0) {
      const Size size{total_.values - done.before.values, total_.text - done.before.text};
      count(size, done.node.line);
      anchored_.insert_or_assign(done.anchor, Anchored{done.node, size});
    }
    attach(std::move(done.node));
  }

  void attach(YamlNode&& node) {
    (open_.empty() ? root_ : open_.back().node.items.emplace_back()) = std::move(node);
  }

  YamlNode root_;
  std::vector<Open> open_;
  std::map<YAML::anchor_t, Anchored> anchored_;
  Size total_;
};

}  // namespace

std::string read_input(const std::string& path) {
  const auto close = [](std::FILE* file) { return file == stdin ? 0 : std::fclose(file); };
  const std::unique_ptr<std::FILE, decltype(close)> file(
      path == "-" ? stdin : std::fopen(path.c_str(), "rb"), close);
  if (!file) throw InputError("", std::string("cannot be opened: ") + std::strerror(errno));
  std::string text;
  std::string part(1u << 16, '\0');
  while (text.size() <= kLargestText) {
    const std::size_t got = std::fread(part.data(), 1, part.size(), file.get());
    text.append(part, 0, got);
    if (got == 0) break;
  }
  if (std::ferror(file.get()) != 0) {
    throw InputError("", std::string("cannot be read: ") + std::strerror(errno));
  }
  return text;
}

std::string read_regular_file(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code none;  // opening it says more
  const fs::file_status status = fs::status(path, none);
  if (fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status)) {
    throw InputError("", "is not a regular file");
  }
  return read_input(path);
}

YamlNode parse_yaml(const std::string& text) {
  // gzip, zip, xz, zstd, bzip2
  for (const char* begin : {"\x1f\x8b", "PK\x03\x04", "\3757zXZ", "\x28\xb5\x2f\xfd", "BZh9"}) {
    if (text.starts_with(begin)) throw InputError("", "is compressed; unpack it first");
  }
  check_limits(text);
  try {
    std::istringstream stream(text);
    YAML::Parser parser(stream);
    TreeBuilder document;
    if (!parser.HandleNextDocument(document)) throw InputError("", "is empty");
    TreeBuilder more;
    if (parser.HandleNextDocument(more)) {
      throw InputError("", "holds several documents; give a list instead", more.take().line);
    }
    return document.take();
  } catch (const YAML::Exception& error) {
    std::istringstream lines(text);
    std::string line;
    for (int i = 0; i <= error.mark.line && std::getline(lines, line); ++i) {
    }
    const bool tab = line.substr(0, line.find_first_not_of(" \t")).find('\t') != std::string::npos;
    throw InputError("",
                     "is not YAML: " + (tab ? "a tab indents the line; YAML takes spaces"
                                            : std::string(error.msg)),
                     error.mark.line + 1);
  }
}

YamlNode parse_made_yaml(const std::string& text) {
  const auto forget_lines = [](const auto& self, YamlNode& node) -> void {
    node.line = 0;
    for (YamlNode& item : node.items) self(self, item);
  };
  YamlNode document = parse_yaml(text);
  forget_lines(forget_lines, document);
  return document;
}

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
