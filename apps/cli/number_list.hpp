#pragma once
#include <dashpot/text/setting_reader.hpp>

#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <string>

namespace dashpot::apps {

/// Quantities between commas, "1,-30 deg,0", in SI: one for each of `units`, the unit of a number
/// without a unit (see text::parse_quantity). Throws controller::InputError with `option` as key.
Eigen::VectorXd parse_quantities(const std::string& option, const std::string& text,
                                 const text::Units& units);

/// The same, none negative; a single quantity applies to all joints. The word none stands for
/// `none` unless that is NaN.
Eigen::VectorXd quantities_per_joint(const std::string& option, const std::string& text,
                                     const text::Units& units, double none = text::kNoNone);

/// Returns the direction of length 1 that --direction says: "x", "-z" or "0,0.6,0.8". Throws
/// InputError.
Eigen::Vector3d read_direction(const std::string& text);

/// Checks that an option is a quantity from `least` to `most`, in the SI unit `unit`, and turns it
/// into a number without unit, as CLI::Option::transform asks for; `what` describes it. A
/// refusal names the smaller unit with which a number without a unit would fit.
CLI::Validator quantity(const std::string& unit, double least, double most,
                        const std::string& what);

/// Accepts a damping ratio up to 1e9, with a warning if it is likely to be a percentage.
CLI::Validator damping_ratio();

/// Accepts any positive quantity.
CLI::Validator positive(const std::string& unit, const std::string& what);

/// Accepts the period of a control loop, s.
CLI::Validator control_period();

}  // namespace dashpot::apps
