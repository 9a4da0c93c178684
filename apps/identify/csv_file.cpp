#include <dashpot/apps/identify/motion_rows.hpp>
#include <dashpot/controller/yaml/quantity.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>

namespace dashpot::apps {

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

namespace {

using controller::InputError;

constexpr std::size_t kMostColumns = 1000;
constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

/// A column by its heading.
struct Column {
  std::string name, unit;
  double factor = 1;  ///< to SI
  bool time = false;
  bool guessed = false;  ///< the time's unit
  bool text = false;     ///< not numbers
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

/// Returns what a name without a unit is measured in, by the letters it begins with.
std::string usual_unit(const std::string& name) {
  const std::string letters = name.substr(0, name.find_first_of("0123456789_.[( "));
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
                          "elapsed", "elapsed_time", "seconds", "datetime"}) {
    column.time = column.time || name == one;
  }
  if (unit.empty()) {
    column.guessed = column.time && name != "utime";
    unit = column.time ? (name == "utime" ? "us" : "s") : usual_unit(name);
  }
  // Another unit than a motion's matters only to those who want the column, and stays as it is.
  const Conversion conversion = to_si(unit).value_or(Conversion{unit, 1});
  column.unit = conversion.unit;
  column.factor = conversion.factor;
  if (column.time && column.unit != "s") {
    throw InputError("", "column " + std::to_string(number) + " (" + column.name + "): in " + unit +
                             ", a time is wanted in s, ms, us or ns");
  }
  return column;
}

/// Seconds from 1970 of "2026-01-31T12:00:00.5Z" or with a space; none if it is something else. A
/// zone makes no difference to what passes between two of them.
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

/// The cells of a line between `separator`s; between spaces, as many as there are.
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

bool is_number(std::string_view cell) {
  cell = trimmed(cell);
  double value = 0;
  return !cell.empty() &&
         std::from_chars(cell.data(), cell.data() + cell.size(), value).ec == std::errc{};
}

class CsvReader {
 public:
  explicit CsvReader(const FileHints& hints) : hints_(hints) {}

  MotionFile read(std::string_view rest) {
    if (rest.substr(0, 3) == "\xEF\xBB\xBF") rest.remove_prefix(3);
    for (line_ = 1; !rest.empty(); ++line_) {
      const auto end = std::min(rest.find('\n'), rest.size());
      const std::string_view row = rest.substr(0, end);
      rest.remove_prefix(std::min(end + 1, rest.size()));
      const std::string_view words = trimmed(row);
      if (words.empty()) continue;
      const auto name = words.find_first_not_of("#%/ \t");
      if (name != 0) {
        if (name != std::string_view::npos) comment_ = words.substr(name);
        continue;
      }
      if (!columns_.empty()) {
        read_row(row);
        continue;
      }
      const bool names = !is_number(cells_of(row, separator_of(row)).front());
      if (!hints_.columns.empty()) {
        read_names(hints_.columns);
        separator_ = separator_of(row);
      } else if (names) {
        read_names(row);
      } else if (!comment_.empty()) {  // the names are in the comment before
        read_names(comment_);
      } else {
        number_columns(row, rest);
      }
      if (!names) read_row(row);
    }
    if (columns_.empty() && !comment_.empty()) read_names(comment_);
    if (columns_.empty()) throw InputError("", "is empty");
    rows_.finish();
    scale_time();
    return std::move(file_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError("", "line " + std::to_string(line_) + ": " + what);
  }

  void read_names(std::string_view row) {
    separator_ = separator_of(row);
    std::vector<std::string_view> cells = cells_of(row, separator_);
    if (cells.size() > kMostColumns) throw InputError("", "more than 1000 columns");
    if (cells.size() > 1 && trimmed(cells.back()).empty()) cells.pop_back();
    for (const std::string_view cell : cells) {
      columns_.push_back(read_heading(cell, columns_.size() + 1));
    }
    const auto is_mode = [](const Column& column) { return column.name == "natural_frequency"; };
    if (std::any_of(columns_.begin(), columns_.end(), is_mode)) {
      throw InputError("",
                       "has modes in place of motion: give the log that they were exported from");
    }
    check_time();
  }

  void check_time() {
    const auto times = std::count_if(columns_.begin(), columns_.end(),
                                     [](const Column& column) { return column.time; });
    if (times == 0 && hints_.rate == 0) {
      fail(
          "no column of time (t, time, timestamp, stamp, utime, duration or elapsed): --rate HZ, "
          "or "
          "--columns with a name for each column");
    }
    if (times > 1) fail("two columns of time: --columns gives one of them another name");
    if (columns_.size() == static_cast<std::size_t>(times)) {
      throw InputError("", "no column but the time");
    }
  }

  /// Columns of a file without names: the first one is the time if it rises evenly.
  void number_columns(std::string_view row, std::string_view rest) {
    separator_ = separator_of(row);
    std::vector<double> first;
    const auto take = [&](std::string_view line) {
      double value = 0;
      const std::string_view cell = trimmed(cells_of(line, separator_).front());
      if (std::from_chars(cell.data(), cell.data() + cell.size(), value).ec == std::errc{}) {
        first.push_back(value);
      }
    };
    take(row);
    while (!rest.empty() && first.size() < 20) {
      const auto end = std::min(rest.find('\n'), rest.size());
      take(rest.substr(0, end));
      rest.remove_prefix(std::min(end + 1, rest.size()));
    }
    const double step = first.size() > 1 ? first[1] - first[0] : 0;
    bool rises = hints_.rate == 0 && step > 0;
    for (std::size_t i = 1; rises && i < first.size(); ++i) {
      rises = std::abs(first[i] - first[i - 1] - step) < 0.2 * step;
    }
    const std::size_t count = cells_of(row, separator_).size();
    for (std::size_t i = 0; i < count; ++i) {
      columns_.push_back({"c" + std::to_string(i + 1), kUnnamed});
    }
    if (rises) {
      columns_[0] = {"c1", "s", 1, true, true};
      file_.notes.emplace_back("no line of names: the first column is taken for the time");
    } else if (hints_.rate == 0) {
      fail(
          "numbers, where a line of names with units is wanted first: --columns \"time [s],q1 "
          "[rad],...\" says what they are, and --rate HZ stands for a time");
    }
    check_time();
  }

  void read_row(std::string_view row) {
    std::vector<std::string_view> cells = cells_of(row, separator_);
    if (cells.size() == columns_.size() + 1 && trimmed(cells.back()).empty()) cells.pop_back();
    if (cells.size() != columns_.size()) {
      fail("not " + std::to_string(columns_.size()) + " columns, as the names have, but " +
           std::to_string(cells.size()));
    }
    if (file_.channels.empty()) note_channels(cells);
    double at = hints_.rate > 0 ? static_cast<double>(samples_++) / hints_.rate : kMissing;
    values_.clear();
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const Column& column = columns_[i];
      if (column.text) continue;
      std::string_view cell = cells[i];
      std::string point;
      if (separator_ != ',' && cell.find(',') != std::string_view::npos) {
        point = cell;
        point[point.find(',')] = '.';
        cell = point;
      }
      if (!column.time) {
        values_.push_back(read_cell(cell, column, line_));
      } else if (hints_.rate == 0) {
        at = read_time(cell, columns_[i]);
      }
    }
    if (std::isnan(at)) fail("no time");
    rows_.add(at, values_.data(), values_.size());
  }

