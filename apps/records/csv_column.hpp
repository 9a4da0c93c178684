#pragma once
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace dashpot::apps {

/// The unit of columns without names.
inline constexpr const char* kUnnamed = "?";

/// Without spaces, and quotation marks, around it.
std::string_view trimmed(std::string_view text);

/// The words of a name, in lower case: "tau_J_d[3]" has tau, j, d and 3.
std::vector<std::string> words_of(std::string_view name);
bool has_any(const std::vector<std::string>& words, std::initializer_list<const char*> wanted);
/// Whether a channel is a desired value and not a measured one: "q_d_0", "pos_cmd[1]".
bool is_desired(const std::string& name);
/// Whether a name is usual for the position of a joint: "q1", "theta_2".
bool is_position(const std::string& name);
/// Whether a name is usual for the pose or error of the tip: "x", "error_rx".
bool is_of_tip(const std::string& name);

/// A column by its heading.
struct CsvColumn {
  std::string name, unit;
  double factor = 1;  ///< to SI
  bool time = false;
  bool guessed = false;  ///< the time's unit
  bool text = false;     ///< not numbers
};

/// A column from "q1 [rad]", "q1 (deg)" or "q1_deg". Throws InputError for a time in another unit.
CsvColumn read_heading(std::string_view cell, std::size_t number);
/// Converts the column to SI; false if `unit` is not a unit of motion.
bool set_unit(const std::string& unit, CsvColumn& column);

/// The cells of a line between `separator`s; several spaces are one separator.
std::vector<std::string_view> cells_of(std::string_view row, char separator);
char separator_of(std::string_view row);

/// Whether a cell says that its sample is missing: it is empty, or NA, null, none.
bool is_missing(std::string_view cell);
/// Whether a cell begins with a number.
bool is_number(std::string_view cell);
/// A number; NaN if it is missing or too large, nothing for other text.
std::optional<double> read_number(std::string_view cell);
/// Seconds from 1970 of "2026-01-31T12:00:00.5Z" or with a space; nothing if it is something else.
/// The time zone is ignored, because only differences count.
std::optional<double> read_date(std::string_view text);

}  // namespace dashpot::apps
