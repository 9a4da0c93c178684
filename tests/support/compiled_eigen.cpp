#define DASHPOT_COMPILED_FOR_TESTS_HERE
#include <dashpot/tests/support/compiled_eigen.hpp>
