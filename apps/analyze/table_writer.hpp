#pragma once
#include <dashpot/apps/analyze/report.hpp>

#include <string>
#include <vector>

namespace dashpot::apps {

/// The reports as text for people, at most 100 columns wide where the numbers allow it. Those of a
/// list are headed by their index, counted from 0. `bold` marks headings for a terminal.
std::string to_table(const std::vector<Report>& reports, bool as_list, bool bold);

}  // namespace dashpot::apps
