#include <dashpot/apps/check_model/config_change.hpp>
#include <dashpot/text/printable.hpp>

#include <yaml-cpp/yaml.h>
#include <algorithm>
#include <stdexcept>

namespace dashpot::apps {
namespace {

/// The end of the flow collection or quoted scalar that begins at `at`.
std::size_t end_of_bracket(const std::string& text, std::size_t at) {
  int depth = 0;
  char quote = 0;
  for (; at < text.size(); ++at) {
    const char c = text[at];
    if (quote != 0) {
      if (c == '\\' && quote == '"')
        ++at;
      else if (c == quote)
        quote = 0;
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (c == '#' && at > 0 && (text[at - 1] == ' ' || text[at - 1] == '\n')) {
      at = text.find('\n', at);
      if (at == std::string::npos) break;
    } else if (c == '[' || c == '{') {
      ++depth;
    } else if (c == ']' || c == '}') {
      --depth;
    }
    if (depth == 0 && quote == 0) return at + 1;
  }
  throw std::invalid_argument("no end");
}

/// The end of the value that begins at `at`.
std::size_t end_of_value(const std::string& text, std::size_t at, bool in_flow) {
  if (at >= text.size()) throw std::invalid_argument("no value");
  if (std::string_view("[{\"'").find(text[at]) != std::string_view::npos) {
    return end_of_bracket(text, at);
  }
  if (std::string_view("-|>&*!").find(text[at]) != std::string_view::npos &&
      (at + 1 >= text.size() || text[at] != '-' || text[at + 1] == ' ')) {
    throw std::invalid_argument("no plain value");
  }
  std::size_t end = text.find('\n', at);
  end = std::min({end == std::string::npos ? text.size() : end, text.find(" #", at)});
  if (in_flow) end = std::min(end, text.find_first_of(",}]", at));
  while (end > at && (text[end - 1] == ' ' || text[end - 1] == '\r')) --end;
  return end;
}

bool is_flow(const std::string& text, const YAML::Node& map) {
  const int at = map.Mark().pos;
  return at >= 0 && static_cast<std::size_t>(at) < text.size() &&
         text[static_cast<std::size_t>(at)] == '{';
}

/// Changes one key in the text. Throws if it cannot.
void change(std::string& text, const ConfigChange& wanted) {
  YAML::Node node = YAML::Load(text);
  bool in_flow = is_flow(text, node);
  std::size_t depth = 0;
  for (; depth < wanted.path.size(); ++depth) {
    const YAML::Node next = node[wanted.path[depth]];
    if (!next.IsDefined()) break;
    if (depth + 1 < wanted.path.size() && !next.IsMap()) throw std::invalid_argument("no mapping");
    node.reset(next);
    if (node.IsMap()) in_flow = in_flow || is_flow(text, node);
  }
  const auto at = static_cast<std::size_t>(node.Mark().pos);
  if (depth == wanted.path.size()) {
    text.replace(at, end_of_value(text, at, in_flow) - at, wanted.value);
    return;
  }
  std::string entry = wanted.path[depth] + ": ", closing;
  for (++depth; depth < wanted.path.size(); ++depth) {
    entry += "{" + wanted.path[depth] + ": ";
    closing += "}";
  }
  entry += wanted.value + closing;
  if (is_flow(text, node)) {
    text.insert(at + 1, entry + (node.size() > 0 ? ", " : ""));
  } else {
    if (node.size() == 0) throw std::invalid_argument("nothing to stand before");
    text.insert(at, entry + "\n" + std::string(static_cast<std::size_t>(node.Mark().column), ' '));
  }
}

bool equal(const YAML::Node& a, const YAML::Node& b) {
  if (a.Type() != b.Type()) return false;
  if (a.IsScalar()) return a.Scalar() == b.Scalar();
  if (a.IsSequence()) {
    if (a.size() != b.size()) return false;
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (!equal(a[i], b[i])) return false;
    }
  }
  if (a.IsMap()) {
    if (a.size() != b.size()) return false;
    for (const auto& entry : a) {
      const YAML::Node other = b[entry.first.Scalar()];
      if (!other.IsDefined() || !equal(entry.second, other)) return false;
    }
  }
  return true;
}

void set(YAML::Node node, const ConfigChange& wanted, std::size_t depth = 0) {
  if (depth + 1 == wanted.path.size()) {
    node.remove(wanted.path[depth]);  // otherwise the node that an alias names changes as well
    node[wanted.path[depth]] = YAML::Load(wanted.value);
  } else {
    set(node[wanted.path[depth]], wanted, depth + 1);
  }
}

}  // namespace

std::string changed_config(const std::string& text, const std::vector<ConfigChange>& changes,
                           bool& kept) {
  YAML::Node document = YAML::Load(text);
  for (const ConfigChange& one : changes) set(document, one);
  kept = true;
  try {
    std::string result = text;
    for (const ConfigChange& one : changes) change(result, one);
    if (equal(YAML::Load(result), document)) return result;
  } catch (const std::exception&) {  // treated like a wrong result
  }
  kept = false;
  YAML::Emitter emitter;
  emitter << document;
  return std::string(emitter.c_str()) + "\n";
}

std::string yaml_list(const Eigen::VectorXd& values) {
  std::string list;
  for (const double value : values) list += (list.empty() ? "" : ", ") + text::number(value, 5);
  return "[" + list + "]";
}

}  // namespace dashpot::apps
