#include <dashpot/apps/records/csv_column.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/text/quantity.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace dashpot::apps {
namespace {

using controller::InputError;

constexpr std::size_t kMostColumns = 1000;
constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return result;
}

struct Conversion {
  std::string unit;
  double factor;
};

/// The SI unit that `unit` converts to, if it is written as usual.
std::optional<Conversion> to_si_as_written(std::string unit) {
  for (const auto& [name, usual] :
       {std::pair("sec", "s"), std::pair("seconds", "s"), std::pair("msec", "ms"),
        std::pair("usec", "us"), std::pair("nsec", "ns"), std::pair("\xC2\xB0", "deg"),
        std::pair("degree", "deg"), std::pair("degrees", "deg"), std::pair("radian", "rad"),
        std::pair("radians", "rad"), std::pair("\xC2\xB0/s", "deg/s")}) {
    if (unit == name) unit = usual;
  }
  if (unit.empty()) return std::nullopt;
  if (unit == "ns") return Conversion{"s", 1e-9};
  for (const char* si : {"s", "rad", "m", "rad/s", "m/s", "N m", "N"}) {
    try {
      return Conversion{si, text::parse_quantity("1 " + unit, si)};
    } catch (const std::invalid_argument&) {
      continue;
    }
  }
  return std::nullopt;
}

/// The SI unit that `unit` converts to, in any letter case that is unambiguous: M is not m.
std::optional<Conversion> to_si(const std::string& unit) {
  std::optional<Conversion> found = to_si_as_written(unit);
  if (found || unit.size() < 3 || unit.front() == 'M') return found;
  return to_si_as_written(lower(unit));
}

/// Returns the usual unit for a name without a unit, by its words.
std::string usual_unit(const std::string& name) {
  const std::vector<std::string> words = words_of(name);
  if (words.empty() || has_any(words, {"tip", "tcp", "ee", "pose", "cartesian", "wrench", "force",
                                       "error", "err"})) {
    return "";
  }
  if (has_any(words, {"tau", "torque", "torques", "effort", "efforts"})) return "N m";
  if (words.front() == "v" || has_any(words, {"qd", "dq", "vel", "velocity", "velocities"})) {
    return "rad/s";
  }
  if (has_any(words, {"q", "pos", "position", "positions", "angle", "theta"})) return "rad";
  return "";
}

}  // namespace

std::string_view trimmed(std::string_view text) {
  const auto begin = text.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return {};
  text = text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') {
    return trimmed(text.substr(1, text.size() - 2));
  }
  return text;
}

std::vector<std::string> words_of(std::string_view name) {
  std::vector<std::string> words(1);
  for (const char c : name) {
    const bool digit = c >= '0' && c <= '9', upper = c >= 'A' && c <= 'Z';
    const bool letter = upper || (c >= 'a' && c <= 'z');
    const bool was_digit =
        !words.back().empty() && words.back()[0] >= '0' && words.back()[0] <= '9';
    if ((!digit && !letter) || (!words.back().empty() && digit != was_digit)) {
      if (!words.back().empty()) words.emplace_back();
    }
    if (digit || letter) words.back() += upper ? static_cast<char>(c - 'A' + 'a') : c;
  }
  if (words.back().empty()) words.pop_back();
  return words;
}

bool has_any(const std::vector<std::string>& words, std::initializer_list<const char*> wanted) {
  return std::any_of(words.begin(), words.end(), [&wanted](const std::string& word) {
    return std::any_of(wanted.begin(), wanted.end(),
                       [&word](const char* one) { return word == one; });
  });
}

bool is_position(const std::string& name) {
  return usual_unit(name) == "rad";
}

bool is_of_tip(const std::string& name) {
  const std::vector<std::string> words = words_of(name);
  const bool axis = words.size() == 1 &&
                    has_any(words, {"x", "y", "z", "rx", "ry", "rz", "roll", "pitch", "yaw"});
  return axis || has_any(words, {"tip", "tcp", "ee", "pose", "cartesian", "error", "err"});
}

bool is_desired(const std::string& name) {
  std::string stem = lower(name);
  while (!stem.empty() &&
         std::string_view("0123456789_.[]() ").find(stem.back()) != std::string_view::npos) {
    stem.pop_back();
  }
  const std::string last = stem.substr(stem.find_last_of("_. ") + 1);
  for (const char* word : {"d", "des", "desired", "cmd", "command", "commanded", "ref", "reference",
                           "goal", "target", "setpoint"}) {
    if (last == word && last.size() < stem.size()) return true;
  }
  for (const char* word : {"desired", "target", "command", "cmd_", "ref_", "goal", "setpoint"}) {
    if (stem.starts_with(word)) return true;
  }
  return false;
}

bool set_unit(const std::string& unit, CsvColumn& column) {
  const std::optional<Conversion> conversion = to_si(unit);
  // A unit of other quantities is kept: it matters only if the column is asked for.
  column.unit = conversion ? conversion->unit : unit;
  column.factor = conversion ? conversion->factor : 1;
  return conversion.has_value();
}

