#pragma once
#include <dashpot/controller/robot_description.hpp>
#include <dashpot/identification/check_model.hpp>
#include <dashpot/identification/check_model/robust_fit.hpp>
#include <dashpot/identification/check_model/weak_form.hpp>

namespace dashpot::identification {

/// Priors of a parameter of which nothing is known, and of one that is known.
inline constexpr double kUndetermined = std::numeric_limits<double>::infinity();
inline constexpr double kHeld = 1e-9;

enum class Purpose : std::uint8_t { kFit, kValidation, kNothing };

/// The fit of a model to the torques of windows. Its parameters are offset, Coulomb and viscous
/// friction of each joint (3 n), the payload's mass, first moment (3) and inertia (6) about the tip
/// link's origin, beyond the model's, reflected inertias (n) beyond the model's, the rest of the
/// delay, and the hypotheses' parameters.
struct TorqueFit {
  /// Keeps `robot` and `windows`, which have to outlive it.
  TorqueFit(const controller::RobotModel& robot, const std::vector<SmoothRun>& runs,
            const RecordFilter& how, const WeakForm& windows, const ModelCheckOptions& options);

  /// Fits torques of a kind. Returns the sum of the logarithms of the joints' residuals.
  double fit(TorqueKind kind);
  /// The same for whole torques, with gravity in a direction near the robot's.
  double fit_inclined(const controller::RobotDescription& robot);
  /// Adds a parameter, whose column is n x K.
  void add(const Eigen::MatrixXd& column, double prior);
  /// After a fit, gives the payload's inertia the prior of a body of its mass, holds rotors that
  /// cannot be separated from the payload, and fits again.
  void narrow_payload(ModelCheck& check);

  Eigen::Index payload() const { return 3 * n; }
  Eigen::Index rotor(Eigen::Index j) const;
  Eigen::Index rest_of_delay() const { return rotor(n); }
  std::string parameter_name(Eigen::Index i) const;
  const controller::Joint& joint(Eigen::Index j) const;
  /// " N" or " N m", and " kg" or " kg m^2".
  std::string torque_unit(Eigen::Index j) const;
  std::string inertia_unit(Eigen::Index j) const;
  double moved_mass() const;  ///< kg

  // After a fit:
  /// The largest residual of a joint, as a share of its largest torque.
  double most_left() const;
  /// Delay of the torques after their times, in all, s.
  double delay() const { return taken_delay + result.value[rest_of_delay()]; }
  /// Whether the rest of the delay is too small for another fit.
  bool delay_is_taken() const;
  /// Whether something unseen has a share in parameter i.
  bool unseen(Eigen::Index i) const;
  double variance(Eigen::Index i) const;
  /// Root mean square of a joint's rows of `values`, with the weights of a fit.
  double rms(const Eigen::VectorXd& values, const RobustFit& weighted, Eigen::Index j) const;

  const controller::RobotModel& model;
  const WeakForm& form;
  Eigen::Index n, K;
  bool payload_known;
  double taken_delay;                             ///< s, of the torques as they were smoothed
  Eigen::MatrixXd torque, model_torque, turning;  ///< n x K; turning: 1, or 0 near rest
  WindowTorques own;                              ///< the model's
  Eigen::VectorXd largest;                        ///< n, torques
  Eigen::VectorXd rotor_prior;
  Eigen::Array<bool, Eigen::Dynamic, 1> moves;  ///< n
  std::vector<Purpose> purpose;                 ///< K
  LinearModel linear;
  RobustFit result;
  Eigen::VectorXd spread;  ///< how far parameters differ if a link is wrong in place of the payload
};

/// After a fit, adds the hypothesis that explains most, as long as one explains much. Returns the
/// gravity that explains the torques better, if gravity explains most or if `tilted`.
std::optional<Eigen::Vector3d> explain(TorqueFit& fit, const controller::RobotDescription& robot,
                                       bool tilted, ModelCheck& check);

/// Reports the fitted values with deviations, doubts, and where other forces acted.
void report(const TorqueFit& fit, ModelCheck& check);
/// Reports which joints are doubted for reasons that need no hypothesis; after the estimates.
void report_suspicions(const TorqueFit& fit, ModelCheck& check);
/// Reports the parameters that the records cannot separate.
void report_ambiguities(const TorqueFit& fit, ModelCheck& check);

void add_reason(std::string& text, const std::string& reason);
/// "0.9 +- 0.1 kg less than the model says"
std::string beside_model(double value, double deviation, const std::string& unit);
/// ": joint 2 then leaves 0.1 instead of 0.2 N m over"
std::string then_leaves(const TorqueFit& fit, Eigen::Index j, double now, double before);

}  // namespace dashpot::identification
