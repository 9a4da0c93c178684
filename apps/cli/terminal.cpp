#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>

#include <sys/ioctl.h>
#include <unistd.h>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <sstream>

namespace dashpot::apps {
namespace {

using Clock = std::chrono::steady_clock;

/// The task whose progress is shown.
struct {
  Clock::time_point begin, shown_at;
  bool begun = false, shown = false;
} task;

std::atomic<bool> stop_given = false;  // other threads read it
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler writes it");

void note_stop(int /*signal*/) {
  stop_given = true;
}

std::string last_words;  // of a program that ends at once; a signal handler reads it

void end_now(int /*signal*/) {
  const ssize_t written = write(STDERR_FILENO, last_words.data(), last_words.size());
  _exit(written < 0 ? 1 : 130);
}

/// Installs a handler of the signals that end a program from outside.
void handle_ends(void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = static_cast<int>(SA_RESETHAND);  // a second one ends the program
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  struct sigaction hangup {};  // the terminal is gone; under nohup that is ignored
  if (sigaction(SIGHUP, nullptr, &hangup) == 0 && hangup.sa_handler != SIG_IGN) {
    sigaction(SIGHUP, &action, nullptr);
  }
}

/// Rows of the terminal.
int height() {
  winsize size{};
  return ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_row > 0 ? size.ws_row : 24;
}

}  // namespace

StopSignal::StopSignal() {
  handle_ends(note_stop);
}

EndOnSignal::EndOnSignal(const std::string& what) {
  last_words =
      (isatty(STDERR_FILENO) != 0 ? "\r\033[K" : "") + ("dashpot " + what) + ": interrupted\n";
  handle_ends(end_now);
}

EndOnSignal::~EndOnSignal() {
  handle_ends(SIG_DFL);
}

bool StopSignal::given() {
  return stop_given;
}

bool on_terminal() {
  return isatty(STDOUT_FILENO) != 0;
}

void show_progress(double done, const std::string& note) {
  constexpr auto kQuick = std::chrono::seconds(1);  // shorter tasks show no progress
  constexpr auto kRedraw = std::chrono::milliseconds(100);
  constexpr std::size_t kWidth = 40;
  if (!(done < 1)) return clear_progress();
  if (isatty(STDERR_FILENO) == 0) return;
  const auto now = Clock::now();
  if (!task.begun) task = {now, now, true, false};
  if (now - task.begin < kQuick || (task.shown && now - task.shown_at < kRedraw)) return;
  task.shown_at = now;
  task.shown = true;
  const auto filled = static_cast<std::size_t>(kWidth * std::max(0.0, done));
  const std::string bar = std::string(filled, '#') + std::string(kWidth - filled, ' ');
  std::fprintf(stderr, "\r\033[K[%s] %2.0f %%%s%s", bar.c_str(), std::floor(100 * done),
               note.empty() ? "" : ", ", note.c_str());
}

void clear_progress() {
  if (task.shown) std::fputs("\r\033[K", stderr);
  task = {};
}

// Second screen, cursor hidden, long lines cut off instead of wrapped; and back.
FullScreen::FullScreen() {
  print_styled("\033[?1049h\033[?25l\033[?7l");
}

FullScreen::~FullScreen() {
  try {
    print_styled("\033[?7h\033[?25h\033[?1049l");
  } catch (...) {  // the terminal is gone
  }
}

void FullScreen::draw(const std::string& text) {
  std::istringstream lines(text);
  std::string out = "\033[H";
  int row = 0;
  for (std::string line; row < height() - 1 && std::getline(lines, line); ++row) {
    out += line + "\033[K\r\n";
  }
  print_styled(out + "\033[J");
}

}  // namespace dashpot::apps
