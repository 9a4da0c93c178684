// Applies the rules to every file of the source tree.
#include <dashpot/tests/project/rooms.hpp>
#include <dashpot/tests/project/rules.hpp>
#include <dashpot/tests/support/places.hpp>

#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>

namespace dashpot::tests {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

namespace fs = std::filesystem;
using testing::Contains;
using testing::ElementsAre;
using testing::Field;
using testing::IsEmpty;
using testing::SizeIs;

TEST(Tree, IsRead) {
  EXPECT_THAT(files(), Contains(Field(&File::path, "CMakeLists.txt")));
  EXPECT_THAT(files(), Contains(Field(&File::path, "tests/project/tree_test.cpp")));
}

TEST(Tree, HoldsNoPathOfAMachineAndNoNoteOfUnfinishedWork) {
  std::vector<std::string> offences;
  for (const File& file : files()) {
    for (const std::string& word : forbidden_words(file.text)) {
      offences.push_back(file.path + ": " + word);
    }
  }
  EXPECT_THAT(offences, IsEmpty());
}

TEST(Tree, KeepsTestsWithThreadsWhereTheThreadSanitizerRuns) {
  EXPECT_THAT(paths_of([](const File& file) {
                return file.path.starts_with("tests/") &&
                       !file.path.starts_with("tests/threads/") &&
                       !file.path.starts_with("tests/stress/soak") && includes_threads(file.text);
              }),
              IsEmpty())
      << "Their place is tests/threads.";
}

TEST(Tree, StartsEveryHeaderWithPragmaOnce) {
  EXPECT_THAT(paths_of([](const File& file) {
                return file.has_end(".hpp") && !starts_with_pragma_once(file.text);
              }),
              IsEmpty());
}

TEST(Tree, GivesEveryHeaderOfALibraryANameOfItsOwn) {
  std::map<std::string, std::string> known;
  for (const File& file : files()) {
    if (!file.has_end(".hpp")) continue;
    const Room* room = room_of(file.path);
    if (room == nullptr || !room->is_of_library()) continue;
    const std::string name = fs::path(file.path).filename();
    const auto [at, is_new] = known.emplace(name, file.path);
    EXPECT_TRUE(is_new) << file.path << " and " << at->second;
  }
  EXPECT_GT(known.size(), 100U);
}

/// The text file of this path; null if there is none.
const File* find_file(const std::string& path) {
  const auto found = std::find_if(files().begin(), files().end(),
                                  [&](const File& file) { return file.path == path; });
  return found == files().end() ? nullptr : &*found;
}

/// Returns what is wrong with a link of a document; empty if it leads somewhere.
std::string offence(const File& from, const Link& link) {
  const fs::path path = link.path.empty()
                            ? fs::path(from.path)
                            : (fs::path(from.path).parent_path() / link.path).lexically_normal();
  if (!fs::exists(DASHPOT_SOURCE_DIR / path)) return "there is no " + path.string();
  if (link.heading.empty()) return "";
  const File* const to = find_file(path.string());
  if (to == nullptr) return path.string() + " has no headings";
  const std::vector<std::string> headings = anchors(to->text);
  return std::find(headings.begin(), headings.end(), link.heading) != headings.end()
             ? ""
             : path.string() + " has no heading #" + link.heading;
}

TEST(Documents, LinkOnlyToFilesAndHeadingsThatExist) {
  std::vector<std::string> offences;
  int links = 0;
  for (const File& file : files()) {
    if (!file.has_end(".md")) continue;
    for (const Link& link : relative_links(file.text)) {
      ++links;
      const std::string found = offence(file, link);
      if (!found.empty()) offences.push_back(file.path + ": " + found);
    }
  }
  EXPECT_THAT(offences, IsEmpty());
  EXPECT_GT(links, 50);
}

TEST(Rules, FindOffences) {
  const File here{"docs/a.md", "# One: x_y\n```\n# no\n```\n# B\n# B\n"};
  const std::vector<Link> links =
      relative_links("[a](no.md) `[b](c.md)` [d\ne](../README.md#no) [f](https://g.h)");
  ASSERT_EQ(links.size(), 2U);
  EXPECT_EQ(offence(here, links[0]), "there is no docs/no.md");
  EXPECT_EQ(offence(here, links[1]), "README.md has no heading #no");
  EXPECT_THAT(anchors(here.text), ElementsAre("one-x_y", "b", "b-1"));
  EXPECT_THAT(forbidden_words("see /" + std::string("home/ann")), SizeIs(1));
  EXPECT_TRUE(includes_threads("#pragma once\n # include <future>  // async\n"));
  EXPECT_FALSE(starts_with_pragma_once("// A comment.\n#pragma once\n"));
}

TEST(Documents, KeepTheReadmeShort) {
  const File* const readme = find_file("README.md");
  ASSERT_NE(readme, nullptr);
  EXPECT_LE(std::count(readme->text.begin(), readme->text.end(), '\n'), 150);
}

std::string text_of(const std::string& path) {
  const File* const file = find_file(path);
  return file == nullptr ? "" : file->text;
}

TEST(Documents, ListTheConstantsOfIdentificationWithTheirValues) {
  const std::vector<std::string> listed =
      tabled_constants(text_of("docs/constants.md"), "Identification");
  std::size_t count = 0;
  for (const File& file : files()) {
    if (!file.path.starts_with("identification/")) continue;
    for (const std::string& constant : named_constants(file.text)) {
      if (constant.starts_with("kNaN")) continue;
      EXPECT_THAT(listed, Contains(constant)) << file.path;
      ++count;
    }
  }
  EXPECT_GT(count, 150U);
}

TEST(Examples, TheProgramOfTheReadmeIsTheOneThatIsTested) {
  const std::string readme = text_of("README.md"), fence = "```cpp\n";
  const std::size_t begin = readme.find(fence);
  ASSERT_NE(begin, std::string::npos);
  const std::size_t code = begin + fence.size();
  EXPECT_EQ(readme.substr(code, readme.find("```", code) - code),
            text_of("examples/control_loop.cpp"));
}

TEST(Examples, AreListedEachInTheirReadme) {
  for (const File& file : files()) {
    const bool program = file.has_end(".cpp") || file.has_end(".c") || file.has_end(".py");
    if (!file.path.starts_with("examples/") || !program) continue;
    const std::string name = file.path.substr(file.path.find('/') + 1);
    EXPECT_THAT(text_of("examples/README.md"), testing::HasSubstr("\n| [" + name + "](" + name));
  }
}

// Holds every source of the tree to the table of rooms.

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

// The bad includes: another library, quotes, a higher step, an unknown header.
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
