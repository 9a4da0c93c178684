// Holds every source of the tree to the table of rooms.
#include <dashpot/tests/project/include_cycles.hpp>
#include <dashpot/tests/project/rooms.hpp>
#include <dashpot/tests/project/rules.hpp>
#include <dashpot/tests/project/tree.hpp>

#include <gmock/gmock.h>

namespace dashpot::tests {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

/// All files of a source are one component: "analysis/base/solver_status" has solver_status.hpp and
/// .cpp.
std::string component_of(std::string_view path) {
  const std::string_view name = without_end(path);
  const Room* room = room_of(path);
  if (room == nullptr || !room->is_of_library()) return std::string(name);
  return std::string(room->folder) + std::string(name.substr(name.rfind('/')));
}

std::string folder_of(std::string_view path) {
  const Room* room = room_of(path);
  return room == nullptr ? "" : std::string(room->folder);
}

/// Who includes whom, each file by the name that `name_of` gives it; not itself.
template <class NameOf>
Arrows arrows_of(NameOf name_of) {
  Arrows arrows;
  for (const File& file : files()) {
    if (!file.is_source()) continue;
    std::set<std::string>& to = arrows[name_of(file.path)];
    for (const std::string& header : includes_of(file.text)) {
      if (header.starts_with("<dashpot/")) {
        to.insert(name_of(std::string_view(header).substr(9, header.size() - 10)));
      }
    }
    to.erase(name_of(file.path));
  }
  return arrows;
}

bool exists(const std::string& path) {
  return std::any_of(files().begin(), files().end(),
                     [&](const File& file) { return file.path == path; });
}

TEST(Tree, IncludesOnlyWhatTheTableOfRoomsAllows) {
  std::vector<std::string> offences;
  for (const File& file : files()) {
    if (!file.is_source()) continue;
    for (const std::string& header : forbidden_includes(file.path, file.text)) {
      offences.push_back(file.path + ": " + header);
    }
  }
  EXPECT_THAT(offences, IsEmpty());
}

// Of another library, in quotes, of higher steps, unknown.
TEST(Rooms, AllowOnlyLowerStepsAndPublicHeaders) {
  const std::string bad =
      "#include <kdl/chain.hpp>\n #  include \"types.hpp\"  // why\n"
      "#include <dashpot/analysis/tracked_spectrum.hpp>\n"
      "#include <dashpot/analysis/sampled/sampled_data_model.hpp>\n"
      "#include <dashpot/analysis/unknown.hpp>\n";
  const std::string good =
      "#include <vector>\n#include <Eigen/Core>\n// #include <lcm/lcm.h>\n"
      "#include <dashpot/analysis/matrix_types.hpp>\n#include <dashpot/analysis/linalg/lu.hpp>\n";
  EXPECT_THAT(
      forbidden_includes("analysis/mode.hpp", good + bad),
      ElementsAre("<kdl/chain.hpp>", "\"types.hpp\"", "<dashpot/analysis/tracked_spectrum.hpp>",
                  "<dashpot/analysis/sampled/sampled_data_model.hpp>",
                  "<dashpot/analysis/unknown.hpp>"));
  EXPECT_THAT(forbidden_includes("controller/law/x.hpp",
                                 "#include <dashpot/analysis/linalg/lu.hpp>\n"
                                 "#include <dashpot/analysis/mode.hpp>\n"),
              ElementsAre("<dashpot/analysis/linalg/lu.hpp>"));
  EXPECT_EQ(room_of("analysis/unknown/status.cpp"), nullptr);
  EXPECT_EQ(cycle_text({{"a", {"b"}}, {"b", {"c", "d"}}, {"c", {}}, {"d", {"b"}}}), "b -> d -> b");
}

TEST(Tree, KeepsEverySourceInARoom) {
  EXPECT_THAT(
      paths_of([](const File& file) { return file.is_source() && room_of(file.path) == nullptr; }),
      IsEmpty());
}

TEST(Tree, HasEveryPublicHeaderOfTheTable) {
  std::vector<std::string> offences;
  for (const Room& room : rooms()) {
    for (const std::string_view door : room.doors) {
      const std::string path = std::string(room.library()) + "/" + std::string(door);
      const auto ends = {".hpp", ".h", ".lcm", ".hpp.in"};  // the last two are generated from
      if (std::none_of(ends.begin(), ends.end(), [&](auto end) { return exists(path + end); })) {
        offences.push_back(path);
      }
    }
  }
  EXPECT_THAT(offences, IsEmpty());
}

TEST(Tree, HasNoCycleOfFilesThatIncludeEachOther) {
  EXPECT_EQ(cycle_text(arrows_of(component_of)), "");
}

TEST(Tree, HasNoCycleOfRoomsThatIncludeEachOther) {
  EXPECT_EQ(cycle_text(arrows_of(folder_of)), "");
}

TEST(Tree, ShowsAUserPublicHeadersOnly) {
  std::vector<std::string> offences;
  for (const File& file : files()) {
    if (!file.path.starts_with("tests/consumer/")) continue;
    for (const std::string& header : includes_of(file.text)) {
      const bool ours = header[0] == '"' || header.starts_with("<dashpot/");
      if (ours && !is_public(std::string_view(header).substr(1, header.size() - 2))) {
        offences.push_back(file.path + ": " + header);
      }
    }
  }
  EXPECT_THAT(offences, IsEmpty());
}

TEST(Tree, DescribesEveryRoomInTheArchitecture) {
  std::set<std::string> folders, described;
  for (const File& file : files()) {
    if (file.is_source()) folders.insert(folder_of(file.path));
    if (file.path != "docs/architecture.md") continue;
    for (const std::string& room : described_rooms(file.text)) described.insert(room);
  }
  EXPECT_EQ(described, folders);
}

}  // namespace
}  // namespace dashpot::tests
