#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/controller/input_error.hpp>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <system_error>

namespace dashpot::apps {
namespace {

namespace fs = std::filesystem;
using controller::InputError;

/// The path at which a new file is made: the end of all links.
fs::path resolved(fs::path path) {
  constexpr int kMostLinks = 40;  // Linux follows as many
  std::error_code none;
  for (int links = 0; links < kMostLinks && fs::is_symlink(path, none); ++links) {
    path = path.parent_path() / fs::read_symlink(path, none);
  }
  return fs::weakly_canonical(fs::absolute(path, none), none);
}

bool same_file(const NamedFile& one, const NamedFile& other) {
  if (one.path.empty() || other.path.empty()) return false;
  const fs::path a = one.path;
  const fs::path b = other.path == "-" ? "/dev/stdin" : other.path;
  std::error_code none;
  if (a == b) return true;  // even for a device, where two writers would mix
  if (!fs::exists(a, none) && !fs::exists(b, none)) return resolved(a) == resolved(b);
  return fs::is_regular_file(a, none) && fs::equivalent(a, b, none);
}

/// Whether regular files have the same bytes.
bool same_bytes(const std::string& one, const std::string& other) {
  std::error_code none;
  if (!fs::is_regular_file(one, none) || !fs::is_regular_file(other, none)) return false;
  if (fs::file_size(one, none) != fs::file_size(other, none)) return false;
  std::ifstream a(one, std::ios::binary), b(other, std::ios::binary);
  using Bytes = std::istreambuf_iterator<char>;
  return std::equal(Bytes(a), Bytes(), Bytes(b), Bytes());
}

}  // namespace

OutputFile::OutputFile(const std::string& option, const std::string& path)
    : name_(option + ": " + path) {
  if (path.empty()) return;
  file_.reset(std::fopen(path.c_str(), "w"));
  if (!file_) throw InputError(option, path + ": cannot write: " + std::strerror(errno));
}

void OutputFile::write(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), file_.get()) != text.size()) fail();
}

void OutputFile::flush() {
  if (std::fflush(file_.get()) != 0) fail();
}

void OutputFile::finish() {
  if (file_ && std::fclose(file_.release()) != 0) fail();
}

void OutputFile::fail() const {
  throw std::runtime_error(name_ + ": cannot write: " + std::strerror(errno));
}

void check_outputs(const std::vector<NamedFile>& outputs, const std::vector<NamedFile>& inputs) {
  std::vector<NamedFile> others = inputs;
  for (const NamedFile& output : outputs) {
    for (const NamedFile& other : others) {
      if (!same_file(output, other)) continue;
      throw InputError(output.what, "is the same file as " + other.what);
    }
    const std::string kind = fs::path(output.path).extension();
    const bool told = output.what == "--write" || output.what == "--output" ||
                      output.what == "--write-drives" || output.what == "--suggest-motion";
    std::error_code none;
    for (const char* kept : {".yaml", ".yml", ".urdf", ".xacro", ".xml"}) {
      if (told || kind != kept || !fs::exists(output.path, none)) continue;
      throw InputError(output.what, output.path + ": exists, and is not a file of this kind");
    }
    others.push_back(output);
  }
}

void add_records(const std::vector<std::string>& files, std::vector<NamedFile>& inputs) {
  for (std::size_t i = 0; i < files.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      if (!same_bytes(files[i], files[k])) continue;
      throw InputError(files[i], "is a copy of " + files[k] + ": a record counts once");
    }
    inputs.push_back({"a record", files[i]});
  }
}

}  // namespace dashpot::apps
