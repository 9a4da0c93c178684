#pragma once
#include <dashpot/identification/model/decay_data.hpp>

#include <array>
#include <vector>

namespace dashpot::identification {

/// The motions of a factor in all records, samples x 2 or x 1, and their derivatives by `first`,
/// `second` and each record's own scales, which change no other record.
struct FactorColumns {
  Eigen::MatrixXd value;
  std::vector<Eigen::MatrixXd> by_eigenvalue;
  std::array<Eigen::MatrixXd, 2> by_record_scale;
  std::vector<std::array<Eigen::MatrixXd, 2>> by_input_scale;
};

FactorColumns columns_of(const DecayFactor& factor, const DecayPart& part, bool derivatives);

/// The inputs themselves, samples x inputs: the direct response, such as of modes far above.
Eigen::MatrixXd direct_columns(const DecayPart& part);

/// Projects the constant, and the drift if any, out of each record's rows.
void take_constants(const DecayPart& part, Eigen::MatrixXd& columns);

/// A product of the motions of two factors that have products.
struct MotionProduct {
  Complex eigenvalue;             ///< lambda_i + lambda_j, 1/s; not below the real axis
  std::vector<Complex> strength;  ///< of each source, the product of both factors' strengths
};

/// The products of two eigenvalues of such factors, squares included; of a conjugate pair the one
/// above the real axis. The free motion of a smooth system near rest is a sum of such powers
/// (Poincare); third and higher orders are omitted. The factors' scales have to be known.
std::vector<MotionProduct> products_of(const std::vector<DecayFactor>& factors);

/// The motions of `products`, samples x (2 for each, or 1 if it is real).
Eigen::MatrixXd product_columns(const std::vector<MotionProduct>& products, const DecayPart& part);
Eigen::Index product_width(const std::vector<MotionProduct>& products);

/// Columns of the factors alone.
Eigen::Index factor_width(const std::vector<DecayFactor>& factors);

/// Gives factors without scales the scales that best fit the amplitudes that each record has by
/// itself. `noise` has each channel's noise.
void find_scales(const DecayData& data, const Eigen::VectorXd& noise,
                 std::vector<DecayFactor>& factors);

}  // namespace dashpot::identification
