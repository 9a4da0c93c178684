#pragma once
// The rules of the source tree, as functions of text so that the tests can show them failing.

#include <algorithm>
#include <regex>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

namespace dashpot::tests {

struct Layer {
  std::string_view directory;
  std::vector<std::string_view> may_include;  ///< how an included name may begin; "" is anything
};

/// Who may include whom. Headers of the standard library ("vector") are open to all.
inline const std::vector<Layer>& layers() {
  static const std::vector<Layer> table = {
      {"text", {"dashpot/text/", "fcntl.h", "sys/stat.h", "unistd.h"}},
      {"analysis", {"dashpot/analysis/", "Eigen/"}},
      {"controller",
       {"dashpot/controller/", "dashpot/analysis/", "dashpot/text/", "Eigen/", "kdl/", "urdf_",
        "console_bridge/", "yaml-cpp/", "stdint.h", "pthread.h",
        "sched.h"}},  // plugin.h is C; threads have priorities
      // an independent check of the two above, which shares no mechanics with them:
      {"sim", {"dashpot/sim/", "dashpot/text/", "Eigen/", "urdf_", "console_bridge/"}},
      {"lcmtypes",
       {"dashpot/lcmtypes/", "dashpot/analysis/types.hpp", "dashpot/controller/types.hpp",
        "dashpot/controller/snapshot.hpp", "dashpot/controller/latest.hpp", "Eigen/", "lcm/"}},
      {"apps", {""}},
      {"examples", {"dashpot/", "stdio.h"}},
      {"tests", {""}},
      {"benchmarks", {""}},
  };
  return table;
}

/// Whether a file of the top directory `directory` may include `header` ("Eigen/Core").
inline bool may_include(std::string_view directory, std::string_view header) {
  if (header.find_first_of("./") == std::string_view::npos) return true;  // standard library
  return std::any_of(layers().begin(), layers().end(), [&](const Layer& layer) {
    return layer.directory == directory &&
           std::any_of(layer.may_include.begin(), layer.may_include.end(),
                       [&](std::string_view prefix) { return header.starts_with(prefix); });
  });
}

/// Every include in the source text of a file of `directory` that is not allowed there. Headers in
/// quotes never are: the line <dashpot/...> works in the tree and installed.
inline std::vector<std::string> forbidden_includes(std::string_view directory,
                                                   const std::string& text) {
  static const std::regex include(R"re(^\s*#\s*include\s*([<"])([^>"]+)[>"].*)re");
  std::vector<std::string> found;
  std::istringstream lines(text);
  std::smatch match;
  for (std::string line; std::getline(lines, line);) {
    if (line.find('#') == std::string::npos || !std::regex_match(line, match, include)) continue;
    if (match[1] == "\"" || !may_include(directory, match[2].str())) found.push_back(line);
  }
  return found;
}

/// Every piece of text that belongs in no file: paths of one machine, notes of unfinished work.
inline std::vector<std::string> forbidden_words(const std::string& text) {
  using namespace std::string_literals;  // each in two halves, so that this file passes too
  static const std::vector<std::string> words = {"/"s + "work/", "/"s + "home/", "/"s + "root/",
                                                 "TO"s + "DO", "FIX"s + "ME"};
  std::vector<std::string> found;
  std::copy_if(words.begin(), words.end(), std::back_inserter(found),
               [&](const std::string& word) { return text.find(word) != std::string::npos; });
  return found;
}

/// Whether the source text can start threads itself.
inline bool includes_threads(const std::string& text) {
  static const std::regex include(R"re((^|\n)\s*#\s*include\s*<(thread|future|pthread\.h)>)re");
  return std::regex_search(text, include);
}

inline bool starts_with_pragma_once(std::string_view text) {
  return text.starts_with("#pragma once\n");
}

}  // namespace dashpot::tests
