#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/text/printable.hpp>

#include <algorithm>
#include <array>
#include <cfenv>
#include <cmath>
#include <complex>
#include <cstdio>
#include <numbers>
#include <numeric>
#include <utility>

namespace dashpot::apps {
namespace {

/// Pads the cells of a column on the right so that, aligned right, their points stand in line.
void pad_after_point(std::vector<std::vector<std::string>>& lines, std::size_t column) {
  const auto after_point = [](const std::string& text) {
    return text.size() - std::min(text.find_first_of(".e"), text.size());
  };
  std::size_t longest = 0;
  for (const auto& line : lines) longest = std::max(longest, after_point(line[column]));
  for (auto& line : lines) line[column].append(longest - after_point(line[column]), ' ');
}

}  // namespace

void TextTable::add_column(Align align, std::vector<std::string> heading) {
  aligns_.push_back(align);
  headings_.push_back(std::move(heading));
}

void TextTable::add_row(std::vector<std::string> cells) {
  rows_.push_back(std::move(cells));
}

void TextTable::add_column(Align align, std::vector<std::string> heading,
                           const std::vector<std::string>& cells) {
  add_column(align, std::move(heading));
  if (rows_.empty()) rows_.resize(cells.size());
  for (std::size_t i = 0; i < cells.size(); ++i) rows_[i].push_back(cells[i]);
}

std::string TextTable::text() const {
  std::vector<std::vector<std::string>> lines = rows_;
  for (std::size_t i = 0; i < aligns_.size(); ++i) {
    if (aligns_[i] == Align::kPoint) pad_after_point(lines, i);
  }
  for (std::size_t k = headings_.empty() ? 0 : headings_[0].size(); k-- > 0;) {
    std::vector<std::string> line;
    for (const auto& heading : headings_) line.push_back(heading[k]);
    lines.insert(lines.begin(), std::move(line));
  }

  std::vector<std::size_t> widths(aligns_.size(), 0);
  for (const auto& line : lines) {
    for (std::size_t i = 0; i < line.size(); ++i) widths[i] = std::max(widths[i], line[i].size());
  }
  std::string result;
  for (const auto& line : lines) {
    std::string out;
    for (std::size_t i = 0; i < line.size(); ++i) {
      const std::string padding(widths[i] - line[i].size(), ' ');
      out += "  ";
      out += aligns_[i] == Align::kLeft ? line[i] + padding : padding + line[i];
    }
    out.erase(out.find_last_not_of(' ') + 1);
    result += out + '\n';
  }
  return result;
}

std::string format_number(double value, int digits) {
  if (std::isnan(value)) return "-";
  if (value == 0) return "0";
  std::array<char, 40> buffer{};
  std::snprintf(buffer.data(), buffer.size(), "%#.*g", digits, value);
  std::string text = buffer.data();
  if (text.back() == '.') text.pop_back();
  return text;
}

std::string format_list(const Eigen::VectorXd& values, int digits) {
  std::string text;
  for (const double value : values) {
    text += (text.empty() ? "" : ", ") + format_number(value, digits);
  }
  return text;
}

std::string format_bound(double bound) {
  if (!std::isfinite(bound)) return "none";
  const int rounding = std::fegetround();
  std::fesetround(FE_UPWARD);
  std::string text = format_number(bound, 2);
  std::fesetround(rounding);
  return text;
}

std::string with_deviation(double value, double deviation) {
  if (!std::isfinite(deviation)) return format_number(value, 3) + " +- ?";
  const double size = std::max({deviation, 1e-12 * std::abs(value), 1e-300});
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(size))), 0, 12);
  return text::fixed(value, decimals) + " +- " + text::fixed(deviation, decimals);
}

std::vector<std::string> format_column(const std::vector<double>& values, int digits) {
  double largest = 0;
  for (const double value : values) {
    if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
  }
  const int exponent = largest > 0 ? static_cast<int>(std::floor(std::log10(largest))) : 0;
  const bool fixed = exponent >= -4 && exponent < digits;
  const int decimals = digits - 1 - exponent;
  std::vector<std::string> result;
  for (const double value : values) {
    const bool zero = std::abs(value) < 0.5 * std::pow(10.0, -decimals);
    if (zero || !fixed || !std::isfinite(value)) {
      result.push_back(format_number(zero ? 0 : value, digits));
      continue;
    }
    result.push_back(text::fixed(value, decimals));
  }
  return result;
}

std::string count(std::int64_t n, const std::string& what, const char* none) {
  return (n == 0 ? none : std::to_string(n)) + " " + what + (n == 1 ? "" : "s");
}

std::string joint_name(Eigen::Index i) {
  return "q" + std::to_string(i + 1);
}

std::string format_shape(const Eigen::VectorXcd& shape, std::size_t width) {
  constexpr double kSmall = 0.02;
  constexpr double kInStep = 0.176;  // tangent of 10 degrees
  if (shape.size() == 0) return "";
  std::vector<Eigen::Index> order(static_cast<std::size_t>(shape.size()));
  std::iota(order.begin(), order.end(), 0);
  // In single precision, so that equal entries stay in order whatever their rounding errors.
  const Eigen::VectorXf size = shape.cwiseAbs().cast<float>();
  std::stable_sort(order.begin(), order.end(),
                   [&size](Eigen::Index i, Eigen::Index j) { return size[i] > size[j]; });
  std::string text = joint_name(order[0]);
  for (std::size_t k = 1; k < order.size(); ++k) {
    const std::complex<double> ratio = shape[order[k]] / shape[order[0]];
    if (!(std::abs(ratio) >= kSmall) || !std::isfinite(std::arg(ratio))) break;
    const bool in_step = std::abs(ratio.imag()) <= kInStep * std::abs(ratio.real());
    std::string term = in_step && ratio.real() < 0 ? " - " : " + ";
    if (std::abs(ratio) < 1 - 5e-3) term += format_number(std::abs(ratio), 2) + " ";
    term += joint_name(order[k]);
    if (!in_step) {
      term +=
          " (" + std::to_string(std::lround(std::arg(ratio) * 180 / std::numbers::pi)) + " deg)";
    }
    if (text.size() + term.size() + 4 > width) return text + " ...";
    text += term;
  }
  return text;
}

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
