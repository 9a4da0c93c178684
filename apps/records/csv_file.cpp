#include <dashpot/apps/records/csv_column.hpp>
#include <dashpot/apps/records/motion_file.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <sstream>

namespace dashpot::apps {
namespace {

using controller::InputError;

/// The error of a file without a time.
constexpr const char* kNoTime =
    "no column of time (t, time, timestamp, stamp, date, utime, duration or elapsed): --rate HZ, "
    "or --columns with a name for each column";

class CsvReader {
 public:
  explicit CsvReader(const FileHints& hints) : hints_(hints) {}

  MotionFile read(std::string_view text) {
    if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF")) {
      throw InputError("", "is text in UTF-16: save it as UTF-8");
    }
    if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    newline_ = text.find('\n') == std::string_view::npos ? '\r' : '\n';
    whole_ = text.empty() || text.back() == newline_;
    rest_ = text;
    for (line_ = 1; !rest_.empty(); ++line_) {
      const std::string_view row = next_line(rest_);
      const std::string_view words = trimmed(row);
      if (words.empty()) continue;
      const auto name = words.find_first_not_of("#%/ \t");
      if (name != 0) {
        if (name != std::string_view::npos) keep_names(words.substr(name), true);
      } else if (columns_.empty()) {
        begin(row);
      } else {
        read_row(row);
      }
    }
    if (columns_.empty() && names_line_ > 0) read_names(names_);
    if (columns_.empty()) throw InputError("", "is empty");
    if (rows_.size() < Rows::kLeast) {  // perhaps because cells are not numbers
      for (const MotionChannel& channel : file_.channels) {
        if (!channel.problem.empty()) throw InputError("", channel.problem);
      }
    }
    rows_.finish();
    scale_time();
    return std::move(file_);
  }

 private:
  [[noreturn]] static void fail(std::size_t line, const std::string& what) {
    throw InputError("", "line " + std::to_string(line) + ": " + what);
  }

  std::string_view next_line(std::string_view& rest) const {
    const auto end = std::min(rest.find(newline_), rest.size());
    const std::string_view row = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    return row;
  }

  /// Keeps a line that may have the names, if the next one has numbers.
  void keep_names(std::string_view row, bool comment) {
    names_ = row;
    names_line_ = line_;
    comment_ = comment;
  }

  /// A line before the first row of numbers, or that row.
  void begin(std::string_view row) {
    const std::vector<std::string_view> cells = cells_of(row, separator_of(row));
    const bool numbers = is_number(cells.front());
    if (!hints_.columns.empty()) {
      if (numbers || cells.size() == cells_of(hints_.columns, ',').size()) {
        read_names(hints_.columns);
        separator_ = separator_of(row);
      }
    } else if (!numbers) {
      keep_names(row, false);
      // If the names are clear, rows may begin with text; otherwise more lines may come before
      // them.
      if (hints_.rate > 0 || has_time(cells)) read_names(row);
      return;
    } else if (names_line_ > 0 &&
               (!comment_ || cells_of(names_, separator_of(names_)).size() == cells.size())) {
      read_names(names_);
    } else {
      number_columns(row);
    }
    if (numbers) read_row(row);
  }

  static bool has_time(const std::vector<std::string_view>& cells) {
    return std::any_of(cells.begin(), cells.end(),
                       [](std::string_view cell) { return read_heading(cell, 1).time; });
  }

  void read_names(std::string_view row) {
    separator_ = separator_of(row);
    for (const std::string_view cell : cells_of(row, separator_)) {
      columns_.push_back(read_heading(cell, columns_.size() + 1));
    }
    const auto is_mode = [](const CsvColumn& column) { return column.name == "natural_frequency"; };
    if (std::any_of(columns_.begin(), columns_.end(), is_mode)) {
      throw InputError("",
                       "has modes in place of motion: give the log that they were exported from");
    }
    check_time();
  }

  void check_time() const {
    const auto times = std::count_if(columns_.begin(), columns_.end(),
                                     [](const CsvColumn& column) { return column.time; });
    const std::size_t line = names_line_ > 0 ? names_line_ : line_;
    if (times == 0 && hints_.rate == 0) fail(line, kNoTime);
    if (times > 1) fail(line, "two columns of time: --columns gives one of them another name");
    if (columns_.size() == static_cast<std::size_t>(times)) {
      throw InputError("", "no column but the time");
    }
  }

