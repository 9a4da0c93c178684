#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/controller/input_error.hpp>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <system_error>

namespace dashpot::apps {

using controller::InputError;

namespace {

namespace fs = std::filesystem;

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

std::string quoted_for_gnuplot(const std::string& text) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? "''" : std::string(1, c);
  return result + "'";
}

void check_plot_name(const std::string& path) {
  if (!path.ends_with(".svg") && !path.ends_with(".png")) {
    throw controller::InputError("--plot", path + ": has to end with .svg or .png");
  }
  const auto folder = std::filesystem::path(path).parent_path();
  if (std::error_code none; !folder.empty() && !std::filesystem::is_directory(folder, none)) {
    throw controller::InputError("--plot", path + ": there is no folder " + folder.string());
  }
}

std::string plot_heading(const std::string& path, int width, int height) {
  return "set terminal " + std::string(path.ends_with(".svg") ? "svg" : "png") + " size " +
         std::to_string(width) + "," + std::to_string(height) + "\nset output " +
         quoted_for_gnuplot(path) + "\n";
}

void run_gnuplot(const std::string& path, const std::string& script) {
  const auto before = std::signal(SIGPIPE, SIG_IGN);  // gnuplot may not be there
  std::FILE* gnuplot = popen("gnuplot 2>/dev/null", "w");
  if (gnuplot == nullptr) throw std::runtime_error("--plot: cannot start gnuplot");
  const bool written = std::fwrite(script.data(), 1, script.size(), gnuplot) == script.size();
  const int status = pclose(gnuplot);
  std::signal(SIGPIPE, before);
  if (!written || status != 0) {
    throw std::runtime_error("--plot: " + path + ": gnuplot is missing or cannot draw it");
  }
}

}  // namespace dashpot::apps