CsvColumn read_heading(std::string_view cell, std::size_t number) {
  const std::string_view text = trimmed(cell);
  CsvColumn column;
  std::string unit;
  const auto open = text.find_last_of("[(");
  const bool index = open != std::string_view::npos && open + 1 < text.size() &&
                     text.find_first_not_of("0123456789", open + 1) == text.size() - 1;
  if (!index && open != std::string_view::npos && (text.back() == ']' || text.back() == ')')) {
    column.name = trimmed(text.substr(0, open));
    unit = trimmed(text.substr(open + 1, text.size() - open - 2));
    if (unit == "1" || unit == "-") unit.clear();
  } else {
    column.name = text;
    const auto bar = text.rfind('_');
    if (bar != std::string_view::npos && to_si(std::string(text.substr(bar + 1)))) {
      column.name = text.substr(0, bar);
      unit = text.substr(bar + 1);
    }
  }
  if (column.name.empty()) column.name = "column " + std::to_string(number);
  const std::string name = lower(column.name);
  for (const char* one : {"t", "time", "timestamp", "time_stamp", "stamp", "utime", "duration",
                          "elapsed", "elapsed_time", "seconds", "date", "datetime", "__time"}) {
    column.time = column.time || name == one;
  }
  if (unit.empty()) {
    column.guessed = column.time && name != "utime";
    unit = column.time ? (name == "utime" ? "us" : "s") : usual_unit(column.name);
  }
  set_unit(unit, column);
  if (column.time && column.unit != "s") {
    throw InputError("", "column " + std::to_string(number) + " (" + column.name + "): in " + unit +
                             ", a time is wanted in s, ms, us or ns");
  }
  return column;
}

std::vector<std::string_view> cells_of(std::string_view row, char separator) {
  std::vector<std::string_view> cells;
  if (separator == ' ') row = trimmed(row);
  while (cells.size() <= kMostColumns) {
    const auto next = std::min(row.find(separator), row.size());
    cells.push_back(row.substr(0, next));
    if (next == row.size()) break;
    row.remove_prefix(next + 1);
    if (separator == ' ') row.remove_prefix(std::min(row.find_first_not_of(' '), row.size()));
  }
  if (cells.size() > kMostColumns) throw InputError("", "more than 1000 columns");
  if (cells.size() > 1 && trimmed(cells.back()).empty()) cells.pop_back();
  return cells;
}

char separator_of(std::string_view row) {
  for (const char candidate : {';', '\t', ','}) {
    if (row.find(candidate) != std::string_view::npos) return candidate;
  }
  // "time [s]" is one name.
  const bool words = row.find_first_of("[(\"") == std::string_view::npos;
  return words && trimmed(row).find(' ') != std::string_view::npos ? ' ' : ',';
}

bool is_missing(std::string_view cell) {
  const std::string word = lower(trimmed(cell));
  for (const char* one : {"", "na", "n/a", "#n/a", "nan", "null", "none", "-", "--"}) {
    if (word == one) return true;
  }
  return false;
}

bool is_number(std::string_view cell) {
  cell = trimmed(cell);
  double value = 0;
  return !cell.empty() &&
         std::from_chars(cell.data(), cell.data() + cell.size(), value).ec == std::errc{};
}

std::optional<double> read_number(std::string_view cell) {
  std::string_view text = trimmed(cell);
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc::result_out_of_range) return kMissing;
  if (error == std::errc{} && end == text.data() + text.size()) {
    return std::isfinite(value) ? value : kMissing;
  }
  if (is_missing(text)) return kMissing;
  return std::nullopt;
}

std::optional<double> read_date(std::string_view text) {
  std::array<int, 5> part{};
  std::size_t at = 0;
  constexpr std::string_view kBetween = "--T:";
  for (std::size_t i = 0; i < part.size(); ++i) {
    const auto [end, error] = std::from_chars(text.data() + at, text.data() + text.size(), part[i]);
    if (error != std::errc{} || part[i] < 0) return std::nullopt;
    at = static_cast<std::size_t>(end - text.data());
    const char next = i < kBetween.size() ? kBetween[i] : ':';
    if (at >= text.size() || (text[at] != next && !(next == 'T' && text[at] == ' '))) {
      return std::nullopt;
    }
    ++at;
  }
  double second = 0;
  const auto [end, error] = std::from_chars(text.data() + at, text.data() + text.size(), second);
  if (error != std::errc{}) return std::nullopt;
  const std::chrono::year_month_day day{std::chrono::year(part[0]),
                                        std::chrono::month(static_cast<unsigned>(part[1])),
                                        std::chrono::day(static_cast<unsigned>(part[2]))};
  if (!day.ok()) return std::nullopt;
  const auto days = std::chrono::sys_days(day).time_since_epoch().count();
  return 86400.0 * static_cast<double>(days) + 3600 * part[3] + 60 * part[4] + second;
}

}  // namespace dashpot::apps