  /// Columns of a file without names: the first one is the time if it rises evenly and, with a
  /// rate, to the end of the file.
  void number_columns(std::string_view row) {
    constexpr std::size_t kEven = 20;  // samples
    separator_ = separator_of(row);
    const std::size_t count = cells_of(row, separator_).size();
    const bool rated = hints_.rate > 0;
    std::vector<double> first;
    for (std::string_view rest = rest_; rated || first.size() < kEven; row = next_line(rest)) {
      const std::string_view cell = trimmed(cells_of(row, separator_).front());
      double value = 0;
      if (std::from_chars(cell.data(), cell.data() + cell.size(), value).ec == std::errc{}) {
        first.push_back(value);
      }
      if (rest.empty()) break;
    }
    const double step = first.size() > 1 ? first[1] - first[0] : 0;
    bool rises = step > 0 && (!rated || count > 1);
    for (std::size_t i = 1; rises && i < first.size(); ++i) {
      const double next = first[i] - first[i - 1];
      rises = i < kEven ? std::abs(next - step) < 0.2 * step : next > 0;
    }
    for (std::size_t i = 0; i < count; ++i) {
      columns_.push_back({"c" + std::to_string(i + 1), kUnnamed});
    }
    if (rises) {
      columns_[0] = {"c1", "s", 1, true, true};
      file_.notes.push_back(
          std::string("no line of names: the first column is taken for the time") +
          (rated ? ", and --rate stands in its place" : ""));
    } else if (!rated) {
      fail(line_,
           "numbers, where a line of names with units is wanted first: --columns \"time [s],q1 "
           "[rad],...\" says what they are, and --rate HZ stands for a time");
    }
    check_time();
  }

  void read_row(std::string_view row) {
    const std::vector<std::string_view> cells = cells_of(row, separator_);
    if (std::all_of(cells.begin(), cells.end(), [](auto cell) { return trimmed(cell).empty(); })) {
      return;
    }
    // An empty last cell may be the end of the line, or a sample.
    if (row.ends_with('\r')) row.remove_suffix(1);
    const bool open = cells.size() + 1 == columns_.size() && row.ends_with(separator_);
    if (cells.size() != columns_.size() && !open) {
      if (rest_.empty() && !whole_ && cells.size() < columns_.size() && rows_.size() > 0) {
        file_.notes.emplace_back("the last line ends early, and is left out");
        return;
      }
      fail(line_, "not " + std::to_string(columns_.size()) + " columns, as the names have, but " +
                      std::to_string(cells.size()));
    }
    if (file_.channels.empty()) {
      if (take_units(cells)) return;
      note_channels(cells);
    }
    double at = hints_.rate > 0 ? static_cast<double>(samples_++) / hints_.rate : kMissing;
    values_.clear();
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      if (columns_[i].text) continue;
      std::string_view cell = i < cells.size() ? cells[i] : std::string_view();
      std::string point;
      if (separator_ != ',' && cell.find(',') != std::string_view::npos) {
        point = cell;
        point[point.find(',')] = '.';
        cell = point;
      }
      if (!columns_[i].time) {
        values_.push_back(read_value(cell, columns_[i]));
      } else if (hints_.rate == 0) {
        at = read_time(cell, columns_[i]);
      }
    }
    if (std::isnan(at)) fail(line_, "no time");
    rows_.add(at, values_.data(), values_.size());
  }

