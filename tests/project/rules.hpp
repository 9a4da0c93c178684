#pragma once
// The files of the source tree, and its rules as functions of text.

#include <dashpot/tests/support/places.hpp>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <sstream>
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

struct Link {
  std::string path;     ///< relative to the document; empty: the document itself
  std::string heading;  ///< anchor after '#'; empty: none
};

/// Returns the lines of a text outside of code that is fenced by ```.
inline std::vector<std::string> prose_lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  bool fenced = false;
  for (std::string line; std::getline(stream, line);) {
    const std::size_t begin = line.find_first_not_of(' ');
    const bool fence = begin != std::string::npos && line.compare(begin, 3, "```") == 0;
    if (!fence && !fenced) lines.push_back(line);
    fenced = fenced != fence;
  }
  return lines;
}

/// Returns the links to files of the tree: those without a scheme, outside of code.
inline std::vector<Link> relative_links(const std::string& text) {
  static const std::regex code("`[^`]*`"), link(R"re(\]\(([^)\s#]*)(#([^)\s]*))?\))re");
  std::string prose;  // links may go on in the next line
  for (const std::string& line : prose_lines(text)) prose += line + "\n";
  prose = std::regex_replace(prose, code, "");
  std::vector<Link> found;
  for (std::sregex_iterator at(prose.begin(), prose.end(), link), end; at != end; ++at) {
    if ((*at)[1].str().find(':') == std::string::npos) found.push_back({(*at)[1], (*at)[3]});
  }
  return found;
}

/// Returns the anchors of all headings as GitHub makes them: small letters, digits, '-' and '_',
/// and
/// '-' for a space. A heading that comes again has its number after it.
inline std::vector<std::string> anchors(const std::string& text) {
  static const std::regex heading(R"(#{1,6} +(.*))");
  std::vector<std::string> found;
  std::map<std::string, int> counts;
  std::smatch match;
  for (const std::string& line : prose_lines(text)) {
    if (!std::regex_match(line, match, heading)) continue;
    std::string anchor;
    for (const char c : match[1].str()) {
      const auto byte = static_cast<unsigned char>(c);
      if (c == ' ') {
        anchor += '-';
      } else if (std::isalnum(byte) != 0 || c == '-' || c == '_') {
        anchor += static_cast<char>(std::tolower(byte));
      }
    }
    const int count = counts[anchor]++;
    found.push_back(count == 0 ? anchor : anchor + "-" + std::to_string(count));
  }
  return found;
}

}  // namespace dashpot::tests
