#pragma once
#include <dashpot/controller/input_error.hpp>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>

namespace dashpot::apps {

using OutputFile = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

/// A file to write, which the user has named with `option`. Throws InputError.
inline OutputFile open_output(const std::string& option, const std::string& path) {
  OutputFile file(std::fopen(path.c_str(), "w"), std::fclose);
  if (!file) {
    throw controller::InputError(option, path + ": cannot write: " + std::strerror(errno));
  }
  return file;
}

}  // namespace dashpot::apps