  /// A second line of the heading, with the units alone.
  bool take_units(const std::vector<std::string_view>& cells) {
    std::vector<CsvColumn> columns = columns_;
    bool any = false;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      std::string unit(trimmed(cells[i]));
      if (unit.size() > 2 && (unit.front() == '[' || unit.front() == '(')) {
        unit = unit.substr(1, unit.size() - 2);
      }
      if (unit.empty() || unit == "-" || unit == "1") continue;
      if (is_number(unit)) return false;
      const bool motion = set_unit(unit, columns[i]);
      if (columns[i].time && (!motion || columns[i].unit != "s")) return false;
      columns[i].guessed = false;
      any = any || motion;
    }
    if (any) columns_ = std::move(columns);
    return any;
  }

  /// The sample of a channel. Text is an error only if the channel is used.
  double read_value(std::string_view cell, const CsvColumn& column) {
    if (const std::optional<double> value = read_number(cell)) return *value * column.factor;
    MotionChannel& channel = file_.channels[values_.size()];
    if (channel.problem.empty()) {
      channel.problem = "line " + std::to_string(line_) + ", " + column.name + ": '" +
                        std::string(trimmed(cell).substr(0, 40)) + "' is not a number";
    }
    return kMissing;
  }

  /// A time in two parts, so that no digits are lost.
  struct Stamp {
    std::int64_t whole = 0;
    double fraction = 0;
  };

  /// From the digits of `text`; from `value` if it is a date or has an exponent.
  static Stamp stamp_of(std::string_view text, double value) {
    constexpr auto kFixed = std::chars_format::fixed;
    Stamp stamp;
    const char* const end = text.data() + text.size();
    const char* at = std::from_chars(text.data(), end, stamp.whole).ptr;
    if (at != end && *at == '.') at = std::from_chars(at, end, stamp.fraction, kFixed).ptr;
    if (at != end) return {static_cast<std::int64_t>(std::floor(value)), value - std::floor(value)};
    if (text.front() == '-') stamp.fraction = -stamp.fraction;
    return stamp;
  }

  /// Time since the first stamp. Whole units and fractions are subtracted separately, so that large
  /// numbers lose no digits.
  double read_time(std::string_view cell, CsvColumn& column) {
    const std::string_view text = trimmed(cell);
    const std::optional<double> date = read_date(text), value = date ? date : read_number(text);
    if (!value) {
      throw InputError("", "line " + std::to_string(line_) + ", " + column.name + ": '" +
                               std::string(text.substr(0, 40)) +
                               "' is not a time, which is a number or 2026-01-31T12:00:00.5Z: "
                               "--rate HZ replaces the column");
    }
    if (date) column.guessed = false;
    constexpr double kMost = 9e18;  // what an int64 holds
    if (!(std::abs(*value) < kMost)) return kMissing;
    const Stamp stamp = stamp_of(text, *value);
    if (!first_) first_ = stamp;
    return (static_cast<double>(stamp.whole - first_->whole) + stamp.fraction - first_->fraction) *
           column.factor;
  }

  /// The channels, without those whose first cell is text.
  void note_channels(const std::vector<std::string_view>& cells) {
    std::string left_out;
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      CsvColumn& column = columns_[i];
      const std::string_view cell = i < cells.size() ? trimmed(cells[i]) : std::string_view();
      const bool letters = !cell.empty() && ((cell[0] >= 'A' && cell[0] <= 'Z') ||
                                             (cell[0] >= 'a' && cell[0] <= 'z'));
      column.text = !column.time && letters && !read_number(cell);
      if (column.text) left_out += (left_out.empty() ? "" : ", ") + column.name;
      if (!column.time && !column.text) file_.channels.push_back({column.name, column.unit, ""});
    }
    if (!left_out.empty()) file_.notes.push_back("left out, as they hold text: " + left_out);
    if (file_.channels.empty()) throw InputError("", "no column of numbers but the time");
  }

  /// A time without a unit is in ms, us or ns if its steps are too large for s. For a time with a
  /// unit and unlikely steps, a note asks for the unit.
  void scale_time() {
    const auto column = std::find_if(columns_.begin(), columns_.end(),
                                     [](const CsvColumn& one) { return one.time; });
    if (column == columns_.end()) return;
    if (hints_.rate > 0) {
      file_.notes.push_back(column->name + " is not read, --rate stands in its place");
      return;
    }
    const Eigen::Index count = file_.time.size() - 1;
    Eigen::VectorXd steps = file_.time.tail(count) - file_.time.head(count);
    std::nth_element(steps.begin(), steps.begin() + count / 2, steps.end());
    const double step = steps[count / 2];
    constexpr double kSlow = 0.04, kSlowest = 0.5;  // s; as ms they are 25 kHz and 2 kHz
    constexpr double kFastest = 2e-5;               // s
    if (!column->guessed) {
      if (step < kSlowest && step > kFastest) return;
      std::ostringstream text;
      text << column->name << " has steps of " << step << " s: is it in "
           << (step < kSlowest          ? "s"
               : step < 1000 * kSlowest ? "ms"
                                        : "us")
           << "? Then the frequencies are wrong";
      file_.notes.push_back(text.str());
      return;
    }
    if (step < kSlow) return;
    constexpr double kMost = 500;  // times a unit: 0.5 s in ms, where us begin
    const auto [unit, factor] = step < kSlowest       ? std::pair("s", 1.0)
                                : step < kMost        ? std::pair("ms", 1e-3)
                                : step < 1000 * kMost ? std::pair("us", 1e-6)
                                                      : std::pair("ns", 1e-9);
    file_.time *= factor;
    file_.notes.push_back(column->name + " is taken to be in " + unit +
                          ", by its steps: give its unit if it is not");
  }

  static constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

  FileHints hints_;
  MotionFile file_;
  Rows rows_{file_};
  std::vector<CsvColumn> columns_;
  std::vector<double> values_;
  std::string_view rest_;   ///< unread text
  std::string_view names_;  ///< the last line that may have the names
  std::size_t names_line_ = 0;
  bool comment_ = false;  ///< it is one
  char newline_ = '\n';
  bool whole_ = true;  ///< the last line has an end
  char separator_ = ',';
  std::size_t line_ = 1;
  std::size_t samples_ = 0;
  std::optional<Stamp> first_;
};

}  // namespace

MotionFile read_csv(std::string_view text, const FileHints& hints) {
  return CsvReader(hints).read(text);
}

}  // namespace dashpot::apps
