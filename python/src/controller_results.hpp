#pragma once
#include <dashpot/controller/plugin.h>
#include <dashpot/python/src/convert.hpp>

namespace dashpot::python {

/// Each returns the latest result as a dict, or None before the first.
nb::object snapshot_of(dashpot_controller* controller);
nb::object modes_of(dashpot_controller* controller);
nb::object sampled_modes_of(dashpot_controller* controller);

/// Modes as modes_of returns them.
nb::dict to_dict(const dashpot_modes& found);

}  // namespace dashpot::python
