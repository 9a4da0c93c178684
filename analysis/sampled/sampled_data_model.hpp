#pragma once
// One tick of a sampled loop as a matrix.

#include <dashpot/analysis/elastic_form.hpp>
#include <dashpot/analysis/sampled/sampled_spectrum.hpp>
#include <dashpot/analysis/spectrum.hpp>

#include <utility>

namespace dashpot::analysis {

/// The loop in coordinates y = L' q (M = L L'), or in the coordinates of an elastic form, with
/// ticks as the unit of time: mass 1, period 1.
struct SampledDataModel {
  Eigen::Index n = 0;
  Eigen::MatrixXd C, K, D;  ///< n x n
  Eigen::MatrixXd G;        ///< of the robot without its controller, with P
  Eigen::MatrixXd P;
  Eigen::MatrixXd H;           ///< SampledLoop::compensation
  Eigen::MatrixXd zero_modes;  ///< n x r, orthonormal; none where a state w reads one
  ControllerMemory states;     ///< w, in these coordinates; m = 0: none
  int delay = 0;
  double filter_gain = 1;  ///< 1: no filter
  bool difference = false;
  Eigen::MatrixXd motion;  ///< (y, y') after a tick from (y, y', torque), 2n x 3n
  /// Orthonormal, n x r: all commands lie in its span to the rounding errors of A. They are delayed
  /// and filtered in these coordinates: springs and dampers in 6 directions need 6. The identity if
  /// nothing is delayed or filtered.
  Eigen::MatrixXd commands;

  /// Throws std::invalid_argument as sample_loop does.
  template <int N>
  SampledDataModel(const System<N>& system, const Spectrum<N>& spectrum, const SampledLoop& loop);
  /// Leaves the zero modes out if nothing moves them. Throws likewise.
  template <int N>
  SampledDataModel(const ElasticForm<N>& form, const SampledLoop& loop);

  bool filtered() const { return filter_gain < 1; }
  /// Returns the number of rows of the state in addition to y and y'.
  Eigen::Index memory() const {
    return commands.cols() * (delay + (filtered() ? 1 : 0)) + (difference ? n : 0) +
           states.state.rows();
  }
  /// Returns how many of discrete_eigenvalues(), the last ones, belong to the delay and filter of
  /// commands that are always zero.
  Eigen::Index idle() const { return (n - commands.cols()) * (delay + (filtered() ? 1 : 0)); }
  Eigen::Index rows() const { return 2 * n + memory(); }
  /// Returns A, for the state (y, y', [v], u_k-d .. u_k-1, [f], [w]), u and f by their coordinates
  /// in `commands`, with `factor` times K - P, C - D and the output of w; see sample_loop.
  Eigen::MatrixXd transition(double factor = 1) const;
  /// Leaves the zero modes with a' y = 0, orthonormal.
  void touch(const Eigen::VectorXd& a);
  /// Adds a spring of the world, `stiffness` a a' with the direction a (n, in these coordinates),
  /// to a model whose zero modes it does not touch.
  void press(const Eigen::VectorXd& a, double stiffness);
  /// Leaves the motions with a' y = 0 alone.
  void hold(const Eigen::VectorXd& a);
  /// Returns a basis of the states along the zero modes that A does not change or only lets drift:
  /// positions, with the compensated gravity in the memory, and velocities that nothing damps.
  Eigen::MatrixXd unit_motions() const;
  /// Returns A (rows() x rows()) on the orthogonal complement of unit_motions().
  Eigen::MatrixXd on_other_motions(Eigen::MatrixXd A) const {
    return on_other_motions(std::move(A), unit_motions());
  }
  /// X: what unit_motions() returned.
  static Eigen::MatrixXd on_other_motions(Eigen::MatrixXd A, const Eigen::MatrixXd& X);
  /// Returns all eigenvalues of A outside unit_motions(), then the eigenvalues of a delay and a
  /// filter of the n - r commands that are always zero. Throws std::runtime_error.
  Eigen::VectorXcd discrete_eigenvalues() const;

 private:
  /// Checks the loop, throws std::invalid_argument, and sets what depends on it alone.
  void set_loop(const SampledLoop& loop);
  /// Checks SampledLoop::memory, throws std::invalid_argument, and sets `states`, where
  /// q = coordinates y.
  void remember(const SampledLoop& loop, const Eigen::MatrixXd& coordinates);
  /// Sets `motion` and `commands`. Drops zero modes in which gravity is not compensated.
  void integrate();
  void span_commands();
};

/// A loop with gears in the coordinates of its gears.
struct GearedLoop {
  System<> system;
  Spectrum<> spectrum;
  SampledLoop loop;

  /// Takes a system in joint coordinates. Throws as analyze and sample_loop do.
  template <int N>
  GearedLoop(const System<N>& rigid, const SampledLoop& given)
      : system(rigid.dof()), loop(with_gears(given)) {
    system.mass = rigid.mass;
    system.damping = rigid.damping;
    system.stiffness = rigid.stiffness;
    system.stiffness_factor = rigid.stiffness_factor;
    const Eigen::Index n = rigid.dof();
    PassivePart passive{Square<kMaxDof>::Zero(n, n), Square<kMaxDof>::Zero(n, n)};
    if (given.passive_stiffness.size() > 0) passive.stiffness = given.passive_stiffness;
    if (given.friction.size() > 0) passive.damping = given.friction;
    if (given.gears.data().friction.size() > 0) passive.damping -= given.gears.data().friction;
    given.gears.extend(passive, system);
    spectrum = analyze(system);
  }
};

/// Returns the eigenvalues of A, which is destroyed. Throws std::runtime_error.
Eigen::VectorXcd eigenvalues_of(Eigen::MatrixXd& A);

extern template SampledDataModel::SampledDataModel(const System<kDynamic>&,
                                                   const Spectrum<kDynamic>&, const SampledLoop&);
extern template SampledDataModel::SampledDataModel(const System<kMaxDof>&, const Spectrum<kMaxDof>&,
                                                   const SampledLoop&);
extern template SampledDataModel::SampledDataModel(const ElasticForm<kDynamic>&,
                                                   const SampledLoop&);
extern template SampledDataModel::SampledDataModel(const ElasticForm<kMaxDof>&, const SampledLoop&);

}  // namespace dashpot::analysis
