#pragma once
#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace dashpot::apps {

/// Its entries.
inline nlohmann::ordered_json json_list(const Eigen::VectorXd& vector) {
  auto list = nlohmann::ordered_json::array();
  for (const double value : vector) list.push_back(value);
  return list;
}

/// A list for each row.
inline nlohmann::ordered_json json_rows(const Eigen::MatrixXd& matrix) {
  auto list = nlohmann::ordered_json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) list.push_back(json_list(matrix.row(i)));
  return list;
}

}  // namespace dashpot::apps
