#pragma once
#include <Eigen/Core>
#include <string>

namespace dashpot::apps {

/// Numbers between commas, "1,-2.5,0". Throws controller::InputError with `option` as key.
Eigen::VectorXd parse_numbers(const std::string& option, const std::string& text);

}  // namespace dashpot::apps
