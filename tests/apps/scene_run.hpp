#pragma once
// `dashpot run` of the project's scenes, as they are and changed.
#include <dashpot/tests/apps/json_result.hpp>
#include <dashpot/tests/support/places.hpp>

#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>

namespace dashpot::tests {

inline std::string text_of(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

inline Outcome run_scene(const std::string& path, const Words& options = {}) {
  return run_program(joined({"run", path, "--fast"}, options));
}

/// The summary; the exit status is 1, with a line about it, only if a fault is latched at the end.
inline Json run_json(const std::string& path, const Words& options = {}) {
  const Outcome outcome = run_scene(path, joined(options, {"--json"}));
  if (outcome.status == 0) return parse(outcome);
  EXPECT_EQ(outcome.status, 1) << outcome.err;
  EXPECT_NE(outcome.err.find("dashpot run: ended in a fault: "), std::string::npos) << outcome.err;
  Json result = Json::parse(outcome.out);
  EXPECT_FALSE(result["fault"].is_null());
  return result;
}

/// A scene with parts of its text replaced, its URDF named absolutely, in a file of its own.
inline std::string changed(const Scratch& scratch, const std::string& name,
                           const std::vector<std::pair<std::string, std::string>>& replacements) {
  std::string text = text_of(scene(name));
  const auto replace = [&text](const std::string& old, const std::string& by) {
    const std::size_t at = text.find(old);
    if (at == std::string::npos) throw std::runtime_error("no '" + old + "' in the scene");
    text.replace(at, old.size(), by);
  };
  for (const auto& [from, to] : replacements) replace(from, to);
  if (text.find("../models") != std::string::npos) {
    replace("../models", std::string(DASHPOT_SOURCE_DIR) + "/sim/models");
  }
  return scratch.write("scene.yaml", text);
}

inline std::string changed(const Scratch& scratch, const std::string& name, const std::string& from,
                           const std::string& to) {
  return changed(scratch, name, {{from, to}});
}

/// The columns of a CSV by name, without their units.
inline std::map<std::string, Numbers> table(const std::string& path) {
  std::istringstream lines(text_of(path));
  std::map<std::string, Numbers> columns;
  std::vector<std::string> names;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream cells(line);
    std::size_t i = 0;
    for (std::string cell; std::getline(cells, cell, ','); ++i) {
      if (columns.size() < names.size() + 1 && columns.find(cell) == columns.end() &&
          line.starts_with("time")) {
        names.push_back(cell.substr(0, cell.find(" [")));
      } else {
        columns[names.at(i)].push_back(std::stod(cell));
      }
    }
  }
  return columns;
}

}  // namespace dashpot::tests
