#pragma once
#include <dashpot/controller/plugin.h>
#include <dashpot/python/src/convert.hpp>

namespace dashpot::python {

/// Each returns the latest result as a dict, or None as long as there is none.
nb::object snapshot_of(dashpot_controller* controller);
nb::object modes_of(dashpot_controller* controller);
nb::object sampled_modes_of(dashpot_controller* controller);

}  // namespace dashpot::python
