#pragma once
#include <dashpot/analysis/base/compiled_eigen.hpp>

/// Further parts of Eigen that tests use.
#ifndef DASHPOT_COMPILED_FOR_TESTS_HERE
#define DASHPOT_COMPILED_FOR_TESTS_HERE extern
#endif

namespace Eigen {

#define DASHPOT_COMPILED DASHPOT_COMPILED_FOR_TESTS_HERE template

DASHPOT_COMPILED class LDLT<MatrixXd, Lower>;
DASHPOT_COMPILED class PartialPivLU<MatrixXd>;
DASHPOT_COMPILED class PartialPivLU<LongMatrixX>;
DASHPOT_COMPILED class FullPivLU<MatrixXd>;
DASHPOT_COMPILED class FullPivLU<LongMatrixX>;
DASHPOT_COMPILED class GeneralizedSelfAdjointEigenSolver<MatrixXd>;

DASHPOT_COMPILED class HessenbergDecomposition<LongMatrixX>;
DASHPOT_COMPILED class RealSchur<LongMatrixX>;
DASHPOT_COMPILED RealSchur<LongMatrixX>& RealSchur<LongMatrixX>::compute(
    const EigenBase<LongMatrixX>&, bool);
DASHPOT_COMPILED class EigenSolver<LongMatrixX>;
DASHPOT_COMPILED EigenSolver<LongMatrixX>& EigenSolver<LongMatrixX>::compute(
    const EigenBase<LongMatrixX>&, bool);

}  // namespace Eigen

#undef DASHPOT_COMPILED
