#include <dashpot/apps/report/fields.hpp>
#include <dashpot/text/printable.hpp>

#include <cmath>

namespace dashpot::apps {

std::string cell_text(const Json& value, int digits) {
  if (value.is_string()) return value.get<std::string>();
  if (!value.is_number_float()) return value.dump();
  return digits == kBound ? format_bound(value) : format_number(value, digits);
}

std::string csv_text(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (!value.is_number_float()) return value.dump();
  const auto number = value.get<double>();
  return std::isnan(number) ? "" : text::number(number, 17);
}

}  // namespace dashpot::apps
