#pragma once
#include <dashpot/text/wrong_input.hpp>

namespace dashpot::controller {

using text::InputError;
using text::one_line;

}  // namespace dashpot::controller
