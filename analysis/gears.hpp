#pragma once
#include <dashpot/analysis/system.hpp>

#include <vector>

namespace dashpot::analysis {

/// Stiffness and damping that the world adds to an arm, n x n each.
struct PassivePart {
  Square<kMaxDof> stiffness, damping;
};

/// Elastic joints in the closed loop of an arm. A spring K_J with a damper D_J connects the motor
/// and the link of an elastic joint, and the motor's reflected inertia B is a body of its own
/// (Spong 1987):
///     (M - B) q'' + ... = tau_J,   B theta'' + F theta' = u - tau_J,
///     tau_J = K_J (theta - q) + D_J (theta' - q').
/// The coordinates are x = (q, theta): n links, then the motors of the m elastic joints. The torque
/// u of the controller acts on the motors, the world on the links, and the springs and dampers of
/// the controller act on the coordinate that the position sensor measures. If all joints are
/// elastic, K_c of the loop without elastic joints becomes
///     motor: [K_J, -K_J; -K_J, K_J + K_c],   link: [K_J, -K_J; K_c - K_J, K_J],
/// which is not symmetric, and can be unstable; the dampers likewise.
class Gears {
 public:
  /// The gears of n joints. A joint with an infinite stiffness is rigid.
  struct Data {
    Eigen::VectorXd stiffness;  ///< K_J, n, N m/rad, positive
    Eigen::VectorXd damping;    ///< D_J, n, N m s/rad
    Eigen::VectorXd inertia;    ///< B, n, kg m^2: a part of M; positive where a joint is elastic
    Eigen::MatrixXd friction;   ///< F, n x n, N m s/rad, on the motors' side; empty: none
    bool link_sensor = false;   ///< the links are measured, not the motors
  };

  /// No joint is elastic.
  Gears() = default;
  /// Throws std::invalid_argument for other sizes, and for n + m above kMaxDof.
  explicit Gears(Data data);

  bool any() const noexcept { return !joints_.empty(); }
  int count() const noexcept { return static_cast<int>(joints_.size()); }  ///< m
  Eigen::Index coordinates() const noexcept { return n_ + count(); }       ///< n + m
  /// Returns the joints, from 0, whose motors have the coordinates n, n + 1, ...
  const std::vector<int>& joints() const noexcept { return joints_; }

  /// Makes the loop with elastic joints from a loop in joint coordinates: mass, damping, stiffness,
  /// and the factor, which only springs on the motors' side have. `passive` is the world's part.
  /// Bounds of a spectrum hold for the coefficients as they are rounded here.
  template <int N>
  void extend(const PassivePart& passive, System<N>& system) const noexcept;
  /// Does the same without a world.
  template <int N>
  void extend(System<N>& system) const noexcept {
    const Square<kMaxDof> none = Square<kMaxDof>::Zero(n_, n_);
    extend({none, none}, system);
  }
  /// Does the same to a system of which only mass, damping and factor are given. The result has
  /// only these as well if the motors are measured; if the links are, a stiffness and no factor.
  void extend_factored(System<kMaxDof>& system) const noexcept;
  /// Makes the mass with motors as bodies of their own, diag(M - B, B).
  template <typename Matrix>
  void extend_mass(Matrix& M) const noexcept {
    const Square<kMaxDof> rigid = M;
    M.setZero(coordinates(), coordinates());
    add_on_links(rigid, M);
    for (Eigen::Index k = 0; k < count(); ++k) {
      const Eigen::Index i = joint(k);
      M(i, i) -= data_.inertia[i];
      M(n_ + k, n_ + k) = data_.inertia[i];
    }
  }

  /// Adds a matrix A of forces by what the controller measures: out += S_m' A S_s, with the
  /// motors' coordinates S_m x and the measured ones S_s x.
  template <typename Matrix>
  void add_of_controller(const Square<kMaxDof>& A, Matrix& out) const noexcept {
    for (Eigen::Index j = 0; j < n_; ++j) {
      for (Eigen::Index i = 0; i < n_; ++i) out(motor(i), measured(j)) += A(i, j);
    }
  }
  /// Adds a matrix A, n x n, of forces that act on the links by the links' coordinates.
  template <typename Matrix>
  void add_on_links(const Square<kMaxDof>& A, Matrix& out) const noexcept {
    for (Eigen::Index j = 0; j < n_; ++j) {
      for (Eigen::Index i = 0; i < n_; ++i) out(i, j) += A(i, j);
    }
  }
  /// Adds the friction F of the motors and of rigid joints.
  template <typename Matrix>
  void add_friction(Matrix& out) const noexcept {
    if (data_.friction.size() == 0) return;
    for (Eigen::Index j = 0; j < n_; ++j) {
      for (Eigen::Index i = 0; i < n_; ++i) out(motor(i), motor(j)) += data_.friction(i, j);
    }
  }
  /// Adds springs or dampers `gear`, n, between motors and links.
  template <typename Matrix>
  void add_gears(const Eigen::VectorXd& gear, Matrix& out) const noexcept {
    for (Eigen::Index k = 0; k < count(); ++k) {
      const Eigen::Index i = joint(k), at = n_ + k;
      out(i, i) += gear[i];
      out(at, at) += gear[i];
      out(i, at) -= gear[i];
      out(at, i) -= gear[i];
    }
  }

  const Data& data() const noexcept { return data_; }
  /// Returns the coordinate on which a joint's torque acts, and the one that its sensor sees.
  Eigen::Index motor(Eigen::Index i) const noexcept { return motor_[static_cast<std::size_t>(i)]; }
  Eigen::Index measured(Eigen::Index i) const noexcept { return data_.link_sensor ? i : motor(i); }

 private:
  Eigen::Index joint(Eigen::Index k) const noexcept { return joints_[static_cast<std::size_t>(k)]; }
  template <int N>
  void extend_factor(System<N>& system) const noexcept;
  template <int N>
  void extend_damping(const Square<kMaxDof>& passive, System<N>& system) const noexcept;

  Data data_;
  Eigen::Index n_ = 0;
  std::vector<int> joints_;
  std::vector<Eigen::Index> motor_;
};

}  // namespace dashpot::analysis
