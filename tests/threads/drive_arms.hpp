#pragma once
// The arms that `dashpot drive` knows, and their configurations.

#include <dashpot/lcmtypes/driver.hpp>
#include <dashpot/lcmtypes/log_file.hpp>
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/sanitized.hpp>
#include <dashpot/tests/threads/live_run.hpp>

#include <gtest/gtest.h>

#include <ostream>
#include <string>
#include <utility>
#include <vector>

namespace dashpot::tests {

inline std::string configuration(const std::string& name) {
  return std::string(DASHPOT_SOURCE_DIR) + "/controller/examples/" + name + "_drive.yaml";
}

struct Arm {
  const char* name;    ///< of its files
  const char* option;  ///< "--iiwa"
  lcmtypes::DriverKind kind;
};
inline constexpr Arm kIiwa = {"iiwa14", "--iiwa", lcmtypes::DriverKind::kIiwa};
inline constexpr Arm kPanda = {"panda", "--panda", lcmtypes::DriverKind::kPanda};
inline constexpr Arm kIiwa7 = {"iiwa7", "--iiwa", lcmtypes::DriverKind::kIiwa};
inline constexpr Arm kFr3 = {"fr3", "--panda", lcmtypes::DriverKind::kPanda};

/// Two programs keep a pace of 1 kHz, which sanitizers leave no time for.
class AtPace : public ::testing::Test {
 protected:
  void SetUp() override {
    if (DASHPOT_SANITIZED) GTEST_SKIP() << "the loop has gaps then";
  }
};

inline void PrintTo(const Arm& arm, std::ostream* out) {
  *out << arm.name;
}

/// The configuration of an arm, with parts of its text replaced.
inline std::string changed_configuration(
    const Scratch& scratch, const Arm& arm,
    const std::vector<std::pair<std::string, std::string>>& changes) {
  std::string text = text_of(configuration(arm.name));
  const auto replace = [&text](const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
  };
  replace("../../sim", std::string(DASHPOT_SOURCE_DIR) + "/sim");
  for (const auto& [from, to] : changes) replace(from, to);
  return scratch.write("drive.yaml", text);
}

/// Returns the states of a log.
inline std::vector<state_t> states_of(const std::string& path) {
  std::vector<state_t> states;
  lcmtypes::LogFile log(path);
  while (log.read()) {
    if (log.event().channel != lcmtypes::kStateChannel) continue;
    states.emplace_back();
    states.back().decode(log.event().data.data(), 0, static_cast<int>(log.event().size));
  }
  return states;
}

}  // namespace dashpot::tests
