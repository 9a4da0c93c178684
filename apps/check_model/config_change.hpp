#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

namespace dashpot::apps {

/// A key of a YAML file, from the root on, and its new value as YAML.
struct ConfigChange {
  std::vector<std::string> path;
  std::string value;
};

/// Returns "[a, b, ...]" with five digits.
std::string yaml_list(const Eigen::VectorXd& values);

/// Returns the text of a YAML mapping with some keys changed or added, and everything else,
/// including comments, as it was. If the text cannot be changed so (anchors, block sequences), it
/// is written again without comments, and `kept` is false.
std::string changed_config(const std::string& text, const std::vector<ConfigChange>& changes,
                           bool& kept);

}  // namespace dashpot::apps
