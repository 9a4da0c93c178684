#pragma once
// Links and headings of Markdown text, as far as the documents use them.

#include <cctype>
#include <map>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

namespace dashpot::tests {

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
