#pragma once
#include <dashpot/apps/design/design_report.hpp>

#include <string>
#include <vector>

namespace dashpot::apps {

std::string design_json(const std::vector<DesignReport>& reports, bool as_list);
std::string design_table(const std::vector<DesignReport>& reports, bool as_list);
std::string region_json(const RegionReport& report);
std::string region_table(const RegionReport& report);
/// Returns what the answer lacks of what was asked: less than a tenth of the ratio somewhere, or
/// more than is allowed. Empty if neither.
std::string region_complaint(const RegionReport& report);
/// The map of the worst mode, a line for each configuration after one of headings.
std::string region_csv(const RegionReport& report);
/// A line that tells at which rates, 1/s, the slow modes decay that an integral of springs makes;
/// "" if there are none. `decays` by size.
std::string integral_text(const std::vector<double>& decays);

}  // namespace dashpot::apps
