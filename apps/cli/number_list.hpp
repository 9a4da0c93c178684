#pragma once
#include <Eigen/Core>
#include <string>

namespace dashpot::apps {

/// Numbers between commas, "1,-2.5,0". Throws controller::InputError with `option` as key.
Eigen::VectorXd parse_numbers(const std::string& option, const std::string& text);

/// n numbers that are not negative; a single one is that of all joints. Throws likewise.
Eigen::VectorXd numbers_per_joint(const std::string& option, const std::string& text,
                                  Eigen::Index n);

}  // namespace dashpot::apps
