#pragma once
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/identification/check_model/smoothed_record.hpp>

namespace dashpot::identification {

/// Torques of a model over windows, N m.
struct WindowTorques {
  Eigen::MatrixXd inertial;  ///< n x K: of M and C
  Eigen::MatrixXd gravity;   ///< n x K
};

/// The windows over which torques and model are compared: raised cosines f of mean 1 and half width
/// T, one every T, within each smoothed run.
class WeakForm {
 public:
  WeakForm(const std::vector<SmoothRun>& runs, const RecordFilter& how);

  struct Window {
    std::size_t run;
    Eigen::Index first;  ///< of 2 m + 1 smoothed samples
    int record;
    double from, to;  ///< s, of the record's time
  };
  const std::vector<Window>& windows() const { return windows_; }
  Eigen::Index count() const { return static_cast<Eigen::Index>(windows_.size()); }
  double width() const { return width_; }

  /// Means of the runs' torques, weighted by f, n x K, and of their rates.
  Eigen::MatrixXd torque() const;
  Eigen::MatrixXd torque_rate() const;

  /// The model's torques: -integral f' p - integral f (Mdot qd - C qd), and integral f g. Joints
  /// beyond the kernel's chain have zeros.
  WindowTorques torques(const controller::DynamicsKernel& kernel, Eigen::Index joints) const;

  /// -integral f' qd: the torque of a unit of reflected inertia.
  Eigen::MatrixXd acceleration() const;

  /// Returns the effect of friction at a velocity above its noise: integral f s(qd) and integral f
  /// qd, with s = -1, 0 or 1, straight between -v0 and v0.
  Eigen::MatrixXd sign(const Eigen::VectorXd& v0) const;
  Eigen::MatrixXd velocity() const;
  /// Returns integral f sign(qd) exp(-(qd / v0)^2): friction that is larger at low speed
  /// (Stribeck).
  Eigen::MatrixXd slow_sign(double v0) const;

  /// The share of each window in which a joint is slower than v0, n x K.
  Eigen::MatrixXd slow_share(const Eigen::VectorXd& v0) const;

 private:
  template <typename Function>
  Eigen::MatrixXd means(const Eigen::VectorXd& weights, const Function& function) const;

  const std::vector<SmoothRun>* runs_;
  std::vector<Window> windows_;
  Eigen::Index m_ = 0;
  double width_ = 0;
  Eigen::VectorXd f_, slope_;  ///< at the 2 m + 1 samples, times the step
};

}  // namespace dashpot::identification
