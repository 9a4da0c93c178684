#pragma once
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace dashpot::apps {

/// A file to write that the user has named with an option, or no file.
class OutputFile {
 public:
  OutputFile() = default;
  /// Opens `path` unless it is empty. Throws InputError that names `option` and the path.
  OutputFile(const std::string& option, const std::string& path);

  explicit operator bool() const noexcept { return file_ != nullptr; }
  /// Writes text. Throws std::runtime_error that names option, path and reason, such as a full
  /// disk.
  void write(std::string_view text);
  /// Passes all that was written to the system. Throws likewise.
  void flush();
  /// Flushes and closes, if a file is open. Throws likewise.
  void finish();

 private:
  [[noreturn]] void fail() const;

  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_{nullptr, std::fclose};
  std::string name_;  ///< option and path
};

/// A file that the user has named.
struct NamedFile {
  std::string what;  ///< the option or argument that names it: "--csv", "the scene"
  std::string path;  ///< "" if it is not named, "-" for standard input
};

/// Throws InputError if one of `outputs` is the same file as an input or another output, also
/// through links: opening it would empty the input. Devices and pipes may be the same by different
/// names.
void check_outputs(const std::vector<NamedFile>& outputs, const std::vector<NamedFile>& inputs);

/// Adds the records of one experiment to the inputs. Throws InputError, with both names, if one is
/// a copy of another: a record that counts twice makes deviations too narrow.
void add_records(const std::vector<std::string>& files, std::vector<NamedFile>& inputs);

/// Returns text between single quotes for gnuplot.
std::string quoted_for_gnuplot(const std::string& text);

/// Throws InputError unless the path that the user gave with `--plot` ends with .svg or .png and
/// its folder exists.
void check_plot_name(const std::string& path);

/// The first lines of a gnuplot script that draws to `path`, `width` x `height` pixels.
std::string plot_heading(const std::string& path, int width, int height);

/// Draws a script that begins with plot_heading. Throws std::runtime_error if gnuplot is missing or
/// fails.
void run_gnuplot(const std::string& path, const std::string& script);

}  // namespace dashpot::apps
