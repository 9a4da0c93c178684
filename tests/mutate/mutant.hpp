#pragma once
// Which of the changes made on purpose is in force: included by the sources that `./run mutate`
// changes, in its copy of the tree, and by nothing else.

#include <fcntl.h>
#include <unistd.h>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <string>

namespace dashpot_mutants {

constexpr int kMost = 20000;

/// The change in force, from the environment: 0 for none. Like the record below it is there when a
/// constant of some source asks for it before main.
inline int active() {
  static const int number = [] {
    const char* const text = std::getenv("DASHPOT_MUTANT");
    return text == nullptr ? 0 : std::atoi(text);
  }();
  return number;
}

/// Which changes were reached, appended to a file at the end of the process.
class Record {
 public:
  Record() : path_(std::getenv("DASHPOT_MUTANTS_REACHED")) {}
  Record(const Record&) = delete;
  Record& operator=(const Record&) = delete;
  ~Record() {
    if (path_ == nullptr) return;
    std::string text;
    for (int k = 0; k < kMost; ++k) {
      if (reached_[static_cast<std::size_t>(k)].load(std::memory_order_relaxed)) {
        text += std::to_string(k) + "\n";
      }
    }
    const int file = open(path_, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
    if (file < 0 || write(file, text.data(), text.size()) < 0) std::abort();
    close(file);
  }
  bool wanted() const noexcept { return path_ != nullptr; }
  void add(int k) noexcept {
    reached_[static_cast<std::size_t>(k)].store(true, std::memory_order_relaxed);
  }

 private:
  const char* path_;
  std::array<std::atomic<bool>, kMost> reached_{};
};
inline Record& record() {
  static Record all;
  return all;
}

}  // namespace dashpot_mutants

/// Whether change k is in force.
inline bool dashpot_mutant(int k) noexcept {
  if (dashpot_mutants::record().wanted()) [[unlikely]]
    dashpot_mutants::record().add(k);
  return k == dashpot_mutants::active();
}

/// Eigen's expressions as matrices, so that a sum and a difference have the same type.
template <class T>
auto dashpot_plain(const T& x) {
  if constexpr (requires { x.eval(); }) {
    return x.eval();
  } else {
    return x;
  }
}
