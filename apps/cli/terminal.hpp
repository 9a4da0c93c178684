#pragma once
#include <string>

namespace dashpot::apps {

/// From its construction on, the first SIGINT (Ctrl-C), SIGTERM or SIGHUP does not end the program
/// but is noted.
class StopSignal {
 public:
  StopSignal();
  static bool given();
};

/// Whether standard output is a terminal.
bool on_terminal();

/// Shows on the last line of a terminal how much is done, from 0 to 1, which clears the line again.
/// Does nothing where standard error is no terminal.
void show_progress(double done);

/// The whole terminal for a text that is drawn again and again in its place; what was there before
/// comes back at the end.
class FullScreen {
 public:
  FullScreen();
  ~FullScreen();
  FullScreen(const FullScreen&) = delete;
  FullScreen& operator=(const FullScreen&) = delete;

  /// As much of `text` as fits. What comes from elsewhere in it must be printable.
  void draw(const std::string& text);
};

}  // namespace dashpot::apps
