#include <dashpot/text/quantity.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <optional>
#include <stdexcept>

namespace dashpot::text {
namespace {

/// A factor times powers of kg, m, s and rad.
struct Unit {
  double factor = 1;
  std::array<int, 4> powers{};

  void multiply(const Unit& other, int power) {
    factor *= std::pow(other.factor, power);
    for (std::size_t i = 0; i < powers.size(); ++i) powers[i] += power * other.powers[i];
  }
};

struct NamedUnit {
  std::string_view name;
  Unit unit;
};

constexpr std::array<NamedUnit, 20> kUnits = {{
    //         factor       kg m  s  rad
    {"g", {1e-3, {1, 0, 0, 0}}},
    {"kg", {1, {1, 0, 0, 0}}},
    {"m", {1, {0, 1, 0, 0}}},
    {"cm", {1e-2, {0, 1, 0, 0}}},
    {"mm", {1e-3, {0, 1, 0, 0}}},
    {"s", {1, {0, 0, 1, 0}}},
    {"ms", {1e-3, {0, 0, 1, 0}}},
    {"us", {1e-6, {0, 0, 1, 0}}},
    {"rad", {1, {0, 0, 0, 1}}},
    {"mrad", {1e-3, {0, 0, 0, 1}}},
    {"deg", {std::numbers::pi / 180, {0, 0, 0, 1}}},
    {"N", {1, {1, 1, -2, 0}}},
    {"kN", {1e3, {1, 1, -2, 0}}},
    {"Hz", {1, {0, 0, -1, 0}}},
    {"kHz", {1e3, {0, 0, -1, 0}}},
    {"rpm", {std::numbers::pi / 30, {0, 0, -1, 1}}},
    {"Nm", {1, {1, 2, -2, 0}}},
    {"Nms", {1, {1, 2, -1, 0}}},
    {"W", {1, {1, 2, -3, 0}}},
    {"J", {1, {1, 2, -2, 0}}},
}};

constexpr std::string_view kSpaces = " \t";

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kSpaces);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kSpaces) - begin + 1);
}

/// "m^2" times `sign` in the exponent, into `unit`; false if there is no such unit.
bool multiply(std::string_view factor, int sign, Unit& unit) {
  int power = 1;
  if (const std::size_t hat = factor.find('^'); hat != std::string_view::npos) {
    const std::string_view digits = factor.substr(hat + 1);
    if (digits.size() != 1 || digits[0] < '1' || digits[0] > '9') return false;
    power = digits[0] - '0';
    factor = factor.substr(0, hat);
  }
  for (const NamedUnit& known : kUnits) {
    if (known.name != factor) continue;
    unit.multiply(known.unit, sign * power);
    return true;
  }
  return false;
}

/// Nothing if `text` is not a unit. A single factor follows a '/', so that the ambiguous "N/m s" is
/// rejected.
std::optional<Unit> parse_unit(std::string_view text) {
  Unit unit;
  int sign = 1;
  while (!text.empty()) {
    const std::size_t end = text.find_first_of(" \t*/");
    if (!multiply(text.substr(0, end), sign, unit)) return {};
    if (end == std::string_view::npos) break;
    const std::string_view rest = trimmed(text.substr(end));
    const bool divides = rest.front() == '/';
    if (sign < 0 && !divides) return {};
    if (divides) sign = -1;
    text = divides || rest.front() == '*' ? trimmed(rest.substr(1)) : rest;
    if (text.empty()) return {};
  }
  return unit;
}

std::string quoted(std::string_view text) {
  constexpr std::size_t kLongest = 40;
  return "'" + std::string(text.substr(0, kLongest)) + (text.size() > kLongest ? "...'" : "'");
}

/// The number at the beginning of `text`, which is removed; may be NaN or infinite, as are numbers
/// that are too large; nothing if there is none.
std::optional<double> take_number(std::string_view& text) {
  static constexpr std::array<std::string_view, 12> kNotFinite = {
      ".nan",  ".NaN",  ".NAN",  ".inf",  ".Inf",  ".INF",
      "-.inf", "-.Inf", "-.INF", "+.inf", "+.Inf", "+.INF"};
  if (std::find(kNotFinite.begin(), kNotFinite.end(), text) != kNotFinite.end()) {
    return std::nan("");
  }
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  double value = 0;
  const auto [rest, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (status == std::errc::invalid_argument) return {};
  // Too large or too small: this gives infinity, zero or a denormal number.
  if (status == std::errc::result_out_of_range) {
    value = std::strtod(std::string(text.data(), rest).c_str(), nullptr);
  }
  text.remove_prefix(static_cast<std::size_t>(rest - text.data()));
  return value;
}

}  // namespace

double parse_quantity(std::string_view text, const std::string& unit) {
  std::string_view rest = trimmed(text);
  const std::optional<double> value = take_number(rest);
  if (!value) throw std::invalid_argument("is not a number but " + quoted(text));
  if (!std::isfinite(*value)) throw std::invalid_argument("is not finite: " + quoted(text));
  rest = trimmed(rest);
  if (rest.empty()) return *value;

  const std::optional<Unit> given = parse_unit(rest);
  if (!given) {
    throw std::invalid_argument("is not a number but " + quoted(text) + ": unknown unit " +
                                quoted(rest) +
                                (rest.starts_with("degree") ? "; write deg"
                                 : rest.starts_with(",") ? "; a decimal comma is written as a point"
                                                         : ""));
  }
  if (given->powers != parse_unit(unit).value().powers) {
    throw std::invalid_argument("has a wrong unit: " + quoted(text) + "; " +
                                (unit.empty() ? "a number without unit" : unit) + " is wanted");
  }
  return *value * given->factor;
}

void refuse_mixed_angles(const std::vector<std::string>& texts,
                         const std::vector<std::string>& units) {
  const auto bare = [](std::string_view text) {  // a number that is not zero and has no unit
    text = trimmed(text);
    const std::optional<double> value = take_number(text);
    return value && *value != 0 && trimmed(text).empty();
  };
  const auto has_unit = [](std::string_view text) {
    text = trimmed(text);
    return take_number(text) && !trimmed(text).empty();
  };
  for (std::size_t i = 0; i < texts.size(); ++i) {
    if (units[i] != "rad" || !bare(texts[i])) continue;
    for (std::size_t j = 0; j < texts.size(); ++j) {
      if (units[j] != "rad" || !has_unit(texts[j])) continue;
      throw std::invalid_argument(quoted(texts[i]) + " has no unit beside " + quoted(texts[j]) +
                                  "; give every number its unit, or none");
    }
  }
}

}  // namespace dashpot::text
