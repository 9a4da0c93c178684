// The rules themselves: each must let good text pass and catch bad text.
#include <dashpot/tests/project/rules.hpp>

#include <gmock/gmock.h>

namespace dashpot::tests {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(IncludeRules, AllowTheArrowsOfTheTable) {
  EXPECT_TRUE(may_include("analysis", "vector"));
  EXPECT_TRUE(may_include("analysis", "Eigen/Core"));
  EXPECT_TRUE(may_include("controller", "kdl/chain.hpp"));
  EXPECT_TRUE(may_include("controller", "urdf_parser/urdf_parser.h"));
  EXPECT_TRUE(may_include("controller", "yaml-cpp/yaml.h"));
  EXPECT_TRUE(may_include("controller", "dashpot/analysis/spectrum.hpp"));
  EXPECT_TRUE(may_include("controller", "dashpot/text/xml_check.hpp"));
  EXPECT_TRUE(may_include("sim", "dashpot/text/xml_check.hpp"));
  EXPECT_TRUE(may_include("sim", "urdf_model/model.h"));
  EXPECT_TRUE(may_include("lcmtypes", "lcm/lcm-cpp.hpp"));
  EXPECT_TRUE(may_include("lcmtypes", "dashpot/controller/snapshot.hpp"));
  EXPECT_TRUE(may_include("apps", "CLI/CLI.hpp"));
  EXPECT_TRUE(may_include("apps", "yaml-cpp/yaml.h"));
  EXPECT_TRUE(may_include("tests", "nlohmann/json.hpp"));
}

TEST(IncludeRules, ForbidEveryOtherArrow) {
  EXPECT_FALSE(may_include("analysis", "dashpot/controller/law.hpp"));
  EXPECT_FALSE(may_include("analysis", "dashpot/tests/support/matrices.hpp"));
  EXPECT_FALSE(may_include("analysis", "nlohmann/json.hpp"));
  EXPECT_FALSE(may_include("analysis", "yaml-cpp/yaml.h"));
  EXPECT_FALSE(may_include("analysis", "lapacke.h"));
  EXPECT_FALSE(may_include("controller", "dashpot/sim/scene.hpp"));
  EXPECT_FALSE(may_include("controller", "lcm/lcm-cpp.hpp"));
  EXPECT_FALSE(may_include("text", "Eigen/Core"));
  EXPECT_FALSE(may_include("text", "dashpot/controller/types.hpp"));
  EXPECT_FALSE(may_include("analysis", "dashpot/text/printable.hpp"));
  EXPECT_FALSE(may_include("sim", "dashpot/analysis/types.hpp"));
  EXPECT_FALSE(may_include("sim", "dashpot/controller/law.hpp"));
  EXPECT_FALSE(may_include("sim", "kdl/chain.hpp"));
  EXPECT_FALSE(may_include("lcmtypes", "dashpot/analysis/spectrum.hpp"));
  EXPECT_FALSE(may_include("lcmtypes", "dashpot/controller/controller.hpp"));
  EXPECT_FALSE(may_include("lcmtypes", "kdl/chain.hpp"));
  EXPECT_FALSE(may_include("unknown", "Eigen/Core"));
}

TEST(IncludeRules, FindTheLinesInAFile) {
  const std::string text =
      "#pragma once\n#include <vector>\n  #  include <kdl/chain.hpp>  // why\n"
      "#include \"types.hpp\"\n// #include <lcm/lcm.h>\n#include <Eigen/Core>\n";
  EXPECT_THAT(forbidden_includes("analysis", text),
              ElementsAre("  #  include <kdl/chain.hpp>  // why", "#include \"types.hpp\""));
  EXPECT_THAT(forbidden_includes("analysis", "#include <Eigen/Core>\n"), IsEmpty());
}

TEST(WordRules, FindPathsOfAMachineAndNotesOfUnfinishedWork) {
  using namespace std::string_literals;  // in halves, so that this file passes the rule itself
  EXPECT_THAT(forbidden_words("see /"s + "home/ann/arm.urdf"), ElementsAre("/"s + "home/"));
  EXPECT_THAT(forbidden_words("// TO"s + "DO: units, FIX" + "ME"),
              ElementsAre("TO"s + "DO", "FIX"s + "ME"));
  EXPECT_THAT(forbidden_words("a framework/of homes, done at /usr/share/work"), IsEmpty());
}

TEST(ThreadRules, FindTheHeadersThatStartThreads) {
  EXPECT_TRUE(includes_threads("#include <thread>\n"));
  EXPECT_TRUE(includes_threads("#pragma once\n # include <future>  // async\n"));
  EXPECT_TRUE(includes_threads("#include <vector>\n\n#include <pthread.h>\n"));
  EXPECT_FALSE(includes_threads("// #include <thread>\n#include <dashpot/tests/thread>\n"));
}

TEST(HeaderRules, AskForPragmaOnceInTheFirstLine) {
  EXPECT_TRUE(starts_with_pragma_once("#pragma once\n#include <vector>\n"));
  EXPECT_FALSE(starts_with_pragma_once("// A comment.\n#pragma once\n"));
  EXPECT_FALSE(starts_with_pragma_once(""));
}

}  // namespace
}  // namespace dashpot::tests
