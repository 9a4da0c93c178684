#pragma once
// Eigen with the alignment that the libraries are compiled with, as analysis/matrix_types.hpp has
// it.

#if !defined(EIGEN_MAX_ALIGN_BYTES) || EIGEN_MAX_ALIGN_BYTES != 64 || \
    !defined(EIGEN_MAX_STATIC_ALIGN_BYTES) || EIGEN_MAX_STATIC_ALIGN_BYTES != 64
#error \
    "the libraries lay out Eigen's types otherwise: add -DEIGEN_MAX_ALIGN_BYTES=64 \
-DEIGEN_MAX_STATIC_ALIGN_BYTES=64, or use the CMake targets or the pkg-config files"
#endif

#include <Eigen/Core>
