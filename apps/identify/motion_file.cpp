#include <dashpot/apps/identify/motion_file.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/yaml/quantity.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/text/read_file.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string_view>

namespace dashpot::apps {
namespace {

using controller::InputError;
using Eigen::Index;

constexpr std::size_t kMostBytes = std::size_t{1} << 30;
constexpr std::size_t kMostColumns = 1000;
constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

std::string_view trimmed(std::string_view text) {
  const auto begin = text.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return {};
  text = text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') {
    return trimmed(text.substr(1, text.size() - 2));
  }
  return text;
}

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return result;
}

/// A column by its heading.
struct Column {
  std::string name, unit;
  double factor = 1;  ///< to SI
  bool time = false;
};

struct Conversion {
  std::string unit;
  double factor;
};

/// The SI unit that `unit` converts to.
std::optional<Conversion> to_si(const std::string& unit) {
  if (unit == "ns") return Conversion{"s", 1e-9};
  for (const char* si : {"s", "rad", "m", "rad/s", "m/s", "N m", "N"}) {
    try {
      return Conversion{si, controller::parse_quantity("1 " + unit, si)};
    } catch (const std::invalid_argument&) {
      continue;
    }
  }
  return std::nullopt;
}

/// What a name without a unit is measured in, by the letters it begins with.
std::string usual_unit(const std::string& name) {
  const std::string letters = name.substr(0, name.find_first_of("0123456789_ "));
  const auto is_any = [&letters](std::initializer_list<const char*> names) {
    return std::find(names.begin(), names.end(), letters) != names.end();
  };
  if (is_any({"q", "position", "pos", "angle"})) return "rad";
  if (is_any({"qd", "dq", "v", "vel", "velocity"})) return "rad/s";
  if (is_any({"tau", "torque", "effort"})) return "N m";
  return "";
}

Column read_heading(std::string_view cell, std::size_t number) {
  const std::string_view text = trimmed(cell);
  Column column;
  std::string unit;
  const auto open = text.find_first_of("[(");
  if (open != std::string_view::npos && (text.back() == ']' || text.back() == ')')) {
    column.name = trimmed(text.substr(0, open));
    unit = trimmed(text.substr(open + 1, text.size() - open - 2));
    if (unit == "1" || unit == "-") unit.clear();
    if (!unit.empty() && !to_si(unit)) {
      throw InputError("", "column " + std::to_string(number) + " (" + column.name +
                               "): unknown unit '" + unit + "'");
    }
  } else {
    column.name = text;
    const auto bar = text.rfind('_');
    if (bar != std::string_view::npos && to_si(std::string(text.substr(bar + 1)))) {
      column.name = text.substr(0, bar);
      unit = text.substr(bar + 1);
    }
  }
  if (column.name.empty()) {
    throw InputError("", "column " + std::to_string(number) + " has no name");
  }
  const std::string name = lower(column.name);
  column.time = name == "t" || name == "time" || name == "timestamp" || name == "utime";
  if (unit.empty()) {
    unit = column.time ? (name == "utime" ? "us" : "s") : usual_unit(name);
  }
  if (!unit.empty()) {
    const Conversion conversion = *to_si(unit);
    column.unit = conversion.unit;
    column.factor = conversion.factor;
  }
  if (column.time && column.unit != "s") {
    throw InputError("", "column " + std::to_string(number) + " (" + column.name + "): in " + unit +
                             ", a time is wanted in s, ms, us or ns");
  }
  return column;
}

double read_cell(std::string_view cell, const Column& column, std::size_t line) {
  std::string_view text = trimmed(cell);
  if (text.empty()) return kMissing;
  if (text.front() == '+') text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc::result_out_of_range) value = kMissing;
  if ((error != std::errc{} && error != std::errc::result_out_of_range) ||
      end != text.data() + text.size()) {
    throw InputError("", "line " + std::to_string(line) + ", " + column.name + ": '" +
                             std::string(text.substr(0, 40)) + "' is no number");
  }
  return std::isfinite(value) ? value * column.factor : kMissing;
}

/// Rows as they come, in one order of time.
class Rows {
 public:
  explicit Rows(MotionFile& file) : file_(file) {}

  /// The sample at `time` (s): `count` values.
  bool add(double time, const double* values, std::size_t count) {
    if (!times_.empty() && time <= times_.back()) {
      ++(time == times_.back() ? file_.duplicates : file_.out_of_order);
      return false;
    }
    times_.push_back(time);
    values_.insert(values_.end(), values, values + count);
    return true;
  }

  void finish() {
    constexpr std::size_t kLeast = 20;
    if (times_.size() < kLeast) {
      throw InputError("", std::to_string(times_.size()) + " samples, need 20 or more");
    }
    const auto N = static_cast<Index>(times_.size());
    file_.time = Eigen::Map<const Eigen::VectorXd>(times_.data(), N).array() - times_.front();
    file_.values = Eigen::Map<const Eigen::MatrixXd>(values_.data(),
                                                     static_cast<Index>(file_.channels.size()), N);
  }

 private:
  MotionFile& file_;
  std::vector<double> times_, values_;
};

