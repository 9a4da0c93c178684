#pragma once
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

namespace dashpot::apps {

using OutputFile = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

/// A file to write, which the user has named with `option`. Throws InputError.
OutputFile open_output(const std::string& option, const std::string& path);

/// A file that the user has named.
struct NamedFile {
  std::string what;  ///< the option or argument that names it: "--csv", "the scene"
  std::string path;  ///< "" if it is not named, "-" for standard input
};

/// Throws InputError if one of `outputs` is the same file as an input or another output, also
/// through links: opening it would empty the input. Devices and pipes may be the same by different
/// names.
void check_outputs(const std::vector<NamedFile>& outputs, const std::vector<NamedFile>& inputs);

}  // namespace dashpot::apps
