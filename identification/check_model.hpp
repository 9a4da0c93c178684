#pragma once
#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/robot_description.hpp>
#include <dashpot/identification/torque_record.hpp>

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::identification {

/// A fitted parameter. The truth lies within 1.96 deviations of the value in 95 of 100 cases.
struct Estimate {
  double value = 0;
  double deviation = std::numeric_limits<double>::infinity();
  bool determined = false;  ///< the records narrow it down
};

/// Results of the torques for one joint. For a prismatic joint read N for N m.
struct JointCheck {
  /// Root mean square of torque less model, N m, over means of about 2 T: for the model's M, C and
  /// g alone, and with all fitted parameters.
  double residual_before = 0, residual_after = 0;
  Estimate offset;             ///< N m
  Estimate coulomb_friction;   ///< N m; all of it, whatever the model says
  Estimate viscous_friction;   ///< N m s/rad; likewise
  Estimate reflected_inertia;  ///< kg m^2; likewise, as seen by the torque commands
  bool moves = false;          ///< enough for its friction
  /// Shares of the torque's variation in the validation part that the model explains before and
  /// after the fit; and the correlation of the residual from window to window, 0 for noise.
  double explained_before = 0, explained_after = 0, correlation = 0;
  /// Motion that would determine the undetermined parameters; empty: all are determined.
  std::string wanted;
  std::string suspicious;  ///< why the model or the data of this joint is doubted; empty: no doubt
};

/// The payload with which the torques agree best, in place of the description's payload.
struct PayloadCheck {
  Estimate mass;                   ///< kg
  std::array<Estimate, 3> center;  ///< of mass, from the tip link's origin, m
};

/// A stretch of a record that was left out.
struct LeftOut {
  int record = 0;
  double from = 0, to = 0;  ///< s, of the record's time
};

struct ModelCheck {
  TorqueKind kind = TorqueKind::kWhole;
  std::vector<JointCheck> joints;
  PayloadCheck payload;
  /// Columns that look exchanged or turned around, and the joints whose torques then fit far
  /// better; empty: none. The other results mean little until the columns are corrected.
  std::vector<std::string> order;
  /// The gravity with which whole torques fit, in the axes of the root link, m/s^2, if it differs
  /// from the description's; the other results use it.
  std::optional<Eigen::Vector3d> gravity;
  double gravity_deviation = 0;  ///< of its direction, rad
  bool gravity_fits = false;     ///< the residual is small with it
  /// Delay of the torques after their times, s, as of commanded torques. Negative: the torques were
  /// measured late.
  Estimate delay;
  std::vector<std::string> ambiguities;  ///< parameters that the records cannot separate
  std::vector<LeftOut> contacts;         ///< where other forces acted
  double used = 0;                       ///< s of motion, of which
  double validation = 0;                 ///< s were kept for validation
  double window = 0;                     ///< 2 T, s
  /// Parameters of the fit, number of their combinations that the records determine, and ratio of
  /// the best determined to the worst one, in units of each parameter's effect.
  int parameters = 0, rank = 0;
  double condition = 0;
  /// For offset, Coulomb and viscous friction of each joint (3 n), the payload's mass, first moment
  /// (3) and inertia (6: xx, yy, zz, xy, xz, yz) about the tip link's origin, reflected inertias
  /// (n) and the delay.
  Eigen::MatrixXd covariance;
  controller::Attachment attachment;  ///< the description's, with the payload that was found
};

struct ModelCheckOptions {
  double validation = 0;       ///< share of each record, at its end, that is kept for validation
  bool payload_known = false;  ///< the arm carries the description's payload
};

/// Adds to parameter i of a body, 0 to 9 in the order of ModelCheck::covariance.
void add_to_body(controller::Attachment& body, Eigen::Index i, double amount);

/// Compares the torques of records with the model, and fits offset, Coulomb and viscous friction
/// and reflected inertia of each joint, a payload, and a delay of the torques. Accelerations are
/// not needed, because the equations of motion are taken in their weak form: with p = M qd and a
/// test function f that vanishes at both ends,
///     integral f torque = - integral f' p - integral f dL/dq,   dL/dq = Mdot qd - C qd - g
/// Positions are differentiated once, by local cubic polynomials, and torques pass through the same
/// filter. docs/check-model.md says how residuals become deviations.
///
/// Throws std::invalid_argument, with a sentence, for records of other sizes, records that are too
/// short or not sampled often enough, and InvalidModel.
ModelCheck check_model(const controller::RobotDescription& robot,
                       const std::vector<TorqueRecord>& records,
                       const ModelCheckOptions& options = {});

}  // namespace dashpot::identification