  /// From the first one, so that large numbers lose no digits.
  double read_time(std::string_view cell, Column& column) {
    const std::string_view text = trimmed(cell);
    if (const std::optional<double> date = read_date(text)) {
      column.guessed = false;
      if (!first_date_) first_date_ = date;
      return *date - *first_date_;
    }
    std::int64_t whole = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), whole);
    const bool is_whole = error == std::errc{} && end == text.data() + text.size();
    if (is_whole && !first_whole_) first_whole_ = whole;
    const double value = is_whole ? static_cast<double>(whole - *first_whole_) * column.factor
                                  : read_cell(cell, column, line_);
    fractions_ = fractions_ ||
                 std::abs(value / column.factor) != std::floor(std::abs(value / column.factor));
    return value -
           (is_whole || !first_whole_ ? 0 : static_cast<double>(*first_whole_) * column.factor);
  }

  /// The channels, without those whose first cell is text.
  void note_channels(const std::vector<std::string_view>& cells) {
    std::string left_out;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      Column& column = columns_[i];
      const std::string_view cell = trimmed(cells[i]);
      const bool letters = !cell.empty() && ((cell[0] >= 'A' && cell[0] <= 'Z') ||
                                             (cell[0] >= 'a' && cell[0] <= 'z'));
      const std::string word = lower(cell);
      column.text = !column.time && letters && word != "nan" && word != "inf" && word != "infinity";
      if (column.text) left_out += (left_out.empty() ? "" : ", ") + column.name;
      if (!column.time && !column.text) file_.channels.push_back({column.name, column.unit});
    }
    if (!left_out.empty()) file_.notes.push_back("left out, as they hold text: " + left_out);
    if (file_.channels.empty()) throw InputError("", "no column of numbers but the time");
  }

  /// A time without a unit in whole numbers whose steps are no seconds is in ms, us or ns.
  void scale_time() {
    const auto column =
        std::find_if(columns_.begin(), columns_.end(), [](const Column& one) { return one.time; });
    if (column == columns_.end() || !column->guessed || fractions_ || hints_.rate > 0) return;
    const double step =
        file_.time[file_.time.size() - 1] / static_cast<double>(file_.time.size() - 1);
    if (step < 1) return;
    constexpr double kMost = 500;  // times a unit: 0.5 s in ms, where us begin
    const auto [unit, factor] = step < kMost          ? std::pair("ms", 1e-3)
                                : step < 1000 * kMost ? std::pair("us", 1e-6)
                                                      : std::pair("ns", 1e-9);
    file_.time *= factor;
    file_.notes.push_back(column->name + " is taken to be in " + unit +
                          ", by its steps: give its unit if it is not");
  }

  FileHints hints_;
  MotionFile file_;
  Rows rows_{file_};
  std::vector<Column> columns_;
  std::vector<double> values_;
  std::string_view comment_;  ///< the last one
  char separator_ = ',';
  std::size_t line_ = 1;
  std::size_t samples_ = 0;
  std::optional<double> first_date_;
  std::optional<std::int64_t> first_whole_;
  bool fractions_ = false;  ///< the time has them
};

}  // namespace

MotionFile read_csv(std::string_view text, const FileHints& hints) {
  return CsvReader(hints).read(text);
}

}  // namespace dashpot::apps
