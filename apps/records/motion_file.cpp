#include <dashpot/apps/records/csv_column.hpp>
#include <dashpot/apps/records/motion_file.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/text/read_file.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace dashpot::apps {
namespace {

using controller::InputError;
using Eigen::Index;

constexpr std::size_t kMostBytes = std::size_t{1} << 30;
constexpr double kNoSample = std::numeric_limits<double>::quiet_NaN();

MotionFile read_log(const std::string& path) {
  MotionFile file;
  Rows rows(file);
  lcmtypes::MessageHandlers handlers;
  std::vector<double> values;
  std::vector<double> reference, reference_before;
  std::int64_t restarts = -1, restarted = 0;
  handlers.on_state = [&](const state_t& state) {
    const auto n = static_cast<std::size_t>(state.n);
    if (file.channels.empty()) {
      for (const auto& [letters, unit] :
           {std::pair("q", "rad"), std::pair("v", "rad/s"), std::pair("tau", "N m")}) {
        for (std::size_t i = 1; i <= n; ++i) {
          file.channels.push_back({letters + std::to_string(i), unit});
        }
      }
      for (const char* direction : {"x", "y", "z", "rx", "ry", "rz"}) {
        file.channels.push_back(
            {std::string("wrench_") + direction, *direction == 'r' ? "N m" : "N"});
      }
    }
    if (file.channels.size() != 3 * n + 6) throw InputError("", "its states differ in joints");
    values.clear();
    for (const auto* list : {&state.joint_position, &state.joint_velocity, &state.joint_torque}) {
      for (const double value : *list) values.push_back(std::isfinite(value) ? value : kNoSample);
    }
    for (const double value : state.tip_wrench) values.push_back(value);
    if (!rows.add(1e-6 * static_cast<double>(state.utime), values.data(), values.size())) return;
    const bool joint = state.mode == state_t::JOINT;
    file.wrench = joint && (file.wrench || file.rests.empty());
    reference.assign(state.reference_joint_position.begin(), state.reference_joint_position.end());
    if (!joint) {
      reference.insert(reference.end(), state.reference_tip_position,
                       state.reference_tip_position + 3);
      reference.insert(reference.end(), state.reference_tip_quaternion,
                       state.reference_tip_quaternion + 4);
    }
    const std::size_t size = reference.size();
    if (joint) {  // the wrench is feed-forward alone, such as an excitation
      reference.insert(reference.end(), state.tip_wrench, state.tip_wrench + 6);
    }
    // Smaller changes of a reference, such as its endless approach to a goal, move nothing visible.
    std::size_t kept = 0;
    while (reference.size() == reference_before.size() && kept < reference.size() &&
           std::abs(reference[kept] - reference_before[kept]) < 1e-9) {
      ++kept;
    }
    // Restarted springs grow for a while.
    constexpr std::int64_t kGrowing = 500'000;  // us
    if (state.restarts != restarts) restarts = state.restarts, restarted = state.utime;
    const bool well = state.status == 0 && state.fault == 0 && state.utime - restarted > kGrowing;
    file.free.push_back(well && kept == reference.size());
    file.rests.push_back(well && kept >= size);
    reference_before = reference;
  };
  lcmtypes::LogReader log(path, handlers);
  while (log.read()) log.handle();
  if (file.channels.empty()) throw InputError("", "has no states of a controller");
  rows.finish();
  return file;
}

bool is_log(const std::string& text) {
  constexpr std::array<unsigned char, 4> kSync = {0xED, 0xA1, 0xDA, 0x01};
  return text.size() >= kSync.size() &&
         std::equal(kSync.begin(), kSync.end(), text.begin(),
                    [](unsigned char a, char b) { return a == static_cast<unsigned char>(b); });
}

/// Whether a file is MCAP or part of a rosbag.
bool is_bag(std::string_view text) {
  return text.starts_with("\x89MCAP0\r\n") || text.starts_with("SQLite format 3") ||
         text.starts_with("#ROSBAG");
}

}  // namespace

MotionFile read_motion_file(const std::string& path, const FileHints& hints) try {
  std::string text;
  try {
    text = text::read_file(path, kMostBytes);
  } catch (const std::runtime_error& error) {
    throw InputError("", error.what());
  }
  if (!std::isfinite(hints.rate)) throw InputError("--rate", "has to be a finite number, Hz");
  if (is_bag(text)) {
    throw InputError("",
                     "is a bag or MCAP: in Python, dashpot.identify(dashpot.read_log(FILE)[TOPIC]) "
                     "reads a topic of JointState");
  }
  return is_log(text) ? read_log(path) : read_csv(text, hints);
} catch (const InputError& error) {
  throw error.in_file(path);
}

