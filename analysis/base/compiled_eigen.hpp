#pragma once
#include <dashpot/analysis/matrix_types.hpp>

#include <Eigen/Dense>

/// Parts of Eigen that many files use, compiled once (compiled_eigen.cpp) instead of in every file.
/// This header is precompiled for the libraries and the tests, so no file has to include it. It is
/// not for users.
#ifndef DASHPOT_COMPILED_HERE
#define DASHPOT_COMPILED_HERE extern
#endif

namespace Eigen {

using LongMatrixX = Matrix<long double, Dynamic, Dynamic>;
using BoundedMatrix = dashpot::analysis::Square<dashpot::analysis::kMaxDof>;

#define DASHPOT_COMPILED DASHPOT_COMPILED_HERE template

DASHPOT_COMPILED class LLT<MatrixXd, Lower>;
DASHPOT_COMPILED class LLT<LongMatrixX, Lower>;
DASHPOT_COMPILED class PartialPivLU<MatrixXcd>;
DASHPOT_COMPILED class HouseholderQR<MatrixXd>;
DASHPOT_COMPILED class ColPivHouseholderQR<MatrixXd>;
DASHPOT_COMPILED class JacobiSVD<MatrixXd>;
DASHPOT_COMPILED class JacobiSVD<LongMatrixX>;
DASHPOT_COMPILED class JacobiSVD<BoundedMatrix>;

DASHPOT_COMPILED class SelfAdjointEigenSolver<MatrixXd>;
DASHPOT_COMPILED SelfAdjointEigenSolver<MatrixXd>& SelfAdjointEigenSolver<MatrixXd>::compute(
    const EigenBase<MatrixXd>&, int);
DASHPOT_COMPILED class SelfAdjointEigenSolver<LongMatrixX>;
DASHPOT_COMPILED SelfAdjointEigenSolver<LongMatrixX>& SelfAdjointEigenSolver<LongMatrixX>::compute(
    const EigenBase<LongMatrixX>&, int);
DASHPOT_COMPILED class SelfAdjointEigenSolver<BoundedMatrix>;
DASHPOT_COMPILED SelfAdjointEigenSolver<BoundedMatrix>&
SelfAdjointEigenSolver<BoundedMatrix>::compute(const EigenBase<BoundedMatrix>&, int);

DASHPOT_COMPILED class HessenbergDecomposition<MatrixXd>;
DASHPOT_COMPILED class RealSchur<MatrixXd>;
DASHPOT_COMPILED RealSchur<MatrixXd>& RealSchur<MatrixXd>::compute(const EigenBase<MatrixXd>&,
                                                                   bool);
DASHPOT_COMPILED class EigenSolver<MatrixXd>;
DASHPOT_COMPILED EigenSolver<MatrixXd>& EigenSolver<MatrixXd>::compute(const EigenBase<MatrixXd>&,
                                                                       bool);

namespace internal {  // products of large matrices

using ColumnMapper = const_blas_data_mapper<double, Index, ColMajor>;
using RowMapper = const_blas_data_mapper<double, Index, RowMajor>;
using ResultMapper = blas_data_mapper<double, Index, ColMajor, 0, 1>;
using Traits = gebp_traits<double, double>;

DASHPOT_COMPILED struct gebp_kernel<double, double, Index, ResultMapper, Traits::mr, Traits::nr,
                                    false, false>;
DASHPOT_COMPILED struct gemm_pack_lhs<double, Index, ColumnMapper, Traits::mr, Traits::LhsProgress,
                                      Traits::LhsPacket4Packing, ColMajor>;
DASHPOT_COMPILED struct gemm_pack_lhs<double, Index, RowMapper, Traits::mr, Traits::LhsProgress,
                                      Traits::LhsPacket4Packing, RowMajor>;
DASHPOT_COMPILED struct general_matrix_matrix_product<Index, double, ColMajor, false, double,
                                                      ColMajor, false, ColMajor, 1>;
DASHPOT_COMPILED struct general_matrix_matrix_product<Index, double, ColMajor, false, double,
                                                      RowMajor, false, ColMajor, 1>;
DASHPOT_COMPILED struct general_matrix_matrix_product<Index, double, RowMajor, false, double,
                                                      ColMajor, false, ColMajor, 1>;
DASHPOT_COMPILED struct general_matrix_matrix_product<Index, double, RowMajor, false, double,
                                                      RowMajor, false, ColMajor, 1>;
DASHPOT_COMPILED struct general_matrix_vector_product<Index, double, RowMapper, RowMajor, false,
                                                      double, ColumnMapper, false, 0>;
DASHPOT_COMPILED struct general_matrix_vector_product<Index, double, RowMapper, RowMajor, false,
                                                      double, RowMapper, false, 1>;
DASHPOT_COMPILED struct general_matrix_vector_product<Index, double, ColumnMapper, ColMajor, false,
                                                      double, RowMapper, false, 0>;

}  // namespace internal
}  // namespace Eigen

#undef DASHPOT_COMPILED
