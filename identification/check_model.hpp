#pragma once
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

/// What torques say of one joint. For a prismatic joint read N for N m.
struct JointCheck {
  /// Root mean square of torque less model, N m, over means of about 2 T: of the model's M, C and g
  /// alone, and with all that was fitted.
  double residual_before = 0, residual_after = 0;
  Estimate offset;             ///< N m
  Estimate coulomb_friction;   ///< N m; all of it, whatever the model says
  Estimate viscous_friction;   ///< N m s/rad; likewise
  Estimate reflected_inertia;  ///< kg m^2; likewise, as it appears to who commands torques
  bool moves = false;          ///< enough for its friction
  /// Shares of the torque's variation in the part kept for validation that the model explains as it
  /// was, and as it was fitted; and how alike what is left is from window to window, 0 for noise.
  double explained_before = 0, explained_after = 0, correlation = 0;
  /// Motion that would determine what the records do not; empty: nothing lacks.
  std::string wanted;
  std::string suspicious;  ///< why the model or the data of this joint is doubted; empty: it is not
};

/// The payload with which the torques agree best, in place of that of the description.
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
  /// Which columns look exchanged or turned around, and which joints' torques fit far better then;
  /// empty: none. The other results mean little until that is mended.
  std::vector<std::string> order;
  /// The gravity with which whole torques fit, in the axes of the root link, m/s^2, where it is
  /// another than the description's; the other results are those with it.
  std::optional<Eigen::Vector3d> gravity;
  double gravity_deviation = 0;  ///< of its direction, rad
  bool gravity_fits = false;     ///< whether little is left over with it
  /// How much later the torques act than their times say, s: commanded ones do. Negative: they were
  /// measured late.
  Estimate delay;
  std::vector<std::string> ambiguities;  ///< what the records cannot tell apart
  std::vector<LeftOut> contacts;         ///< where other forces acted
  double used = 0;                       ///< s of motion, of which
  double validation = 0;                 ///< s were kept for validation
  double window = 0;                     ///< 2 T, s
  /// Parameters of the fit, how many combinations of them the records determine at all, and by how
  /// many times the best of these better than the worst, in units of each parameter's own effect.
  int parameters = 0, rank = 0;
  double condition = 0;
  /// Of offset, Coulomb and viscous friction of each joint (3 n), the payload's mass, first moment
  /// (3) and inertia (6) about the tip link's origin, reflected inertias (n) and the delay.
  Eigen::MatrixXd covariance;
};

struct ModelCheckOptions {
  double validation = 0;       ///< share of each record, its end, that is kept for validation
  bool payload_known = false;  ///< that of the description is the arm's
};

/// Compares the torques of records with the model, and fits offset, Coulomb and viscous friction
/// and reflected inertia of each joint, a payload, and a delay of the torques. Accelerations are
/// not needed, because the equations of motion are taken in their weak form: with p = M qd and a
/// test function f that vanishes at both ends,
///     integral f torque = - integral f' p - integral f dL/dq,   dL/dq = Mdot qd - C qd - g
/// Positions are differentiated once, by local cubic polynomials, and torques pass through the same
/// filter. docs/check-model.md says how residuals become deviations.
///
/// Throws std::invalid_argument, with a sentence, for records of other sizes, or which are too
/// short or not sampled often enough, and InvalidModel.
ModelCheck check_model(const controller::RobotDescription& robot,
                       const std::vector<TorqueRecord>& records,
                       const ModelCheckOptions& options = {});

}  // namespace dashpot::identification
