#pragma once
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/system.hpp>

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <string>

namespace dashpot::apps {

/// A place on the arm: the row d of its motion, and the joint motion that moves it by one unit, n
/// each.
struct Place {
  Eigen::RowVectorXd row;
  Eigen::VectorXd motion;
  std::string unit;  ///< of its receptance
};

/// Returns J# = M^-1 J' (J M^-1 J')^-1; near a singularity for the remaining directions.
Eigen::MatrixXd consistent_inverse(const Eigen::MatrixXd& M, const Eigen::MatrixXd& J);

/// Reads "tip/I" or "joint/I". Throws InputError.
Place place_of(const std::string& place, const Eigen::MatrixXd& M, const Eigen::MatrixXd& J);

/// Returns the receptance row (-w^2 M + i w C + K)^-1 row' over the frequencies of the modes:
/// {"omega" rad/s, "magnitude", "phase" rad, "unit", "natural_frequency"}.
nlohmann::ordered_json receptance_json(const analysis::System<>& system,
                                       const analysis::Spectrum<>& spectrum,
                                       const Eigen::RowVectorXd& row, const std::string& unit);

}  // namespace dashpot::apps
