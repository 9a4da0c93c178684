#pragma once
#include <dashpot/apps/design/design_report.hpp>

#include <nlohmann/json.hpp>
#include <string>

namespace dashpot::apps {

/// How frequencies and ratios answer to the entries of the matrices, one object for each mode: the
/// gradients by M, C, K, by C_C and K_C where there is a jacobian, by a point mass at its origin
/// (`payload`, per kg) where it has six rows, and by each joint's inertia and friction.
nlohmann::ordered_json sensitivity_json(const DesignReport& report);

/// Writes them for people: percent by one percent of diagonal entries, by 1 kg of payload, and by
/// inertia and friction in the joints.
std::string sensitivity_text(const DesignReport& report);

}  // namespace dashpot::apps
