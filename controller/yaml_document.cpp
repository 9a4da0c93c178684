#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/yaml_document.hpp>

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <sstream>
#include <utility>

namespace dashpot::controller {
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
    // The mark of a value that is not there is that of what follows: its key's line says more.
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
    count(found->second.values, mark);
    attach(YamlNode(found->second.node));
  }

 private:
  struct Open {
    YamlNode node;
    YAML::anchor_t anchor;
    std::size_t values_before;
  };
  struct Anchored {
    YamlNode node;
    std::size_t values;
  };

  void count(std::size_t values, const YAML::Mark& mark) {
    values_ += values;
    if (values_ > kMostValues) {
      throw InputError("", "holds more than 4000000 values", mark.line + 1);
    }
  }

  YamlNode& open(YamlNode::Kind kind, const YAML::Mark& mark, YAML::anchor_t anchor) {
    if (open_.size() >= kDeepestNesting) throw InputError("", "nested too deeply", mark.line + 1);
    const std::size_t before = values_;
    count(1, mark);
    open_.push_back(
        {YamlNode{.kind = kind, .line = mark.line + 1, .text = {}, .items = {}}, anchor, before});
    return open_.back().node;
  }

  void close() {
    Open done = std::move(open_.back());
    open_.pop_back();
    if (done.anchor != 0) {
      anchored_.insert_or_assign(done.anchor, Anchored{done.node, values_ - done.values_before});
    }
    attach(std::move(done.node));
  }

  void attach(YamlNode&& node) {
    (open_.empty() ? root_ : open_.back().node.items.emplace_back()) = std::move(node);
  }

  YamlNode root_;
  std::vector<Open> open_;
  std::map<YAML::anchor_t, Anchored> anchored_;
  std::size_t values_ = 0;
};

}  // namespace

std::string read_file(const std::string& path) {
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

YamlNode parse_yaml(const std::string& text) {
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
    throw InputError("", "is not YAML: " + error.msg, error.mark.line + 1);
  }
}

}  // namespace dashpot::controller
