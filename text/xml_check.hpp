#pragma once
#include <cstddef>
#include <functional>
#include <string_view>
#include <utility>
#include <vector>

namespace dashpot::text {

/// Largest robot description that is read, bytes.
inline constexpr std::size_t kLargestXml = 16u << 20;

/// A start tag or an end tag; one that ends with a slash is both.
struct XmlTag {
  std::string_view name;
  /// Names with their values as they stand in the text, without the quotes.
  std::vector<std::pair<std::string_view, std::string_view>> attributes;
  std::size_t depth = 0;  ///< how many elements are open around it
  bool starts = false, ends = false;
};

/// Throws std::runtime_error with the reason and the line unless `text` is XML that a parser may
/// see. TinyXML, which urdfdom uses, calls itself for each level of nesting, so that a deep file
/// overflows the stack. The destructors of its tree do so as well, and, for long chains of links,
/// the destructors of urdfdom's tree (160 KiB for 2000 links). TinyXML also reads on beyond quotes,
/// tags and the end of the text after some malformed bytes and references. Therefore this reader
/// counts and checks first, without recursion, in one pass:
///   - at most 16 MiB, 64 elements nested, 200000 elements, 64 attributes of one element;
///   - at most 2000 elements called link, and as many called joint;
///   - tags that match, quoted attributes, no document type with declarations of its own;
///   - UTF-8 without control characters, outside of comments.
/// It does not check whether the elements mean anything. It calls `visit`, if there is one, for
/// each tag in order.
void check_xml(std::string_view text, const std::function<void(const XmlTag&)>& visit = {});

}  // namespace dashpot::text
