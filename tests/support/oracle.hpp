#pragma once
// Hard second-order systems M q'' + C q' + K q = f of tests/data, in SI units. Their truth belongs
// to the stored doubles: in the tests FLINT and Arb prove each number.

#include <dashpot/analysis/system.hpp>
#include <dashpot/tests/support/places.hpp>

#include <algorithm>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace dashpot::testing {

using Json = nlohmann::json;

inline Eigen::VectorXd to_vector(const Json& numbers) {
  const auto values = numbers.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

inline Eigen::MatrixXd to_matrix(const Json& rows) {
  Eigen::MatrixXd result(rows.size(), rows.at(0).size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    result.row(static_cast<Eigen::Index>(i)) = to_vector(rows[i]).transpose();
  }
  return result;
}

inline analysis::System<> to_system(const Json& entry) {
  analysis::System<> system(entry.at("n").get<int>());
  system.mass = to_matrix(entry.at("mass"));
  system.damping = to_matrix(entry.at("damping"));
  system.stiffness = to_matrix(entry.at("stiffness"));
  return system;
}

/// The systems of a file, each in a line of its own, by their names. A line is read only when its
/// system is wanted: each test is a process, and most of them want none.
class SystemFile {
 public:
  /// Throws std::runtime_error naming the file.
  explicit SystemFile(const std::string& file) {
    std::ifstream stream(DASHPOT_TEST_DATA_DIR "/" + file);
    const std::string begin = "{\"name\":\"";
    for (std::string line; std::getline(stream, line);) {
      if (line.compare(0, begin.size(), begin) != 0) continue;
      if (line.back() == ',') line.pop_back();
      names.push_back(line.substr(begin.size(), line.find('"', begin.size()) - begin.size()));
      lines_.push_back(std::move(line));
    }
    if (names.empty()) throw std::runtime_error(file + ": no systems in it");
  }
  Json read(const std::string& name) const {
    const auto found = std::find(names.begin(), names.end(), name);
    return Json::parse(lines_.at(static_cast<std::size_t>(found - names.begin())));
  }

  std::vector<std::string> names;

 private:
  std::vector<std::string> lines_;
};

/// A name that GoogleTest takes.
inline std::string alphanumeric(const std::string& given) {
  std::string name;
  for (const char c : given) {
    if (c == '+') name += "_plus_";
    if (c == '-') name += "_minus_";
    name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  }
  return name;
}

}  // namespace dashpot::testing
