#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/text/printable.hpp>
#include <dashpot/text/quantity.hpp>

#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <vector>

namespace dashpot::apps {
namespace {

using text::Units;

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> words;
  std::istringstream stream(text + ",");
  for (std::string word; std::getline(stream, word, ',');) words.push_back(word);
  return words;
}

/// Refuses a list whose length is not `expected`.
[[noreturn]] void refuse_length(const std::string& option, const std::vector<std::string>& words,
                                const std::string& expected) {
  const std::string& only = words.front();
  const std::size_t end = only.find_last_not_of(' ');
  const bool spaces = words.size() == 1 && end != std::string::npos &&
                      only.find_first_of("0123456789", only.find(' ')) < end + 1 &&
                      only.find(' ') < end;
  throw InputError(option, std::to_string(words.size()) +
                               (words.size() == 1 ? " number" : " numbers") + ", expected " +
                               expected + (spaces ? ", with commas between them" : ""));
}

double parse(const std::string& option, const std::string& word, const std::string& unit,
             double none = text::kNoNone) {
  if (!std::isnan(none) && word == "none") return none;
  try {
    return text::parse_quantity(word, unit);
  } catch (const std::invalid_argument& error) {
    throw InputError(option, error.what());
  }
}

}  // namespace

Eigen::VectorXd parse_quantities(const std::string& option, const std::string& text,
                                 const Units& units) {
  const std::vector<std::string> words = split(text);
  if (words.size() != units.size()) {
    refuse_length(option, words, std::to_string(units.size()));
  }
  Eigen::VectorXd values(static_cast<Eigen::Index>(units.size()));
  for (std::size_t i = 0; i < words.size(); ++i) {
    values[static_cast<Eigen::Index>(i)] = parse(option, words[i], units[i]);
  }
  try {
    text::refuse_mixed_angles(words, units);
  } catch (const std::invalid_argument& error) {
    throw InputError(option, error.what());
  }
  return values;
}

Eigen::VectorXd quantities_per_joint(const std::string& option, const std::string& text,
                                     const Units& units, double none) {
  const std::vector<std::string> words = split(text);
  const std::size_t given = words.size();
  if (given != 1 && given != units.size()) {
    refuse_length(option, words, "1 or " + std::to_string(units.size()));
  }
  Eigen::VectorXd values(static_cast<Eigen::Index>(units.size()));
  for (std::size_t i = 0; i < units.size(); ++i) {
    values[static_cast<Eigen::Index>(i)] = parse(option, words[given == 1 ? 0 : i], units[i], none);
  }
  if (values.minCoeff() < 0) throw InputError(option, "a number is negative");
  return values;
}

Eigen::Vector3d read_direction(const std::string& text) {
  static const std::map<std::string, Eigen::Vector3d> axes = {{"x", {1, 0, 0}}, {"-x", {-1, 0, 0}},
                                                              {"y", {0, 1, 0}}, {"-y", {0, -1, 0}},
                                                              {"z", {0, 0, 1}}, {"-z", {0, 0, -1}}};
  if (const auto axis = axes.find(text); axis != axes.end()) return axis->second;
  const Eigen::Vector3d given = parse_quantities("--direction", text, {"", "", ""});
  if (given.isZero(0)) throw InputError("--direction", "is zero: a touch needs a direction");
  return given.normalized();
}

CLI::Validator quantity(const std::string& unit, double least, double most,
                        const std::string& what) {
  const auto value_of = [=](const std::string& text) {
    try {
      const double value = text::parse_quantity(text, unit);
      if (value >= least && value <= most) return std::optional(value);
    } catch (const std::invalid_argument&) {
    }  // reported below
    return std::optional<double>();
  };
  const auto convert = [=](std::string& text) -> std::string {
    if (const auto value = value_of(text)) {
      text = text::number(*value, 17);
      return "";
    }
    std::string meant;
    for (const char* smaller : {"deg", "ms", "us"}) {
      const std::string other = text + " " + smaller;
      if (meant.empty() && value_of(other)) meant = "; is '" + other + "' meant?";
    }
    return what + " is wanted, not '" + text + "'" + meant;
  };
  return CLI::Validator(convert, "");
}

CLI::Validator damping_ratio() {
  constexpr double kLargest = 1e9, kUnlikely = 5;  // may be a percentage
  CLI::Validator ratio =
      quantity("", std::numeric_limits<double>::min(), kLargest, "a positive ratio up to 1e9");
  return CLI::Validator(
      [ratio](std::string& text) {
        std::string refusal = ratio(text);
        const double value = refusal.empty() ? std::stod(text) : 0;
        if (value >= kUnlikely) {
          std::ostringstream warning;
          warning << "warning: a damping ratio of " << value
                  << " is wanted; a ratio is not a percentage: " << value << " % would be "
                  << value / 100;
          print_error(warning.str());
        }
        return refusal;
      },
      "");
}

CLI::Validator positive(const std::string& unit, const std::string& what) {
  using Limits = std::numeric_limits<double>;
  return quantity(unit, Limits::min(), Limits::max(), what);
}

CLI::Validator control_period() {
  constexpr double kLongest = 0.1;  // s, beyond what any arm is controlled with
  return quantity("s", std::numeric_limits<double>::min(), kLongest, "a period up to 0.1 s");
}

}  // namespace dashpot::apps
