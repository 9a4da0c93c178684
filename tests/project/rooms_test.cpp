// The table of rooms: it must let good includes pass and catch bad ones.
#include <dashpot/tests/project/rooms.hpp>

#include <gmock/gmock.h>

namespace dashpot::tests {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

std::string_view folder_name(std::string_view path) {
  const Room* room = room_of(path);
  return room == nullptr ? "none" : room->folder;
}

bool may_file_include(std::string_view path, std::string_view header) {
  const Room* room = room_of(path);
  return room != nullptr && may_include(*room, header);
}

TEST(Rooms, HoldTheirFilesAndTheirPublicHeaders) {
  EXPECT_EQ(folder_name("analysis/base/solver_status.cpp"), "analysis/base");
  EXPECT_EQ(folder_name("analysis/solver_status.hpp"), "analysis/base");
  EXPECT_EQ(folder_name("controller/plugin.h"), "controller/plugin");
  EXPECT_EQ(folder_name("text/printable.hpp"), "text");
  EXPECT_EQ(folder_name("apps/run/run.cpp"), "apps/run");
  EXPECT_EQ(folder_name("apps/main.cpp"), "apps");
  EXPECT_EQ(folder_name("tests/analysis/system_test.cpp"), "tests");
  // nowhere:
  EXPECT_EQ(folder_name("analysis/solver_status.cpp"), "none");
  EXPECT_EQ(folder_name("analysis/secret.hpp"), "none");
  EXPECT_EQ(folder_name("analysis/unknown/status.cpp"), "none");
  EXPECT_EQ(folder_name("analysis"), "none");
}

TEST(Rooms, ShowTheirPublicHeadersOnly) {
  EXPECT_TRUE(is_public("dashpot/analysis/spectrum.hpp"));
  EXPECT_TRUE(is_public("dashpot/controller/plugin.h"));
  EXPECT_TRUE(is_public("dashpot/lcmtypes/state_t.hpp"));
  EXPECT_TRUE(is_public("dashpot/text/printable.hpp"));
  EXPECT_FALSE(is_public("dashpot/analysis/spectrum/modal_basis.hpp"));
  EXPECT_FALSE(is_public("dashpot/analysis/secret.hpp"));
  EXPECT_FALSE(is_public("dashpot/apps/scene.hpp"));
  EXPECT_FALSE(is_public("dashpot/tests/matrices.hpp"));
  EXPECT_FALSE(is_public("Eigen/Core"));
}

TEST(Rooms, IncludeWhatIsOnALowerStep) {
  EXPECT_TRUE(may_file_include("analysis/spectrum/modes.cpp", "vector"));
  EXPECT_TRUE(may_file_include("analysis/spectrum/modes.cpp", "Eigen/Core"));
  EXPECT_TRUE(may_file_include("analysis/spectrum/modes.cpp", "dashpot/analysis/linalg/lu.hpp"));
  EXPECT_TRUE(may_file_include("analysis/spectrum/modes.cpp", "dashpot/analysis/system.hpp"));
  EXPECT_TRUE(may_file_include("analysis/spectrum/modes.cpp", "dashpot/analysis/mode.hpp"));
  EXPECT_TRUE(may_file_include("analysis/mode.hpp", "dashpot/analysis/matrix_types.hpp"));
  EXPECT_TRUE(may_file_include("controller/law/designed_damping.hpp",
                               "dashpot/controller/robot_types.hpp"));
  EXPECT_TRUE(may_file_include("apps/main.cpp", "dashpot/apps/run/run_report.hpp"));
}

TEST(Rooms, IncludeNothingOnTheirOwnStepOrAbove) {
  EXPECT_FALSE(may_file_include("analysis/mode.hpp", "dashpot/analysis/tracked_spectrum.hpp"));
  EXPECT_FALSE(may_file_include("analysis/linalg/lu.hpp", "dashpot/analysis/system.hpp"));
  EXPECT_FALSE(
      may_file_include("analysis/base/solver_status.cpp", "dashpot/analysis/linalg/lu.hpp"));
  EXPECT_FALSE(
      may_file_include("analysis/response.hpp", "dashpot/analysis/sampled/sampled_data_model.hpp"));
  EXPECT_FALSE(may_file_include("controller/law/impedance_law.hpp",
                                "dashpot/controller/safety/motion_watch.hpp"));
  EXPECT_FALSE(may_file_include("apps/cli/terminal.cpp", "dashpot/apps/run/run_report.hpp"));
  EXPECT_FALSE(may_file_include("analysis/mode.hpp", "dashpot/analysis/unknown.hpp"));
}

TEST(Rooms, IncludeOnlyWhatTheyMayOfOthers) {
  EXPECT_TRUE(may_file_include("controller/law/x.hpp", "dashpot/analysis/ratio_damping.hpp"));
  EXPECT_FALSE(may_file_include("controller/law/x.hpp", "dashpot/analysis/linalg/lu.hpp"));
  EXPECT_FALSE(may_file_include("controller/law/x.hpp", "dashpot/sim/plant.hpp"));
  EXPECT_FALSE(may_file_include("controller/law/x.hpp", "kdl/chain.hpp"));
  EXPECT_TRUE(may_file_include("controller/model/x.cpp", "kdl/chain.hpp"));
  EXPECT_TRUE(may_file_include("controller/model/x.cpp", "urdf_parser/urdf_parser.h"));
  EXPECT_TRUE(may_file_include("controller/model/x.cpp", "dashpot/text/xml_check.hpp"));
  EXPECT_TRUE(may_file_include("text/x.cpp", "yaml-cpp/yaml.h"));
  EXPECT_FALSE(may_file_include("controller/config/x.cpp", "yaml-cpp/yaml.h"));
  EXPECT_FALSE(may_file_include("controller/core/x.cpp", "lcm/lcm-cpp.hpp"));
  EXPECT_FALSE(may_file_include("analysis/mode.hpp", "dashpot/controller/robot_types.hpp"));
  EXPECT_FALSE(may_file_include("analysis/mode.hpp", "dashpot/tests/support/matrices.hpp"));
  EXPECT_FALSE(may_file_include("analysis/mode.hpp", "dashpot/text/printable.hpp"));
  EXPECT_FALSE(may_file_include("analysis/mode.hpp", "nlohmann/json.hpp"));
  EXPECT_FALSE(may_file_include("analysis/mode.hpp", "lapacke.h"));
  EXPECT_FALSE(may_file_include("text/printable.cpp", "dashpot/analysis/matrix_types.hpp"));
  EXPECT_FALSE(may_file_include("sim/arm.hpp", "dashpot/analysis/matrix_types.hpp"));
  EXPECT_FALSE(may_file_include("sim/arm.hpp", "dashpot/controller/robot_types.hpp"));
  EXPECT_FALSE(may_file_include("sim/arm.hpp", "kdl/chain.hpp"));
  EXPECT_TRUE(may_file_include("sim/dynamics/x.cpp", "urdf_model/model.h"));
  EXPECT_TRUE(may_file_include("lcmtypes/bus.hpp", "lcm/lcm-cpp.hpp"));
  EXPECT_TRUE(may_file_include("lcmtypes/samples.hpp", "dashpot/controller/snapshot.hpp"));
  EXPECT_FALSE(may_file_include("lcmtypes/samples.hpp", "dashpot/analysis/spectrum.hpp"));
  EXPECT_FALSE(may_file_include("lcmtypes/samples.hpp", "dashpot/controller/controller.hpp"));
  EXPECT_TRUE(may_file_include("apps/run/run.cpp", "CLI/CLI.hpp"));
  EXPECT_TRUE(may_file_include("apps/run/run.cpp", "dashpot/controller/config.hpp"));
  EXPECT_FALSE(may_file_include("apps/run/run.cpp", "dashpot/controller/law/null_space.hpp"));
  EXPECT_FALSE(may_file_include("python/src/x.cpp", "dashpot/controller/law/null_space.hpp"));
  EXPECT_TRUE(may_file_include("python/src/x.cpp", "dashpot/controller/plugin/plugin_data.hpp"));
  EXPECT_TRUE(may_file_include("tests/a_test.cpp", "dashpot/analysis/linalg/small_dense.hpp"));
}

TEST(Rooms, FindTheLinesInAFile) {
  const std::string text =
      "#pragma once\n#include <vector>\n  #  include <kdl/chain.hpp>  // why\n"
      "#include \"types.hpp\"\n// #include <lcm/lcm.h>\n#include <Eigen/Core>\n";
  EXPECT_THAT(forbidden_includes("analysis/mode.hpp", text),
              ElementsAre("<kdl/chain.hpp>", "\"types.hpp\""));
  EXPECT_THAT(forbidden_includes("analysis/mode.hpp", "#include <Eigen/Core>\n"), IsEmpty());
  EXPECT_THAT(forbidden_includes("analysis/nowhere.cpp", "#include <Eigen/Core>\n"),
              ElementsAre("<Eigen/Core>"));
}

}  // namespace
}  // namespace dashpot::tests
