#pragma once
#include <stdexcept>
#include <string>

namespace dashpot::apps {

/// From its construction on, the first SIGINT (Ctrl-C), SIGTERM or SIGHUP is noted instead of
/// ending the program.
class StopSignal {
 public:
  StopSignal();
  static bool given();
};

/// While it exists, the same signals end the program at once, with "dashpot WHAT: interrupted" on
/// standard error and exit status 130: for a task without results before its end. One at a time.
class EndOnSignal {
 public:
  explicit EndOnSignal(const std::string& what);
  ~EndOnSignal();
  EndOnSignal(const EndOnSignal&) = delete;
  EndOnSignal& operator=(const EndOnSignal&) = delete;
};

/// Ends the program with exit status 130, as shells report Ctrl-C, after the results so far were
/// printed. The message says how much was done.
class Interrupted : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Whether standard output is a terminal.
bool on_terminal();

/// Shows on the last line of a terminal how much of a task is done, from 0 to 1, and `note` behind
/// it: now and then, once the task takes longer than a second. Does nothing if standard error is
/// not a terminal. One thread at a time.
void show_progress(double done, const std::string& note = "");
/// Clears that line; the next one belongs to another task. show_progress(1) and all printing clear
/// it as well.
void clear_progress();

/// Calls `call` with each of `items`, showing how many are done, until Ctrl-C, which takes effect
/// from the second item on. Returns "" if all are done, otherwise "3 of 9 WHAT are done".
template <class Items, class Call>
std::string for_each_shown(const Items& items, const Call& call, const std::string& what) {
  if (items.size() < 2) {
    for (const auto& item : items) call(item);
    return "";
  }
  const StopSignal stop;
  std::size_t done = 0;
  for (const auto& item : items) {
    if (done > 0 && StopSignal::given()) {
      return std::to_string(done) + " of " + std::to_string(items.size()) + " " + what +
             " are done";
    }
    show_progress(static_cast<double>(done++) / static_cast<double>(items.size()));
    call(item);
  }
  return "";
}

/// The whole terminal for a text that is drawn repeatedly in its place; the previous contents come
/// back at the end.
class FullScreen {
 public:
  FullScreen();
  ~FullScreen();
  FullScreen(const FullScreen&) = delete;
  FullScreen& operator=(const FullScreen&) = delete;

  /// Draws as much of `text` as fits. Parts that come from elsewhere must be printable.
  void draw(const std::string& text);
};

}  // namespace dashpot::apps
