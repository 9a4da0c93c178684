#include <dashpot/apps/cli/gnuplot.hpp>
#include <dashpot/controller/input_error.hpp>

#include <csignal>
#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <system_error>

namespace dashpot::apps {

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