std::vector<Index> chosen_channels(const std::vector<MotionChannel>& channels,
                                   const std::string& names, const std::vector<Index>& others,
                                   const std::string& option) {
  std::vector<Index> chosen;
  const auto number = [&](std::string_view name) {
    const auto is_it = [name](const MotionChannel& channel) { return channel.name == name; };
    const auto found = std::find_if(channels.begin(), channels.end(), is_it);
    if (found != channels.end()) {
      if (std::find_if(found + 1, channels.end(), is_it) != channels.end()) {
        throw InputError(option, "two columns are called '" + std::string(name) +
                                     "': --columns gives them names of their own");
      }
      return static_cast<Index>(found - channels.begin());
    }
    std::string known;
    for (const MotionChannel& channel : channels) {
      known += (known.empty() ? "" : ", ") + channel.name;
    }
    throw InputError(option, "no channel '" + std::string(name) + "'; there are " + known);
  };
  for (std::string_view rest = names; !rest.empty();) {
    const auto end = std::min(rest.find(','), rest.size());
    const Index i = number(trimmed(rest.substr(0, end)));
    if (std::find(chosen.begin(), chosen.end(), i) != chosen.end()) {
      throw InputError(option, "'" + std::string(rest.substr(0, end)) + "' twice");
    }
    if (std::find(others.begin(), others.end(), i) != others.end()) {
      throw InputError(option, "'" + std::string(rest.substr(0, end)) + "' is among --inputs");
    }
    chosen.push_back(i);
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  for (const char* unit : {"rad", "m", "rad/s", "m/s", kUnnamed}) {
    if (!chosen.empty()) break;
    for (std::size_t i = 0; i < channels.size(); ++i) {
      const auto at = static_cast<Index>(i);
      if (channels[i].unit == unit && !is_desired(channels[i].name) &&
          std::find(others.begin(), others.end(), at) == others.end()) {
        number(channels[i].name);
        chosen.push_back(at);
      }
    }
  }
  // The tip follows from the joints, and its columns only add the curvature of the kinematics.
  const auto of_tip = [&channels](Index i) {
    return is_of_tip(channels[static_cast<std::size_t>(i)].name);
  };
  if (names.empty() && !std::all_of(chosen.begin(), chosen.end(), of_tip)) {
    std::erase_if(chosen, of_tip);
  }
  if (chosen.empty()) {
    std::string known;
    for (const MotionChannel& channel : channels) {
      if (known.size() < 200) known += (known.empty() ? "" : ", ") + channel.name;
    }
    throw InputError(option,
                     "no column is known to be a position or velocity; name those to "
                     "use, or their units; there are " +
                         known);
  }
  return chosen;
}

std::vector<std::string> left_out_positions(const std::vector<MotionChannel>& channels,
                                            const std::vector<Index>& chosen,
                                            const std::vector<Index>& others) {
  constexpr std::size_t kMostText = 200;
  std::string tip, unknown;
  const auto add = [](std::string& list, const std::string& name) {
    const bool full = list.size() >= kMostText;
    if (!list.ends_with(", ...")) list.append(list.empty() ? "" : ", ").append(full ? "..." : name);
  };
  const auto among = [](const std::vector<Index>& list, std::size_t i) {
    return std::find(list.begin(), list.end(), static_cast<Index>(i)) != list.end();
  };
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const auto& [name, unit, problem] = channels[i];
    if (among(chosen, i) || among(others, i) || is_desired(name)) continue;
    const auto is_unit = [&unit = unit](const char* one) { return unit == one; };
    constexpr std::array<const char*, 6> kKnown = {"rad", "m", "rad/s", "m/s", "N m", "N"};
    const bool known = std::any_of(kKnown.begin(), kKnown.end(), is_unit) || unit == kUnnamed;
    if (unit == "rad" || unit == "m") add(tip, name);
    if (!known && is_position(name))
      add(unknown, std::string(name).append(" [").append(unit).append("]"));
  }
  std::vector<std::string> notes;
  if (!tip.empty()) notes.push_back("left out beside the positions of joints: " + tip);
  if (!unknown.empty()) {
    notes.push_back("left out, as rad, mrad, deg, m, cm or mm is wanted: " + unknown);
  }
  return notes;
}

}  // namespace dashpot::apps
