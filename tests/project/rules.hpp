#pragma once
// The rules of the source tree, as functions of text so that the tests can show them failing.

#include <algorithm>
#include <regex>
#include <string>
#include <string_view>
#include <vector>

namespace dashpot::tests {

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

/// The folders that have a line in the table of the section "Rooms" of docs/architecture.md.
inline std::vector<std::string> described_rooms(const std::string& text) {
  static const std::regex line(R"re((?:^|\n)\| `([^`]+)` \| [^|\n]+ \|)re");
  const std::size_t begin = std::min(text.find("\n## Rooms\n"), text.size());
  const std::string section = text.substr(begin, text.find("\n## ", begin + 1) - begin);
  std::vector<std::string> found;
  for (std::sregex_iterator at(section.begin(), section.end(), line), end; at != end; ++at) {
    found.push_back((*at)[1].str());
  }
  return found;
}

/// The constants that a source names kLikeThis, with their values: "kLimit = 3".
inline std::vector<std::string> named_constants(const std::string& text) {
  static const std::regex statement(R"re(\bconstexpr\b[^;{}]*;)re");
  static const std::regex constant(R"re(\bk[A-Z]\w* = [^,;]+)re");
  std::vector<std::string> found;
  for (std::sregex_iterator at(text.begin(), text.end(), statement), end; at != end; ++at) {
    const std::string code = at->str();
    for (std::sregex_iterator one(code.begin(), code.end(), constant); one != end; ++one) {
      found.push_back(one->str());
    }
  }
  return found;
}

/// The same of the tables in a section of a document: | `kLimit`, `kOther` | 3, 4 | why |.
inline std::vector<std::string> tabled_constants(const std::string& text,
                                                 const std::string& section) {
  static const std::regex line(R"re(\n\| (`k[A-Z][^|]*) \| ([^|]*) \|)re");
  static const std::regex name(R"re(`(\w+)`)re"), value(R"re([^, ][^,]*)re");
  const std::size_t begin = std::min(text.find("\n## " + section + "\n"), text.size());
  const std::string part = text.substr(begin, text.find("\n## ", begin + 1) - begin);
  std::vector<std::string> found;
  for (std::sregex_iterator at(part.begin(), part.end(), line), end; at != end; ++at) {
    const std::string names = (*at)[1], values = (*at)[2];
    std::sregex_iterator of(values.begin(), values.end(), value);
    for (std::sregex_iterator one(names.begin(), names.end(), name); one != end && of != end;
         ++one, ++of) {
      found.push_back((*one)[1].str() + " = " + of->str());
    }
  }
  return found;
}

inline bool starts_with_pragma_once(std::string_view text) {
  return text.starts_with("#pragma once\n");
}

}  // namespace dashpot::tests
