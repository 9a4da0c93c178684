#pragma once
// The rooms of the house: which folder a source belongs to, and which folders may include which.

#include <algorithm>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

namespace dashpot::tests {

inline constexpr std::string_view kPrivate = "private headers";

/// A folder of sources.
struct Room {
  std::string_view folder;  ///< "analysis/spectrum"
  /// A room may include itself and the rooms of its library that have a lower step.
  int step = 0;
  /// Its public headers, without their ends: they stand in the library's own folder.
  std::vector<std::string_view> doors;
  /// Beginnings of the names of other headers that it may include; "" is any. Of another library it
  /// may include the public headers, the headers named here in full, and, with kPrivate, all.
  std::vector<std::string_view> others;

  /// "analysis"
  std::string_view library() const { return folder.substr(0, folder.find('/')); }
  /// Only libraries are restricted: programs, tests and benchmarks may include anything.
  bool is_of_library() const { return !others.front().empty(); }
};

/// Headers of the standard library ("vector") are open to every room.
inline const std::vector<Room>& rooms() {
  static constexpr std::string_view kAnalysis = "dashpot/analysis/", kText = "dashpot/text/",
                                    kController = "dashpot/controller/";
  static constexpr std::string_view kEigen = "Eigen/", kFft = "unsupported/Eigen/FFT";
  static const std::vector<std::string_view> snapshots = {"dashpot/analysis/matrix_types.hpp",
                                                          "dashpot/controller/robot_types.hpp",
                                                          "dashpot/controller/snapshot.hpp",
                                                          "dashpot/controller/latest.hpp",
                                                          kEigen,
                                                          "lcm/"};
  static const std::vector<std::string_view> plugin_hosts = {
      "dashpot/controller/plugin.h", "dashpot/controller/plugin_fields.hpp",
      "dashpot/controller/snapshot.hpp", kEigen};
  static const std::vector<Room> table = {
      {"text", 0, {}, {kEigen, "yaml-cpp/", "fcntl.h", "sys/stat.h", "unistd.h"}},

      {"analysis/base", 0, {"matrix_types", "solver_status", "work"}, {kEigen}},
      {"analysis/linalg", 1, {}, {kEigen}},
      {"analysis/system",
       2,
       {"system", "task_space", "null_damping", "rigid_body_elimination", "gears"},
       {kEigen}},
      {"analysis/spectrum", 3, {"mode", "spectrum", "elastic_form"}, {kEigen}},
      {"analysis/tracker", 4, {"tracked_spectrum", "mode_tracker"}, {kEigen}},
      {"analysis/response", 4, {"response"}, {kEigen}},
      {"analysis/sampled", 4, {"sampled_loop", "contact_limit"}, {kEigen}},
      {"analysis/design",
       5,
       {"damping_target", "damping_design", "damping_region", "damping_sampled", "ratio_damping",
        "borne_damping"},
       {kEigen}},

      {"identification/records", 0, {"motion_record", "motion_verdict"}, {kAnalysis, kFft, kEigen}},
      {"identification/model", 1, {}, {kAnalysis, kFft, kEigen}},
      {"identification/search",
       2,
       {"identification"},
       {kAnalysis, kEigen, "unsupported/Eigen/LevenbergMarquardt"}},
      {"identification/check_model",
       0,
       {"check_model", "torque_record"},
       {kController, kText, kEigen, "kdl/"}},

      {"controller/base",
       0,
       {"robot_types", "tick_status", "settings", "snapshot", "latest", "input_error"},
       {kAnalysis, kText, kEigen}},
      {"controller/model",
       2,
       {"attachment", "robot_model", "robot_description", "kdl_chain", "dynamics",
        "default_settings", "drives", "posture"},
       {kText, kEigen, "kdl/", "urdf_", "console_bridge/"}},
      {"controller/motion", 2, {}, {kEigen}},
      {"controller/law", 3, {}, {kAnalysis, kEigen}},
      {"controller/safety", 3, {"setpoint_check", "settings_check"}, {kText, kEigen}},
      {"controller/vibration",
       4,
       {"posture_loop", "rotors", "elastic_joints"},
       {kAnalysis, kText, kEigen, "pthread.h", "sched.h"}},  // threads have priorities
      {"controller/core", 5, {"controller"}, {kAnalysis, kText, kEigen}},
      {"controller/audit", 5, {"audit", "contact_audit", "gain_judge"}, {kAnalysis, kEigen}},
      {"controller/config", 6, {"config"}, {kText, kEigen}},
      {"controller/plugin",
       7,
       {"plugin", "plugin_fields"},
       {kAnalysis, kText, kEigen, "stdint.h"}},  // plugin.h is C

      // an independent check of the two above, which shares no mechanics with them:
      {"sim/base",
       0,
       {"joint_types", "step_status", "simulated_system", "schedule", "invalid_scene"},
       {kText, kEigen}},
      {"sim/dynamics", 1, {"robot", "arm"}, {kText, kEigen, "urdf_", "console_bridge/"}},
      {"sim/integrators", 1, {"integrator"}, {kEigen}},
      {"sim/hardware", 2, {"plant"}, {kEigen}},

      {"lcmtypes/messages",
       0,
       {"state_t", "modes_t", "sampled_modes_t", "contact_t", "command_t", "samples",
        "command_verdict", "bus", "log_file", "message_reader", "message_check", "message_fields"},
       snapshots},
      {"lcmtypes/publish", 1, {"publisher", "sink"}, snapshots},
      {"lcmtypes/command",
       1,
       {"command", "command_limits", "command_filter", "command_receiver"},
       snapshots},
      {"lcmtypes/plugin", 2, {"plugin_samples", "plugin_publisher"}, plugin_hosts},
      {"lcmtypes/drivers",
       1,
       {"driver", "lcmt_iiwa_command", "lcmt_iiwa_status", "lcmt_panda_command",
        "lcmt_panda_status"},
       snapshots},

      {"hosts", 0, {}, {"dashpot/controller/plugin.h", "dashpot/lcmtypes/", "mujoco/"}},

      {"apps/cli", 0, {}, {""}},
      {"apps/report", 1, {}, {""}},
      {"apps/records", 1, {}, {""}},
      {"apps/scene", 2, {}, {""}},
      {"apps/analyze", 2, {}, {""}},
      {"apps/inspect", 2, {}, {""}},
      {"apps/design", 2, {}, {""}},
      {"apps/export", 2, {}, {""}},
      {"apps/command", 2, {}, {""}},
      {"apps/identify", 2, {}, {""}},
      {"apps/check_model", 4, {}, {""}},
      {"apps/audit", 3, {}, {""}},
      {"apps/loop", 3, {}, {""}},
      {"apps/web", 3, {}, {""}},
      {"apps/run", 4, {}, {""}},
      {"apps/drive", 4, {}, {""}},
      {"apps/fake_driver", 4, {}, {""}},
      {"apps/monitor", 4, {}, {""}},
      {"apps/tune", 4, {}, {""}},
      {"apps", 5, {}, {""}},

      {"python",
       0,
       {},
       {"", "dashpot/controller/plugin/hosted_controller.hpp",
        "dashpot/controller/plugin/plugin_data.hpp"}},  // it is a host inside the plugin
      {"examples", 0, {}, {"dashpot/", "stdio.h"}},
      {"tests", 0, {}, {"", kPrivate}},
      {"benchmarks", 0, {}, {"", kPrivate}},
  };
  return table;
}

/// "analysis/base/solver_status.cpp" without its end.
inline std::string_view without_end(std::string_view path) {
  return path.substr(0, path.rfind('.'));
}

/// The room of a file ("analysis/base/solver_status.cpp", "analysis/solver_status.hpp"), or null:
/// there is none.
inline const Room* room_of(std::string_view path) {
  const std::size_t slash = std::min(path.rfind('/'), path.size());
  const std::string_view folder = path.substr(0, slash);
  const std::string_view stem = without_end(path).substr(std::min(slash + 1, path.size()));
  const Room* found = nullptr;
  for (const Room& room : rooms()) {
    const bool inside = path.size() > room.folder.size() && path.starts_with(room.folder) &&
                        path[room.folder.size()] == '/';
    if (inside && (found == nullptr || found->folder.size() < room.folder.size())) found = &room;
    const bool header = path.ends_with(".hpp") || path.ends_with(".h");
    if (header && folder == room.library() &&
        std::find(room.doors.begin(), room.doors.end(), stem) != room.doors.end()) {
      return &room;
    }
  }
  return found;
}

/// Whether `header` ("dashpot/analysis/matrix_types.hpp") is one that users may include.
inline bool is_public(std::string_view header) {
  if (!header.starts_with("dashpot/")) return false;
  const std::string_view path = header.substr(8);
  const Room* room = room_of(path);
  return room != nullptr && room->is_of_library() && std::count(path.begin(), path.end(), '/') == 1;
}

/// Whether a file of `room` may include `header` ("Eigen/Core").
inline bool may_include(const Room& room, std::string_view header) {
  if (header.find_first_of("./") == std::string_view::npos) return true;  // standard library
  const bool ours = header.starts_with("dashpot/");
  const Room* other = ours ? room_of(header.substr(8)) : nullptr;
  if (ours && other == nullptr) return false;
  if (ours && other->library() == room.library()) {
    return other == &room || other->step < room.step;
  }
  return std::any_of(room.others.begin(), room.others.end(), [&](std::string_view begin) {
    if (begin == kPrivate || begin == header) return true;
    return header.starts_with(begin) && (!ours || is_public(header));
  });
}

/// Every header that the source text includes: "<vector>", "\"types.hpp\"".
inline std::vector<std::string> includes_of(const std::string& text) {
  static const std::regex include(R"re(^\s*#\s*include\s*(<[^>]+>|"[^"]+").*)re");
  std::vector<std::string> found;
  std::istringstream lines(text);
  std::smatch match;
  for (std::string line; std::getline(lines, line);) {
    if (line.find('#') == std::string::npos || !std::regex_match(line, match, include)) continue;
    found.push_back(match[1].str());
  }
  return found;
}

/// Every include in the source text of the file at `path` that is not allowed there. Headers in
/// quotes never are: the line <dashpot/...> works in the tree and installed.
inline std::vector<std::string> forbidden_includes(std::string_view path, const std::string& text) {
  const Room* room = room_of(path);
  std::vector<std::string> found = includes_of(text);
  if (room == nullptr) return found;
  std::erase_if(found, [room](const std::string& header) {
    return header[0] == '<' && may_include(*room, header.substr(1, header.size() - 2));
  });
  return found;
}

/// The targets of each name.
using Arrows = std::map<std::string, std::set<std::string>>;

/// Looks for cycles from one name after the other.
class CycleFinder {
 public:
  explicit CycleFinder(const Arrows& arrows) : arrows_(arrows) {}

  /// The names of a cycle, each of which points to the next and the last to the first; empty if
  /// there is none.
  std::vector<std::string> find() {
    for (const auto& [name, to] : arrows_) {
      if (closes(name)) return path_;
    }
    return {};
  }

 private:
  /// Whether a cycle is reached from `name`; it is then in `path_`.
  bool closes(const std::string& name) {
    for (auto at = path_.begin(); at != path_.end(); ++at) {
      if (*at != name) continue;
      path_.erase(path_.begin(), at);
      return true;
    }
    if (!visited_.insert(name).second) return false;
    path_.push_back(name);
    const auto to = arrows_.find(name);
    if (to != arrows_.end()) {
      for (const std::string& next : to->second) {
        if (closes(next)) return true;
      }
    }
    path_.pop_back();
    return false;
  }

  const Arrows& arrows_;
  std::set<std::string> visited_;
  std::vector<std::string> path_;
};

/// "a -> b -> a", or "" if there is no cycle.
inline std::string cycle_text(const Arrows& arrows) {
  const std::vector<std::string> cycle = CycleFinder(arrows).find();
  std::string text;
  for (const std::string& name : cycle) text += name + " -> ";
  return cycle.empty() ? text : text + cycle.front();
}

}  // namespace dashpot::tests
