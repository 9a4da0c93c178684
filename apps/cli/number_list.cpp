#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/controller/input_error.hpp>

#include <charconv>
#include <cmath>
#include <sstream>
#include <vector>

namespace dashpot::apps {

Eigen::VectorXd parse_numbers(const std::string& option, const std::string& text) {
  std::vector<double> values;
  std::istringstream words(text + ",");
  for (std::string word; std::getline(words, word, ',');) {
    const auto first = word.find_first_not_of(" +");
    if (first != std::string::npos) word.erase(0, first);
    double value = 0;
    const char* end = word.data() + word.size();
    const auto [stop, error] = std::from_chars(word.data(), end, value);
    if (error != std::errc() || stop != end || !std::isfinite(value)) {
      throw controller::InputError(option, "'" + word + "' is not a finite number");
    }
    values.push_back(value);
  }
  return Eigen::Map<Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

Eigen::VectorXd numbers_per_joint(const std::string& option, const std::string& text,
                                  Eigen::Index n) {
  Eigen::VectorXd values = parse_numbers(option, text);
  if (values.size() != 1 && values.size() != n) {
    throw controller::InputError(
        option, std::to_string(values.size()) + " numbers, expected 1 or " + std::to_string(n));
  }
  if (values.minCoeff() < 0) throw controller::InputError(option, "a number is negative");
  if (values.size() == n) return values;
  return Eigen::VectorXd::Constant(n, values[0]);
}

}  // namespace dashpot::apps
