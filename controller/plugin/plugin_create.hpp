#pragma once
#include <dashpot/controller/plugin.h>
#include <dashpot/controller/config.hpp>

namespace dashpot::controller {

/// Returns a controller as dashpot_create does, from a configuration that was read before. Throws
/// InputError, with the key `gains`, for gains that dashpot_set_gains would refuse.
dashpot_controller* create_controller(const Config& config);

}  // namespace dashpot::controller
