#pragma once
// Writes and loads configuration files for tests.

#include <dashpot/controller/config.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/refusal.hpp>
#include <dashpot/tests/support/scratch.hpp>

#include <string>

namespace dashpot::tests {

inline std::string urdf_path(const std::string& name) {
  return std::string(DASHPOT_SOURCE_DIR) + "/sim/models/" + name;
}

/// The first line of a configuration: a Panda with its hand.
inline std::string panda() {
  return "robot: {urdf: " + urdf_path("panda.urdf") + ", base: panda_link0, tip: panda_hand_tcp}\n";
}

inline controller::Config load(const std::string& text) {
  const Scratch scratch;
  return controller::load_config(scratch.write("arm.yaml", text));
}

inline std::string load_refusal(const std::string& path) {
  return testing::refusal<controller::InputError>([&] { controller::load_config(path); });
}
/// Returns the error of load_config for `text`, without the file's name in front.
inline std::string complaint(const std::string& text) {
  const Scratch scratch;
  const std::string path = scratch.write("arm.yaml", text);
  const std::string said = load_refusal(path);
  EXPECT_EQ(said.find(path + ": "), 0u) << said;
  return said.substr(std::min(path.size() + 2, said.size()));
}

}  // namespace dashpot::tests
