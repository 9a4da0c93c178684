#pragma once
#include <dashpot/controller/robot_description.hpp>
#include <dashpot/identification/check_model/weak_form.hpp>

#include <string>
#include <vector>

namespace dashpot::identification {

/// A possible error of the model or a sensor, and the torques that it would add.
struct Hypothesis {
  int joint = 0;                         ///< to which it belongs
  std::vector<Eigen::MatrixXd> columns;  ///< each n x K, torque for a unit
  /// Words for it: "the mass of link 'a' is", and the unit, with the factor of its value.
  std::string what, unit;
  double factor = 1;
  bool gravity = false;  ///< tilts it: columns as of tilt_columns
  bool link_mass = false;
};

/// Returns the torques that a tilt of gravity by a radian would add, n x K each, in the two
/// directions of tilt_directions.
std::vector<Eigen::MatrixXd> tilt_columns(const controller::RobotDescription& robot,
                                          const WeakForm& form);
/// Returns the change of gravity by a tilt of a radian, for two directions at right angles (3 x 2,
/// m/s^2).
Eigen::Matrix<double, 3, 2> tilt_directions(const Eigen::Vector3d& gravity);

/// A link's mass and where its centre is, the direction of gravity, and torques with a wrong scale.
/// `model_torque` is n x K.
std::vector<Hypothesis> list_hypotheses(const controller::RobotDescription& robot,
                                        const controller::RobotModel& model, const WeakForm& form,
                                        const Eigen::MatrixXd& model_torque);

inline constexpr Eigen::Index kPayloadColumns = 10;  ///< of body_columns, in all
/// Returns the torques, n x K each, of a unit of mass (1), first moment (3) and inertia about the
/// origin (6: xx yy zz xy xz yz), fixed to the tip link of `model`: the first `count` of them.
std::vector<Eigen::MatrixXd> body_columns(const controller::RobotModel& model, const WeakForm& form,
                                          std::size_t count);

}  // namespace dashpot::identification
