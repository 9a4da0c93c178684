#pragma once
#include <dashpot/apps/analyze/report.hpp>

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace dashpot::apps {

/// One JSON object for each report, in a list if `as_list`. Every number can be read back exactly;
/// what is NaN or infinite is null. docs/command-line.md lists the keys.
std::string to_json(const std::vector<Report>& reports, bool as_list);

/// One report as a JSON object.
nlohmann::ordered_json report_json(const Report& report);

/// The modes of a spectrum as a JSON list.
nlohmann::ordered_json modes_json(const analysis::Spectrum<>& spectrum);

/// The text of a document: objects take a line for each item, numbers and matrices stay on one.
std::string json_text(const nlohmann::ordered_json& document);

}  // namespace dashpot::apps
