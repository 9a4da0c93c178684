#pragma once
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/robot_description.hpp>
#include <dashpot/identification/torque_record.hpp>

#include <string>
#include <vector>

namespace dashpot::identification {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// How records are smoothed: local cubic polynomials over `half_width` to either side.
struct RecordFilter {
  double half_width = 0;    ///< h, s
  double step = 0;          ///< between two values, s
  VectorXd rate_noise;      ///< n, standard deviation of the smoothed velocity, rad/s
  double torque_delay = 0;  ///< s by which torques act later than their times say
};

/// A stretch of a record without gaps, smoothed, at evenly spaced times.
struct SmoothRun {
  int record = 0;
  double begin = 0;                     ///< s, of the record's time
  MatrixXd position, velocity, torque;  ///< n x N
};

/// Chooses the narrowest smoothing that leaves velocities clear of the positions' noise and
/// quantisation. Throws std::invalid_argument if there are too few samples.
RecordFilter choose_smoothing(const std::vector<TorqueRecord>& records);

/// Smooths the records: positions and torques with the same weights, so that the filter changes
/// both sides of the equations of motion alike.
std::vector<SmoothRun> smooth(const std::vector<TorqueRecord>& records, const RecordFilter& how);

/// Torques of a model over windows, N m.
struct WindowTorques {
  MatrixXd inertial;  ///< n x K: of M and C
  MatrixXd gravity;   ///< n x K
};

/// The windows over which torques and model are compared: raised cosines f of mean 1 and half width
/// T, one every T, within each smoothed run.
class WeakForm {
 public:
  WeakForm(const std::vector<SmoothRun>& runs, const RecordFilter& how);

  struct Window {
    std::size_t run;
    Index first;  ///< of 2 m + 1 smoothed samples
    int record;
    double from, to;  ///< s, of the record's time
  };
  const std::vector<Window>& windows() const { return windows_; }
  Index count() const { return static_cast<Index>(windows_.size()); }
  double width() const { return width_; }

  /// Means of the runs' torques, weighted by f, n x K, and of their rates.
  MatrixXd torque() const;
  MatrixXd torque_rate() const;

  /// The model's torques: -integral f' p - integral f (Mdot qd - C qd), and integral f g. Joints
  /// beyond the kernel's chain have zeros.
  WindowTorques torques(const controller::DynamicsKernel& kernel, Index joints) const;

  /// -integral f' qd: the torque of a unit of reflected inertia.
  MatrixXd acceleration() const;

  /// Returns the effect of friction at a velocity above its noise: integral f s(qd) and integral f
  /// qd, with s = -1, 0 or 1, straight between -v0 and v0.
  MatrixXd sign(const VectorXd& v0) const;
  MatrixXd velocity() const;
  /// Returns integral f sign(qd) exp(-(qd / v0)^2): friction that is larger at low speed
  /// (Stribeck).
  MatrixXd slow_sign(double v0) const;

  /// The share of each window in which a joint is slower than v0, n x K.
  MatrixXd slow_share(const VectorXd& v0) const;

 private:
  template <typename Function>
  MatrixXd means(const VectorXd& weights, const Function& function) const;

  const std::vector<SmoothRun>* runs_;
  std::vector<Window> windows_;
  Index m_ = 0;
  double width_ = 0;
  VectorXd f_, slope_;  ///< at the 2 m + 1 samples, times the step
};

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
