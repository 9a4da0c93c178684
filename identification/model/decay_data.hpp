#pragma once
#include <dashpot/identification/motion_record.hpp>

#include <array>
#include <memory>
#include <vector>

namespace dashpot::identification {

/// A factor of the characteristic polynomial of decays, s^2 + 2 zeta omega s + omega^2, underdamped
/// or not, or s - lambda, with its strength and phase in each record.
struct DecayFactor {
  bool pair = true;
  double first = 0;   ///< log(omega), omega in rad/s; or lambda, 1/s
  double second = 0;  ///< zeta; not used by a single lambda
  /// A factor moves in each record because of earlier motion, and because of each input, if any:
  /// these are its sources, the records first. If the reference source makes the motion x(t),
  /// source s makes scale[s][0] x + scale[s][1] x' / omega, or scale[s][0] x for a single lambda:
  /// one shape for all. Empty: not known yet.
  std::vector<std::array<double, 2>> scale = {};
  std::size_t reference = 0;
  /// True if the model has the products of this pair's motion with itself and with the motions of
  /// other such pairs: the second-order response of a weakly nonlinear arm.
  bool has_products = false;

  int parameters() const { return pair ? 2 : 1; }
  /// 1/s; a single one twice.
  std::array<Complex, 2> eigenvalues() const;

  static DecayFactor of_pair(Complex eigenvalue);  ///< and its conjugate
  static DecayFactor of_single(double eigenvalue) { return {false, eigenvalue, 0}; }
  /// One of a pair's eigenvalues, if real, in the phases that the pair has.
  DecayFactor one_of_pair(double eigenvalue) const;
};

/// The excitation of a record, on an even grid whose points are fitted in cells.
struct DrivenGrid {
  Eigen::MatrixXd input;  ///< inputs x points; each value holds until the next
  double step = 0;        ///< s
  Eigen::Index per_cell = 1;
};

/// The data of channels that have samples at the same times.
struct DecayPart {
  std::vector<Eigen::VectorXd> time;   ///< of each record, s, from its beginning
  Eigen::MatrixXd output;              ///< samples of all records, one after the other, x channels
  std::vector<Eigen::Index> channels;  ///< which of the records' channels
  bool drifts = false;                 ///< each record has a slope as well as a constant
  /// With inputs: of each record the numbers of the cells that the samples are means of, and the
  /// excitation.
  std::vector<std::vector<Eigen::Index>> cells = {};
  std::shared_ptr<const std::vector<DrivenGrid>> driven = {};

  Eigen::Index inputs() const { return driven ? driven->front().input.rows() : 0; }
};

/// Decays in the form in which they are fitted, the missing samples left out.
struct DecayData {
  std::vector<DecayPart> parts;
  Eigen::Index channels = 0;
  std::size_t records = 0;
  std::size_t inputs = 0;
  /// Standard deviation of each channel; no noise is taken to be less than kLinear of it.
  Eigen::VectorXd motion;

  /// Smallest nonlinearity of an arm's motion, relative to the motion. Smaller modes are not
  /// sought.
  static constexpr double kLinear = 1e-4;

  /// Standard deviation of each channel's rounding, if rounding is its noise; else 0. Rounding is
  /// alike from sample to sample, so that means of samples have as much.
  Eigen::VectorXd rounding;

  double least_noise(Eigen::Index channel) const;

  bool drifts() const { return parts.front().drifts; }
  void set_drifts(bool drifts) {
    for (DecayPart& part : parts) part.drifts = drifts;
  }

  std::size_t sources() const { return records + inputs; }

  /// With `driven`, the samples are means of cells of its grids, and begin with them.
  explicit DecayData(const std::vector<MotionRecord>& all,
                     const std::shared_ptr<const std::vector<DrivenGrid>>& driven = {});
};

/// Samples of a part.
inline Eigen::Index samples_of(const DecayPart& part) {
  return part.output.rows();
}

}  // namespace dashpot::identification
