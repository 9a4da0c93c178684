#include <dashpot/text/printable.hpp>
#include <dashpot/text/xml_check.hpp>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>

namespace dashpot::text {
namespace {

constexpr std::size_t kDeepest = 64;  // URDF has 5 levels; extensions for simulators some more
constexpr std::size_t kMostElements = 200'000;
constexpr std::size_t kMostAttributes = 64;  // of one element: looking one up takes linear time
constexpr std::size_t kMostParts = 2000;     // links, and joints

bool is_space(char c) noexcept {
  return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

bool begins_name(char c) noexcept {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' ||
         static_cast<unsigned char>(c) >= 0x80;
}

bool is_in_name(char c) noexcept {
  return begins_name(c) || (c >= '0' && c <= '9') || c == '-' || c == '.' || c == ':';
}

/// Reads a document from its beginning to its end.
class XmlCheck {
 public:
  XmlCheck(std::string_view text, const std::function<void(const XmlTag&)>& visit)
      : text_(text), visit_(visit) {}

  void run() {
    if (text_.size() > kLargestXml) {
      throw std::runtime_error("larger than " + std::to_string(kLargestXml >> 20) + " MiB");
    }
    while (at_ < text_.size()) {
      if (text_[at_] == '<') {
        read_markup();
      } else {
        read_character();
      }
    }
    if (!open_.empty()) fail("<" + std::string(open_.back()) + "> is not closed");
  }

 private:
  [[noreturn]] void fail(const std::string& reason) const {
    const auto end = text_.begin() + static_cast<std::ptrdiff_t>(std::min(at_, text_.size()));
    const auto line = 1 + std::count(text_.begin(), end, '\n');
    throw std::runtime_error("line " + std::to_string(line) + ": " + reason);
  }

  bool sees(std::string_view what) const { return text_.substr(at_).starts_with(what); }
  char next() const { return at_ < text_.size() ? text_[at_] : '\0'; }
  void skip_space() {
    while (is_space(next())) ++at_;
  }

  /// One character of text or of an attribute's value.
  void read_character() {
    if (sees("&#")) read_reference();
    const std::size_t length = utf8_length(text_.substr(at_));
    if (length == 0) fail("not UTF-8");
    const char c = next();
    const auto byte = static_cast<unsigned char>(c);
    if ((byte < 0x20 && !is_space(c)) || byte == 0x7F) fail("holds a control character");
    at_ += length;
  }

  /// Up to the semicolon of &#65; or &#x41;.
  void read_reference() {
    at_ += 2;
    const bool hexadecimal = next() == 'x';
    if (hexadecimal) ++at_;
    const std::size_t begin = at_;
    while (
        (next() >= '0' && next() <= '9') ||
        (hexadecimal && ((next() >= 'a' && next() <= 'f') || (next() >= 'A' && next() <= 'F')))) {
      ++at_;
    }
    const std::size_t digits = at_ - begin;
    if (digits < 1 || digits > 7 || next() != ';') fail("holds a broken character reference");
  }

  std::string_view read_name() {
    const std::size_t begin = at_;
    if (!begins_name(next())) fail("not XML");
    while (is_in_name(next())) {
      const std::size_t length = utf8_length(text_.substr(at_));
      if (length == 0) fail("not UTF-8");
      at_ += length;
    }
    return text_.substr(begin, at_ - begin);
  }

  void expect(char c) {
    if (next() != c) fail("not XML");
    ++at_;
  }

  /// Jumps behind the next `end`; what is before it has no meaning.
  void skip_past(std::string_view end) {
    const std::size_t found = text_.find(end, at_);
    if (found == std::string_view::npos) fail("not XML: '" + std::string(end) + "' is missing");
    at_ = found + end.size();
  }

  void read_markup() {
    if (sees("<!--")) {
      at_ += 4;
      skip_past("-->");
    } else if (sees("<![CDATA[")) {
      skip_past("]]>");
    } else if (sees("<!") || sees("<?")) {
      read_declaration();
    } else if (sees("</")) {
      read_end_tag();
    } else {
      read_start_tag();
    }
  }

  /// <?xml version="1.0"?> or <!DOCTYPE robot>, without anything that parsers understand in
  /// different ways.
  void read_declaration() {
    at_ += 2;
    char quote = '\0';
    while (next() != '>') {
      const char c = next();
      if (c == '\0' || c == '<' || c == '&') fail("holds a declaration that is not read");
      if ((c == '"' || c == '\'') && (quote == '\0' || quote == c)) quote = quote == c ? '\0' : c;
      read_character();
    }
    if (quote != '\0') fail("holds a declaration that is not read");
    ++at_;
  }

  void read_end_tag() {
    at_ += 2;
    const std::string_view name = read_name();
    skip_space();
    expect('>');
    if (open_.empty() || open_.back() != name) {
      fail("</" + std::string(name) + "> closes " +
           (open_.empty() ? "nothing" : "<" + std::string(open_.back()) + ">"));
    }
    open_.pop_back();
    if (visit_) visit_({name, {}, open_.size(), false, true});
  }

  void read_start_tag() {
    ++at_;
    XmlTag tag;
    tag.name = read_name();
    tag.depth = open_.size();
    tag.starts = true;
    count(tag.name);
    for (skip_space(); next() != '>' && next() != '/'; skip_space()) {
      if (tag.attributes.size() == kMostAttributes) {
        fail("an element has more than 64 attributes");
      }
      tag.attributes.push_back(read_attribute());
    }
    tag.ends = next() == '/';
    if (tag.ends) ++at_;
    expect('>');
    if (visit_) visit_(tag);
    if (tag.ends) return;
    open_.push_back(tag.name);
    if (open_.size() > kDeepest) fail("elements are nested more than 64 deep");
  }

  std::pair<std::string_view, std::string_view> read_attribute() {
    const std::string_view name = read_name();
    skip_space();
    expect('=');
    skip_space();
    const char quote = next();
    if (quote != '"' && quote != '\'') fail("not XML: an attribute's value is not in quotes");
    const std::size_t begin = ++at_;
    while (next() != quote) {
      if (next() == '<' || next() == '\0') fail("not XML: an attribute's value does not end");
      read_character();
    }
    return {name, text_.substr(begin, at_++ - begin)};
  }

  void count(std::string_view name) {
    if (++elements_ > kMostElements) fail("holds more than 200000 elements");
    if (name == "link" && ++links_ > kMostParts) fail("holds more than 2000 links");
    if (name == "joint" && ++joints_ > kMostParts) fail("holds more than 2000 joints");
  }

  std::string_view text_;
  const std::function<void(const XmlTag&)>& visit_;
  std::size_t at_ = 0;
  std::vector<std::string_view> open_;
  std::size_t elements_ = 0, links_ = 0, joints_ = 0;
};

}  // namespace

void check_xml(std::string_view text, const std::function<void(const XmlTag&)>& visit) {
  XmlCheck(text, visit).run();
}

}  // namespace dashpot::text
