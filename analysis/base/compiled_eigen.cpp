#define DASHPOT_COMPILED_HERE
#include <dashpot/analysis/base/compiled_eigen.hpp>
