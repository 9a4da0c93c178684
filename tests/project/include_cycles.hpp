#pragma once
// Cycles among sources that include each other.

#include <map>
#include <set>
#include <string>
#include <vector>

namespace dashpot::tests {

/// The targets of each name.
using Arrows = std::map<std::string, std::set<std::string>>;

/// Looks for cycles from one name after the other.
class CycleFinder {
 public:
  explicit CycleFinder(const Arrows& arrows) : arrows_(arrows) {}

  /// The names of a cycle, each of which points to the next and the last to the first; empty if
  /// there is none.
  std::vector<std::string> find() {
    for (const auto& [name, to] : arrows_) {
      if (closes(name)) return path_;
    }
    return {};
  }

 private:
  /// Whether a cycle is reached from `name`; it is then in `path_`.
  bool closes(const std::string& name) {
    for (auto at = path_.begin(); at != path_.end(); ++at) {
      if (*at != name) continue;
      path_.erase(path_.begin(), at);
      return true;
    }
    if (!visited_.insert(name).second) return false;
    path_.push_back(name);
    const auto to = arrows_.find(name);
    if (to != arrows_.end()) {
      for (const std::string& next : to->second) {
        if (closes(next)) return true;
      }
    }
    path_.pop_back();
    return false;
  }

  const Arrows& arrows_;
  std::set<std::string> visited_;
  std::vector<std::string> path_;
};

/// "a -> b -> a", or "" if there is no cycle.
inline std::string cycle_text(const Arrows& arrows) {
  const std::vector<std::string> cycle = CycleFinder(arrows).find();
  std::string text;
  for (const std::string& name : cycle) text += name + " -> ";
  return cycle.empty() ? text : text + cycle.front();
}

}  // namespace dashpot::tests
