#pragma once
#include <dashpot/identification/model/decay_data.hpp>

#include <array>
#include <vector>

namespace dashpot::identification {

/// The motions of a factor in all records, samples x 2 or x 1, and their derivatives by `first`,
/// `second` and the scales: of each record those by its own scales, which move no other one.
struct FactorColumns {
  Eigen::MatrixXd value;
  std::vector<Eigen::MatrixXd> by_eigenvalue;
  std::array<Eigen::MatrixXd, 2> by_record_scale;
  std::vector<std::array<Eigen::MatrixXd, 2>> by_input_scale;
};

FactorColumns columns_of(const DecayFactor& factor, const DecayPart& part, bool derivatives);

/// The inputs themselves, samples x inputs: what follows them at once, such as modes far above.
Eigen::MatrixXd direct_columns(const DecayPart& part);

/// Takes from the rows of each record what its constant, and its drift if there is one, can be.
void take_constants(const DecayPart& part, Eigen::MatrixXd& columns);

/// A product of the motions of two factors that have products.
struct MotionProduct {
  Complex eigenvalue;             ///< lambda_i + lambda_j, 1/s; not below the real axis
  std::vector<Complex> strength;  ///< of each source, the product of those of both
};

/// The products of two eigenvalues of such factors, squares included; of two that are conjugate the
/// one above the real axis. The free motion of a smooth system near rest is a sum of such powers
/// (Poincare); those of third order and more are left out. The factors' scales have to be known.
std::vector<MotionProduct> products_of(const std::vector<DecayFactor>& factors);

/// The motions of `products`, samples x (2 for each, or 1 if it is real).
Eigen::MatrixXd product_columns(const std::vector<MotionProduct>& products, const DecayPart& part);
Eigen::Index product_width(const std::vector<MotionProduct>& products);

/// Columns of the factors alone.
Eigen::Index factor_width(const std::vector<DecayFactor>& factors);

}  // namespace dashpot::identification
