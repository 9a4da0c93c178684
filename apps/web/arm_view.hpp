#pragma once
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/system.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/lcmtypes/modes_t.hpp>
#include <dashpot/sim/arm.hpp>

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// Returns the chain for the page's kinematics: {"name", "joints": [{"name", "prismatic",
/// "lower", "upper", "origin", "axis", "frame"}], "tip"}. With T_0 = I,
///     T_i = T_i-1 [Rot(axis, q_i), origin] frame      (prismatic: [I, origin + q_i axis] frame)
/// is the frame of link i in B, and T_n tip is the frame of the tip. Frames are rows of 4 x 4.
nlohmann::ordered_json chain_json(const controller::RobotModel& model);

/// What a page needs to know of the arm beyond the messages.
class ArmView {
 public:
  /// `config` is the path of a configuration or a scene.
  explicit ArmView(const std::string& config);

  int dof() const { return config_.model.dof(); }
  double period() const { return config_.settings.period; }
  /// The gain margin that gains must leave, no unit.
  double gain_margin() const { return config_.settings.limits.gain_margin; }

  /// Returns the chain with {"walls": [{"name", "point", "normal", "stiffness"}]}. A wall's normal
  /// points to the free side; a simulated wall of constant stiffness has one, N/m, others null.
  nlohmann::ordered_json chain() const;

  /// Returns the damping ratio that the configuration asks for in a mode (JOINT, CARTESIAN), 0 if
  /// it asks for none.
  double wanted_ratio(int mode) const;

  /// Returns the receptance with the gains of the configuration at a posture, see receptance_json
  /// and place_of, with "zero_modes" (a row of n for each) and "damping_ratio". Throws InputError
  /// for another `place`, and std::runtime_error if there is no response there.
  nlohmann::ordered_json response(const std::vector<double>& position, int mode,
                                  const std::string& place) const;

 private:
  controller::Config config_;
  std::optional<sim::Wall> simulated_wall_;  ///< of a scene
  bool one_table_ = true;                    ///< its stiffness does not change
};

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
