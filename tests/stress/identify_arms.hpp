#pragma once
#include <dashpot/tests/stress/part.hpp>

namespace dashpot::stress {

/// `dashpot identify` on recordings of arms that MuJoCo moves: prints a table of what is believed,
/// false, found and within its intervals. `count`: recordings of a clean release; other kinds have
/// more or fewer. What a row lacks of what it should have is printed; only where less than half of
/// the strong modes of a clean release are found is not all well.
bool identify_arms(const Request& request);

}  // namespace dashpot::stress
