#define DASHPOT_COMPILED_HERE
#include <dashpot/analysis/compiled_eigen.hpp>
