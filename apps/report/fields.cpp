#include <dashpot/apps/report/fields.hpp>

#include <array>
#include <cmath>
#include <cstdio>

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
  if (std::isnan(number)) return "";
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.17g", number);
  return text.data();
}

}  // namespace dashpot::apps
