#pragma once
// Shared by the fuzzers: bytes read as values, and a place for files.

#include <stdlib.h>  // NOLINT(modernize-deprecated-headers): mkdtemp is not standard C++
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>

/// Called by libFuzzer with each input.
// NOLINTNEXTLINE(readability-identifier-naming)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace dashpot::fuzz {

/// Ends the run, which keeps the input, unless `condition` holds.
inline void require(bool condition, const char* what) {
  if (condition) return;
  std::fprintf(stderr, "not so: %s\n", what);
  std::abort();
}

/// Values from the bytes of an input, zeros after its end.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : next_(data), left_(size) {}

  bool empty() const { return left_ == 0; }

  template <class Value>
  Value take() {
    Value value{};
    const std::size_t count = std::min(sizeof value, left_);
    if (count > 0) std::memcpy(&value, next_, count);
    next_ += count;
    left_ -= count;
    return value;
  }
  /// 0 to `most`
  unsigned up_to(unsigned most) { return take<std::uint8_t>() % (most + 1); }
  bool flag() { return (take<std::uint8_t>() & 1) != 0; }

  /// Mostly a number of ordinary size, at times one as it should never come.
  double number() {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    constexpr std::array<double, 10> kOdd = {std::numeric_limits<double>::quiet_NaN(),
                                             kInfinity,
                                             -kInfinity,
                                             1e308,
                                             -1e200,
                                             5e-324,
                                             -0.0,
                                             1e-160,
                                             1e15,
                                             -1e7};
    const unsigned kind = take<std::uint8_t>();
    if (kind < kOdd.size()) return kOdd[kind];
    if (kind < 16) return take<double>();
    return std::ldexp(take<std::int16_t>(), kind < 128 ? -13 : -5 - static_cast<int>(kind % 8));
  }

 private:
  const std::uint8_t* next_;
  std::size_t left_;
};

/// A temporary directory with the folders of the project that hold models, so that its examples
/// find them; removed at the end of the program.
class ScratchTree {
 public:
  ScratchTree() {
    std::string name = std::filesystem::temp_directory_path() / "dashpot_fuzz.XXXXXX";
    require(mkdtemp(name.data()) != nullptr, "a temporary directory can be made");
    root_ = name;
    for (const char* folder : {"sim/scenes", "controller/examples"}) {
      std::filesystem::create_directories(root_ / folder);
    }
    std::filesystem::create_directory_symlink(DASHPOT_SOURCE_DIR "/sim/models",
                                              root_ / "sim/models");
  }
  ScratchTree(const ScratchTree&) = delete;
  ScratchTree& operator=(const ScratchTree&) = delete;
  ~ScratchTree() {
    std::error_code ignored;
    std::filesystem::remove_all(root_, ignored);
  }

  /// Writes the bytes to a file of the tree, and returns its path.
  std::string write(const char* name, const std::uint8_t* data, std::size_t size) const {
    const std::string path = root_ / name;
    std::FILE* file = std::fopen(path.c_str(), "wb");
    require(file != nullptr, "a temporary file can be written");
    const bool good = std::fwrite(data, 1, size, file) == size;
    require((std::fclose(file) == 0) && good, "a temporary file can be written");
    return path;
  }

 private:
  std::filesystem::path root_;
};

}  // namespace dashpot::fuzz
