#define DASHPOT_COMPILED_HERE
#include <dashpot/tests/support/compiled_eigen.hpp>
