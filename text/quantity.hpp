#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace dashpot::text {

/// The number that `text` writes, in the SI unit `unit`: "30 deg" wanted in "rad" is 0.5236.
/// Without a unit of its own, `text` is taken to be in `unit` ("" if there is none). Known are g,
/// kg, m, cm, mm, s, ms, us, rad, mrad, deg, N, kN, Hz, kHz, rpm, Nm and Nms, each with a power
/// ("m^2"), multiplied by a space or '*' and divided by '/' ("kg m^2", "N m s/rad", "m/s^2"). The
/// radian is a unit like any other: N m/rad is not N m, and Hz is not rad/s. Throws
/// std::invalid_argument with a sentence about `text` if it is not a finite number, or not one in
/// such a unit.
double parse_quantity(std::string_view text, const std::string& unit);

/// Throws std::invalid_argument if, among the entries of a list that are wanted in rad, one has a
/// unit of its own and another, which is not zero, has none: it is unknown whether "0, -45, 90 deg"
/// begins in degrees. `units` has one unit for each of `texts`.
void refuse_mixed_angles(const std::vector<std::string>& texts,
                         const std::vector<std::string>& units);

}  // namespace dashpot::text
