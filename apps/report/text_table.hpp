#pragma once
#include <dashpot/apps/report/json.hpp>

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <string>
#include <vector>

namespace dashpot::apps {

/// Text in aligned columns: a heading of one or more lines, then rows.
class TextTable {
 public:
  enum class Align { kLeft, kRight, kPoint };  ///< kPoint: numbers, decimal points in line

  struct Column {
    Align align;
    std::vector<std::string> heading;
  };
  TextTable(std::initializer_list<Column> columns = {}) {
    for (const Column& column : columns) add_column(column.align, column.heading);
  }

  /// All columns have equally many lines in `heading`.
  void add_column(Align align, std::vector<std::string> heading);
  void add_row(std::vector<std::string> cells);
  /// Adds a column to all rows. A table is filled by columns or by rows.
  void add_column(Align align, std::vector<std::string> heading,
                  const std::vector<std::string>& cells);

  /// Heading lines and rows, each indented by two spaces and ended by a newline.
  std::string text() const;

 private:
  std::vector<Align> aligns_;
  std::vector<std::vector<std::string>> headings_;
  std::vector<std::vector<std::string>> rows_;
};

/// `value` with so many significant digits; "-" if it is NaN.
std::string format_number(double value, int digits);

/// "0.1, -0.7": each with so many significant digits.
std::string format_list(const Eigen::VectorXd& values, int digits);

/// An upper bound with two significant digits, rounded up; "none" if it is infinite or NaN.
std::string format_bound(double bound);
/// Returns "12.345 +- 0.012": two digits of the deviation, and as many of the value; "?" stands for
/// a deviation that is not finite.
std::string with_deviation(double value, double deviation);

/// Numbers of one column with equally many decimals, which give the largest number so many
/// significant digits; a number that rounds to zero is "0".
std::vector<std::string> format_column(const std::vector<double>& values, int digits);

/// Returns "1 mode" or "3 modes"; `none` stands for 0.
std::string count(std::int64_t n, const std::string& what, const char* none = "0");

/// "q1" for the first coordinate, i = 0.
std::string joint_name(Eigen::Index i);

/// "q2 - 0.43 q5 + 0.21 q1 (95 deg)": entries relative to the largest, by falling size, without the
/// small ones; with the phase of an entry that is not in step with the largest. At most `width`
/// characters, if the numbers allow it.
std::string format_shape(const Eigen::VectorXcd& shape, std::size_t width);

/// The form of a field in a table for people.
struct TableCell {
  TextTable::Align align = TextTable::Align::kPoint;
  std::vector<std::string> heading;  ///< empty: the field is not in the table
  int digits = 6;                    ///< significant ones of a real number; kBound: format_bound
};
inline constexpr int kBound = -1;

/// One field of a record, listed once for all formats.
template <class Record>
struct Field {
  std::string json = {};  ///< its key; empty: not in JSON
  std::string csv = {};   ///< its heading with the unit; empty: not in CSV
  TableCell table = {};   ///< its form in tables for people
  std::function<Json(const Record&)> value;
  std::function<std::string(const Record&)> text = {};  ///< of the table, if unlike the value
};

/// Returns a value as the text of a table.
std::string cell_text(const Json& value, int digits);
/// Returns a value as a cell in CSV; empty if it is NaN.
std::string csv_text(const Json& value);

/// Returns a list of objects.
template <class Record>
Json json_of(const std::vector<Record>& records, const std::vector<Field<Record>>& fields) {
  Json list = Json::array();
  for (const Record& record : records) {
    Json& object = list.emplace_back(Json::object());
    for (const auto& field : fields) {
      if (!field.json.empty()) object[field.json] = field.value(record);
    }
  }
  return list;
}

/// Returns a line for each record, after one of headings if `headed`.
template <class Record>
std::string csv_of(const std::vector<Record>& records, const std::vector<Field<Record>>& fields,
                   bool headed = true) {
  std::string text;
  const auto add_line = [&](const auto& cell) {
    const char* separator = "";
    for (const auto& field : fields) {
      if (field.csv.empty()) continue;
      text += separator + cell(field);
      separator = ",";
    }
    text += '\n';
  };
  if (headed) add_line([](const auto& field) { return field.csv; });
  for (const Record& record : records) {
    add_line([&](const auto& field) { return csv_text(field.value(record)); });
  }
  return text;
}

/// Returns aligned columns with headings.
template <class Record>
std::string table_of(const std::vector<Record>& records, const std::vector<Field<Record>>& fields) {
  TextTable table;
  for (const auto& field : fields) {
    if (!field.table.heading.empty()) table.add_column(field.table.align, field.table.heading);
  }
  for (const Record& record : records) {
    std::vector<std::string> row;
    for (const auto& field : fields) {
      if (field.table.heading.empty()) continue;
      row.push_back(field.text ? field.text(record)
                               : cell_text(field.value(record), field.table.digits));
    }
    table.add_row(std::move(row));
  }
  return table.text();
}

}  // namespace dashpot::apps
