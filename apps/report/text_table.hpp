#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
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

}  // namespace dashpot::apps
