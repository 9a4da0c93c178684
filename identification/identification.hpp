#pragma once
#include <dashpot/analysis/matrix_types.hpp>
#include <dashpot/identification/motion_record.hpp>

#include <array>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace dashpot::identification {

struct IdentifyOptions {
  /// Eigenvalues of the largest model tried. 0: of decays 2 for each channel, within 12 and 32,
  /// with inputs 16 more, at most 32; of ambient motion 4 for each channel and 4 more, at most 40.
  int max_order = 0;
  bool refine = true;  ///< of decays: on the samples as they are; false: a first estimate, fast
  /// Called now and then in the search among models of decays and driven motion, with the share
  /// that is done: true ends the search with the best model so far.
  std::function<bool(double)> stop = {};
};

/// A mode that records show. Standard deviations (std) belong to the estimate.
struct MeasuredMode {
  std::array<Complex, 2>
      eigenvalues{};             ///< a pair or two real ones, 1/s; one real one is there twice
  double natural_frequency = 0;  ///< rad/s, square root of the eigenvalues' product
  double natural_frequency_std = std::numeric_limits<double>::infinity();  ///< rad/s
  double damping_ratio = 0;
  double damping_ratio_std = std::numeric_limits<double>::infinity();
  /// Variances by which parts of the records differ beyond their noise, (rad/s)^2 and 1; included
  /// in the squares of the two deviations.
  double frequency_scatter = 0, ratio_scatter = 0;
  double covariance = 0;  ///< of natural frequency and damping ratio, rad/s
  Eigen::VectorXcd
      shape;             ///< of the first eigenvalue: channels, unit length, largest entry positive
  double stability = 0;  ///< share of the models of higher order that show it too, 0 to 1
  double energy = 0;     ///< its share of the motion: of the squares of all channels, each in units
                         ///< of its own root mean square
  std::string reason;    ///< why it is rejected; empty if it is not
  /// Rejected as one of many that imitate friction, contact, or another nonlinearity.
  bool not_linear = false;
};

/// An eigenvalue of a model of some order, for stabilisation tables and pictures.
struct ModelPole {
  int order = 0;
  double natural_frequency = 0;  ///< rad/s
  double damping_ratio = 0;
  bool stable = false;  ///< the model of one order less has it, too: frequency within 1 %, ratio
                        ///< within 0.02, shapes alike (modal assurance criterion above 0.95)
};

/// The modes of an arm, from records.
struct Identification {
  std::vector<MeasuredMode> modes;     ///< by rising natural frequency
  std::vector<MeasuredMode> rejected;  ///< found but not believed, with reasons
  std::vector<ModelPole> poles;
  int order = 0;          ///< of the model chosen, eigenvalues
  Eigen::VectorXd noise;  ///< of each channel: standard deviation of the residual
  double whiteness = 1;   ///< factor on variances, above 1 if the residual is not white
  double explained = 0;   ///< share of the squares of the motion that the model explains, 0 to 1
  /// Coulomb friction of one channel's decays, as the deflection whose spring it balances, in the
  /// channel's unit; 0: the model has none.
  double friction = 0, friction_std = 0;
};

/// Identifies the modes of free decays: all records begin near one equilibrium, after the
/// excitation has ended, and end before the next one.
///
/// Models of rising order come from the eigensystem realization algorithm (Juang and Pappa 1985) on
/// means of stretches of samples, all records side by side. Each is refined to the maximum of the
/// likelihood, with one shape of each mode for all records and a noise of each channel in each
/// record, and an information criterion (Akaike 1974, with 4 for each parameter, and 2 for the
/// parameters of as many modes as there are channels) chooses among them. The chosen model is
/// refined on the samples as they are, at the times at which they were taken; its residual is
/// searched for more modes. So neither gaps nor uneven time steps matter, and heavily damped modes
/// are as good as the record allows. If there are more decays than as many joints can have, a
/// second search includes the products of the two strongest oscillations in the model,
/// e^((lambda_i + lambda_j) t): the second-order response of a weakly nonlinear arm. Decays of one
/// moving channel are fitted with Coulomb friction as well (rubbing_decay.hpp), which is believed
/// where it is determined.
///
/// The standard deviations follow from maximum likelihood (inverse of Fisher's information, with
/// the noise of the residual). They are enlarged if the residual is not white, and by the
/// difference to the next larger model.
///
/// Throws std::invalid_argument for records without channels, of different channels, with fewer
/// than 20 samples, with times that do not rise or are not finite, channels that are missing
/// throughout, and records without motion. A constant channel has zeros in the shapes, and no
/// noise.
Identification identify_decays(const std::vector<MotionRecord>& records,
                               const IdentifyOptions& options = {});

/// Identifies the modes of motion under forces that were measured, the records' inputs: a chirp, a
/// pulse, anything that moves the arm about one equilibrium. Earlier motion may continue in a
/// record. The direct response to an input does not count as a mode.
///
/// The model is the one of identify_decays, in which each input moves each mode as well, with the
/// same shape: y = constant + direct + sum over modes of the responses to each record's beginning
/// and to each input. Models of rising order come from least squares in the frequency domain with
/// one denominator (LSCF, Guillaume et al. 2003). The likelihood uses means of samples, as many as
/// the band of the motion allows; missing samples are interpolated over three steps at most, and
/// uneven times to even ones. The model has no products of motions, each parameter costs 4, and
/// while there are fewer modes than channels, heavily damped ones are tried as two. All else is as
/// with identify_decays.
///
/// An input that depends on the motion, such as the torques of a controller, shows the arm without
/// the controller, and noise in it shifts the result: use an external excitation.
///
/// Throws std::invalid_argument as identify_decays, for records without inputs, and if no input
/// moves.
Identification identify_excited(const std::vector<MotionRecord>& records,
                                const IdentifyOptions& options = {});

/// Identifies the modes of motion under unmeasured forces: ambient vibration, a hand, a process.
/// The forces have to be many, small and irregular; a frequency that they prefer, such as the steps
/// of a walk, is found as a mode too. A steady hum that stands out is removed and is among the
/// rejected. A minute or more is needed: errors fall with the square root of the time.
///
/// Covariance-driven stochastic subspace identification (Peeters and De Roeck 1999): the
/// correlations of the channels are sums of decays with the arm's eigenvalues. They are computed
/// from means of samples, as many as the motion's band allows, without the lag zero, which has the
/// sensors' noise. The order is the one with which each half of the record best predicts the other
/// half's correlations. The standard deviations come from the jackknife over 20 parts.
///
/// `energy` is a share of the squares of the correlations, `explained` the share that the model of
/// one half explains of the other, `noise` the sensors' noise from differences of samples. Gaps of
/// up to twenty samples are bridged by straight lines; longer ones split a record.
///
/// Throws std::invalid_argument as identify_decays, and for records that are too short.
Identification identify_ambient(const std::vector<MotionRecord>& records,
                                const IdentifyOptions& options = {});

/// A part of a record in which an arm moves freely.
struct FreeDecay {
  Eigen::Index from = 0, to = 0;  ///< samples from `from`, before `to`
  std::string reason;             ///< why it cannot be used; empty if it can
};

/// Finds free decays: stretches that begin with a push, a release or the end of a step, in which
/// the motion then fades. Each begins as early as a sum of decays explains it as well as its later
/// part, and ends where the next begins, or a while after it is lost in noise.
///
/// `free` is true for each sample at which no excitation is known; empty: none is known anywhere.
/// Throws std::invalid_argument as identify_decays.
std::vector<FreeDecay> find_decays(const MotionRecord& record, const std::vector<bool>& free = {});

}  // namespace dashpot::identification
