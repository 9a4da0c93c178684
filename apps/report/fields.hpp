#pragma once
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/text_table.hpp>

#include <functional>
#include <string>
#include <vector>

namespace dashpot::apps {

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
