#pragma once
#include <dashpot/apps/report.hpp>

#include <string>
#include <vector>

namespace dashpot::apps {

/// One JSON object for each report, in a list if `as_list`. Every number can be read back exactly;
/// what is NaN or infinite is null. README.md lists the keys.
std::string to_json(const std::vector<Report>& reports, bool as_list);

}  // namespace dashpot::apps