MotionFile read_csv(const std::string& text) {
  MotionFile file;
  std::vector<Column> columns;
  std::optional<std::size_t> time;
  char separator = ',';
  Rows rows(file);
  std::vector<double> values;
  std::string_view rest(text);
  if (rest.substr(0, 3) == "\xEF\xBB\xBF") rest.remove_prefix(3);
  for (std::size_t line = 1; !rest.empty(); ++line) {
    const auto end = std::min(rest.find('\n'), rest.size());
    std::string_view row = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (trimmed(row).empty() || trimmed(row).front() == '#') continue;
    if (columns.empty()) {
      for (const char candidate : {';', '\t'}) {
        if (row.find(candidate) != std::string_view::npos) separator = candidate;
      }
    }
    const bool heading = columns.empty();
    std::size_t number = 0;
    double at = kMissing;
    values.clear();
    for (bool more = true; more; ++number) {
      const auto next = std::min(row.find(separator), row.size());
      more = next < row.size();
      const std::string_view cell = row.substr(0, next);
      row.remove_prefix(std::min(next + 1, row.size()));
      if (heading) {
        if (number == kMostColumns) throw InputError("", "more than 1000 columns");
        columns.push_back(read_heading(cell, number + 1));
        continue;
      }
      if (number >= columns.size()) {  // too many
        ++number;
        break;
      }
      const double value = read_cell(cell, columns[number], line);
      if (columns[number].time) {
        at = value;
      } else {
        values.push_back(value);
      }
    }
    if (heading) {
      for (std::size_t i = 0; i < columns.size(); ++i) {
        if (!columns[i].time) {
          file.channels.push_back({columns[i].name, columns[i].unit});
        } else if (time) {
          throw InputError(
              "", "two columns of time: " + columns[*time].name + " and " + columns[i].name);
        } else {
          time = i;
        }
      }
      if (!time) {
        throw InputError("", "line " + std::to_string(line) +
                                 ": no column of time (t, time, timestamp or utime)");
      }
      if (file.channels.empty()) throw InputError("", "no column but the time");
      continue;
    }
    if (number != columns.size()) {
      throw InputError("", "line " + std::to_string(line) + ": not " +
                               std::to_string(columns.size()) + " columns, as the first line has");
    }
    if (std::isnan(at)) {
      throw InputError("", "line " + std::to_string(line) + ": no time");
    }
    rows.add(at, values.data(), values.size());
  }
  if (columns.empty()) throw InputError("", "is empty");
  rows.finish();
  return file;
}

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
    }
    if (file.channels.size() != 3 * n) throw InputError("", "its states differ in joints");
    values.clear();
    for (const auto* list : {&state.joint_position, &state.joint_velocity, &state.joint_torque}) {
      for (const double value : *list) values.push_back(std::isfinite(value) ? value : kMissing);
    }
    if (!rows.add(1e-6 * static_cast<double>(state.utime), values.data(), values.size())) return;
    const bool joint = state.mode == state_t::JOINT;
    reference.assign(state.reference_joint_position.begin(), state.reference_joint_position.end());
    if (joint) {  // where the wrench is feed-forward alone, such as an excitation
      reference.insert(reference.end(), state.tip_wrench, state.tip_wrench + 6);
    } else {
      reference.insert(reference.end(), state.reference_tip_position,
                       state.reference_tip_position + 3);
      reference.insert(reference.end(), state.reference_tip_quaternion,
                       state.reference_tip_quaternion + 4);
    }
    // What a reference does without end, closer than this, moves nothing that can be seen.
    bool kept = reference.size() == reference_before.size();
    for (std::size_t i = 0; kept && i < reference.size(); ++i) {
      kept = std::abs(reference[i] - reference_before[i]) < 1e-9;
    }
    // Springs that have just started grow for a while.
    constexpr std::int64_t kGrowing = 500'000;  // us
    if (state.restarts != restarts) restarts = state.restarts, restarted = state.utime;
    file.free.push_back(kept && state.status == 0 && state.fault == 0 &&
                        state.utime - restarted > kGrowing);
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

}  // namespace

MotionFile read_motion_file(const std::string& path) try {
  std::string text;
  try {
    text = text::read_file(path, kMostBytes);
  } catch (const std::runtime_error& error) {
    throw InputError("", error.what());
  }
  return is_log(text) ? read_log(path) : read_csv(text);
} catch (const InputError& error) {
  throw error.in_file(path);
}

std::vector<Index> chosen_channels(const std::vector<MotionChannel>& channels,
                                   const std::string& names) {
  std::vector<Index> chosen;
  const auto number = [&channels](std::string_view name) {
    for (std::size_t i = 0; i < channels.size(); ++i) {
      if (channels[i].name == name) return static_cast<Index>(i);
    }
    std::string known;
    for (const MotionChannel& channel : channels) {
      known += (known.empty() ? "" : ", ") + channel.name;
    }
    throw InputError("--channels", "no channel '" + std::string(name) + "'; there are " + known);
  };
  for (std::string_view rest = names; !rest.empty();) {
    const auto end = std::min(rest.find(','), rest.size());
    const Index i = number(trimmed(rest.substr(0, end)));
    if (std::find(chosen.begin(), chosen.end(), i) != chosen.end()) {
      throw InputError("--channels", "'" + std::string(rest.substr(0, end)) + "' twice");
    }
    chosen.push_back(i);
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  for (const char* unit : {"rad", "m", "rad/s", "m/s"}) {
    for (std::size_t i = 0; chosen.empty() && i < channels.size(); ++i) {
      if (channels[i].unit != unit) continue;
      for (std::size_t k = i; k < channels.size(); ++k) {
        if (channels[k].unit == unit) chosen.push_back(static_cast<Index>(k));
      }
    }
  }
  if (chosen.empty()) {
    throw InputError("--channels",
                     "no column is known to be a position or velocity; name those to "
                     "use, or their units");
  }
  return chosen;
}

}  // namespace dashpot::apps
