#pragma once
#include <cstddef>
#include <string>

namespace dashpot::text {

/// Returns the bytes of the file at `path`. Throws std::runtime_error with the reason ("cannot be
/// read: No such file or directory") unless it is a regular file of at most `most` bytes, because a
/// pipe or a device may keep the caller waiting, or never end.
std::string read_file(const std::string& path, std::size_t most);

}  // namespace dashpot::text
