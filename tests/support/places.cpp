#include <dashpot/tests/support/places.hpp>

namespace dashpot::places {

// Known before any other global.
constinit const Place kSourcePlace(DASHPOT_SOURCE_PATH);
constinit const Place kDataPlace(DASHPOT_SOURCE_PATH "/tests/data");
constinit const Place kProgramPlace(DASHPOT_PROGRAM_PATH);
constinit const Place kPluginPlace(DASHPOT_PLUGIN_PATH);

}  // namespace dashpot::places
