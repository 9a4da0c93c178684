#pragma once
// Arms in MuJoCo under the springs and dampers of a sampled loop: what moves them, what sensors
// make of the motion, and the eigenvalues of the loop.

#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/dice.hpp>
#include <dashpot/tests/support/mujoco_arm.hpp>

#include <complex>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace dashpot::stress {

/// Excitation of an arm: it is let go; three pushes of 0.1 s; random torques for 60 s; a chirp of
/// torques, 0.3 to 12 Hz in 10 s.
enum class Motion { kRelease, kPushes, kAmbient, kChirp };

/// A kind of recordings.
struct Recipe {
  Motion motion = Motion::kRelease;
  double least_ratio = 0.05, most_ratio = 0.9;   ///< of the undamped modes
  double size = 0.02;                            ///< rad, see RecordedArm::record
  double least_friction = 0, most_friction = 0;  ///< Coulomb's in each joint, N m
  int delay = 0;                                 ///< of torques, ticks of 1 ms
  double clip = 0;      ///< limit of each torque, over the spring's torque at `size`; 0: none
  bool gears = false;   ///< that bend
  bool wall = false;    ///< which the tip meets after a third of its way
  double rate = 1000;   ///< Hz, of the record
  double noise = 1e-5;  ///< rad
  double jitter = 0;    ///< s, standard deviation of the time stamps
  double drift = 0;     ///< rad over the record
  double hum = 0;       ///< rad, 50 Hz in each channel
  int bits = 0;         ///< of an encoder's turn; 0: it does not round
};

struct Recording {
  Eigen::VectorXd time;    ///< s, the stamps
  Eigen::MatrixXd output;  ///< positions of the motors, rad: joints x samples
  Eigen::VectorXd input;   ///< of a chirp, N m over the largest
  std::vector<std::pair<Eigen::Index, Eigen::Index>> decays;  ///< free ones: samples from, before
};

/// A pair of eigenvalues of the loop without friction, limits of torque and contacts.
struct TrueMode {
  std::complex<double> value;  ///< 1/s: of the pair the one above the axis, or a real one
  /// Whether a record should show it: it oscillates and has 5 % or more of the energy at the
  /// beginning of the free decays; in ambient motion all count, in chirps those below 9 Hz with a
  /// ratio below 0.9.
  bool strong = false;
  /// Whether noise of the sensors alone leaves a frequency and a ratio of a release known to 5 %,
  /// to any method without bias (Cramer and Rao). Of other motion all are.
  bool determined = true;
};

/// One arm of the four at a random posture without gravity: springs of 8 to 40 rad/s in its joints,
/// dampers that couple them, drives of 0.1 kg m^2. The loop is sampled at 1 kHz.
class RecordedArm {
 public:
  RecordedArm(const Recipe& recipe, std::size_t which, testing::Dice& draw);

  /// Moves the arm as the recipe says. A release is from `size` in each joint (one standard
  /// deviation); pushes, chirps and random torques are such that the largest excursion of the arm
  /// without friction, limits and contacts is `size`.
  Recording record(testing::Dice& draw);

  /// Those with eigenvalues of the map from one tick to the next, by finite differences; `strong`
  /// is known after record().
  const std::vector<TrueMode>& modes() const { return modes_; }

 private:
  using Plant = testing::MujocoArm;
  using Matrix = Eigen::MatrixXd;
  using Vector = Eigen::VectorXd;

  std::unique_ptr<Plant> make_plant(double friction, const std::optional<sim::Wall>& wall) const;
  void choose_springs(testing::Dice& draw);
  /// The state one tick later: positions and velocities of all coordinates, torques on their way.
  Vector tick(Plant& arm, const Vector& state, const Vector& push, const Vector& limit) const;
  double linearize();  ///< returns the growth from tick to tick
  /// Torques from outside, joints x ticks, of size one; and where they end.
  Matrix pushes(testing::Dice& draw, Recording& recording) const;
  /// States of the linear arm, a column for each one of `push`.
  Matrix predicted(const Vector& start, const Matrix& push) const;
  void mark_strong(const Matrix& states, const Recording& recording);
  void mark_determined(const Matrix& motion);
  sim::Wall wall_in_the_way(const Matrix& states, testing::Dice& draw);
  void sense(const Matrix& motion, testing::Dice& draw, Recording& recording) const;
  Matrix motors(const Matrix& states) const;

  Recipe recipe_;
  testing::Arm file_;
  sim::RobotParameters parameters_;
  Eigen::Index joints_ = 0, coordinates_ = 0;
  sim::JointVector home_;  ///< of all coordinates
  std::unique_ptr<Plant> ideal_;
  Vector springs_;                     ///< of the joints, N m/rad
  Matrix mass_, damping_, stiffness_;  ///< of all coordinates, joints, all coordinates
  Matrix A_, B_;                       ///< of a tick
  Eigen::VectorXcd values_;            ///< 1/s
  Eigen::MatrixXcd vectors_;
  std::vector<TrueMode> modes_;
};

}  // namespace dashpot::stress
