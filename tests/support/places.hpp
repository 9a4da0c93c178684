#pragma once
// Places in the tree and in the build. Their paths are compiled into places.cpp alone, so that all
// other files are compiled alike in every folder, and ccache finds them again.

#include <string>

namespace dashpot::places {

/// A path that a program was built with.
class Place {
 public:
  explicit constexpr Place(const char* path) : path_(path) {}
  const char* path() const { return path_; }
  /// Appends to the path.
  friend std::string operator/(const Place& place, const char* end) {
    return place.path_ + std::string(end);
  }

 private:
  const char* path_;
};

extern const Place kSourcePlace;   ///< the source tree
extern const Place kDataPlace;     ///< tests/data
extern const Place kProgramPlace;  ///< the program dashpot
extern const Place kPluginPlace;   ///< the plugin

}  // namespace dashpot::places

// Strings; one that follows is appended: DASHPOT_SOURCE_DIR "/sim/models".
#define DASHPOT_SOURCE_DIR ::dashpot::places::kSourcePlace / ""
#define DASHPOT_TEST_DATA_DIR ::dashpot::places::kDataPlace / ""
#define DASHPOT_PROGRAM ::dashpot::places::kProgramPlace.path()
#define DASHPOT_PLUGIN ::dashpot::places::kPluginPlace.path()
