#pragma once
// The files of the source tree.

#include <dashpot/tests/support/places.hpp>

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

namespace dashpot::tests {

struct File {
  std::string path;  ///< from the top of the tree, "analysis/matrix_types.hpp"
  std::string text;

  bool is_source() const { return has_end(".hpp") || has_end(".cpp") || has_end(".h"); }
  bool has_end(std::string_view end) const { return path.ends_with(end); }
};

inline bool is_hidden_or_built(const std::string& name) {
  return (name.starts_with(".") && name != ".ci") || name.starts_with("build");
}

/// All text files outside hidden directories and the build.
inline const std::vector<File>& files() {
  static const std::vector<File> all = [] {
    std::vector<File> found;
    const std::filesystem::path root = DASHPOT_SOURCE_DIR;
    for (auto entry = std::filesystem::recursive_directory_iterator(root); entry != end(entry);
         ++entry) {
      if (entry->is_directory() && entry.depth() == 0 &&
          is_hidden_or_built(entry->path().filename().string())) {
        entry.disable_recursion_pending();
      }
      if (!entry->is_regular_file()) continue;
      std::ifstream stream(entry->path(), std::ios::binary);
      std::string text(std::istreambuf_iterator<char>(stream), {});
      if (text.find('\0') != std::string::npos) continue;
      found.push_back({entry->path().lexically_relative(root).string(), std::move(text)});
    }
    return found;
  }();
  return all;
}

/// Paths of the files that are so.
template <class IsSo>
std::vector<std::string> paths_of(const IsSo& is_so) {
  std::vector<std::string> paths;
  for (const File& file : files()) {
    if (is_so(file)) paths.push_back(file.path);
  }
  return paths;
}

}  // namespace dashpot::tests
