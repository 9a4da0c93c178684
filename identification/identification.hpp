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
  /// Asked now and then in the search among models of decays and driven motion, with the share that
  /// is done: true ends it with the best one so far.
  std::function<bool(double)> stop = {};
};

/// A mode that records show. Standard deviations (std) are those of the estimate.
struct MeasuredMode {
  std::array<Complex, 2>
      eigenvalues{};             ///< a pair or two real ones, 1/s; one real one is there twice
  double natural_frequency = 0;  ///< rad/s, square root of the eigenvalues' product
  double natural_frequency_std = std::numeric_limits<double>::infinity();  ///< rad/s
  double damping_ratio = 0;
  double damping_ratio_std = std::numeric_limits<double>::infinity();
  /// The differences of the records' parts beyond their noise, (rad/s)^2 and 1, as variances: a
  /// share of the squares of the two deviations.
  double frequency_scatter = 0, ratio_scatter = 0;
  double covariance = 0;  ///< of natural frequency and damping ratio, rad/s
  Eigen::VectorXcd
      shape;             ///< of the first eigenvalue: channels, unit length, largest entry positive
  double stability = 0;  ///< share of the models of higher order that show it too, 0 to 1
  double energy = 0;     ///< its share of the motion: of the squares of all channels, each in units
                         ///< of its own root mean square
  std::string reason;    ///< why it is rejected; empty if it is not
  /// Rejected as one of many that make up for friction, contact, or what else is not linear.
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

/// What records say about an arm's modes.
struct Identification {
  std::vector<MeasuredMode> modes;     ///< by rising natural frequency
  std::vector<MeasuredMode> rejected;  ///< what was found and is not believed, with reasons
  std::vector<ModelPole> poles;
  int order = 0;          ///< of the model chosen, eigenvalues
  Eigen::VectorXd noise;  ///< of each channel: standard deviation of what the model leaves over
  double whiteness = 1;   ///< factor on variances, above 1 where what is left over is not white
  double explained = 0;   ///< share of the squares of the motion that the model explains, 0 to 1
};

/// Identifies the modes of free decays: all records begin after whatever moved the arm, near one
/// equilibrium, and end before it is moved again.
///
/// Models of rising order come from the eigensystem realization algorithm (Juang and Pappa 1985) on
/// means of stretches of samples, all records side by side. Each is refined to the maximum of the
/// likelihood, with one shape of each mode for all records and a noise of each channel in each
/// record, and an information criterion (Akaike 1974, with 4 for each parameter, and 2 for those of
/// as many modes as there are channels) chooses among them. The model chosen is refined on the
/// samples as they are, at the times at which they were taken; what it leaves over is searched for
/// more. So neither gaps nor uneven time steps matter, and heavily damped modes are as good as the
/// record allows. Where more decays are found than as many joints can have, a second search has the
/// products of the two strongest oscillations in the model, e^((lambda_i + lambda_j) t): what an
/// arm that is not quite linear makes of them, to second order.
///
/// The standard deviations are those of maximum likelihood (inverse of Fisher's information, with
/// the noise that the model leaves over), enlarged where the rest is not white, and by what the
/// next larger model thinks otherwise.
///
/// Throws std::invalid_argument for records without channels, of different channels, with fewer
/// than 20 samples, with times that do not rise or are not finite, channels that are missing
/// throughout, and where nothing moves. A channel that is constant has zeros in the shapes, and no
/// noise.
Identification identify_decays(const std::vector<MotionRecord>& records,
                               const IdentifyOptions& options = {});

/// Identifies the modes of motion under forces that were measured, the records' inputs: a chirp, a
/// pulse, anything that moves the arm about one equilibrium. What was before a record began may go
/// on in it, and what follows an input at once is no mode.
///
/// The model is the one of identify_decays, in which each input makes each mode move as well, with
/// the same shape, y = constant + direct + sum over modes of what each record's beginning and each
/// input make of it. Models of rising order come from least squares in the frequency domain with
/// one denominator (LSCF, Guillaume et al. 2003). The likelihood is that of means of samples, as
/// many as the band of the motion allows; samples that are missing are interpolated over three
/// steps at most, and uneven times to even ones. The model has no products of motions, each
/// parameter costs 4, and while there are fewer modes than channels, heavily damped ones are tried
/// as two. All else is as with identify_decays.
///
/// An input that is itself made of the motion, as the torques of a controller are, shows the arm
/// without the controller, and noise in it shifts the result: use what is put in from outside.
///
/// Throws std::invalid_argument as identify_decays, for records without inputs, and where no input
/// moves.
Identification identify_excited(const std::vector<MotionRecord>& records,
                                const IdentifyOptions& options = {});

/// Identifies the modes of motion under forces that nobody measured: ambient vibration, a hand, a
/// process. The forces have to be many, small and irregular; what they prefer, as the steps of a
/// walk, is found as modes too. A steady hum that stands out is taken away and is among the
/// rejected. A minute or more is needed: errors fall with the square root of the time.
///
/// Covariance-driven stochastic subspace identification (Peeters and De Roeck 1999): the
/// correlations of the channels are sums of decays with the arm's eigenvalues. They are taken of
/// means of samples, as many as the motion's band allows, without the lag zero, where the sensors'
/// noise is. The order is the one with which each half of the record says most about the other
/// half's correlations. The standard deviations are the jackknife's, over 20 parts of the record.
///
/// `energy` is a share of the squares of the correlations, `explained` what the model of one half
/// says about the other, `noise` the sensors' as the differences of samples show it. Gaps of up
/// to twenty samples are bridged by straight lines; longer ones part a record.
///
/// Throws std::invalid_argument as identify_decays, and for records that are too short.
Identification identify_ambient(const std::vector<MotionRecord>& records,
                                const IdentifyOptions& options = {});

/// A part of a record in which an arm moves freely.
struct FreeDecay {
  Eigen::Index from = 0, to = 0;  ///< samples from `from`, before `to`
  std::string reason;             ///< why it is of no use; empty if it is
};

/// Finds free decays: stretches that begin with a push, a release or the end of a step, in which
/// the motion then fades. Each begins as early as a sum of decays explains it as well as its later
/// part, and ends where the next begins, or a while after it is lost in noise.
///
/// `free` says for each sample whether nothing is known to move the arm; empty: nothing is known.
/// Throws std::invalid_argument as identify_decays.
std::vector<FreeDecay> find_decays(const MotionRecord& record, const std::vector<bool>& free = {});

}  // namespace dashpot::identification
