#pragma once
#include <dashpot/analysis/matrix_types.hpp>

namespace dashpot::identification {

/// Squares of the spectrum of a sequence's differences, from line 1: differences leak less if a
/// sequence begins and ends at different values. There are half as many lines as the transform has
/// samples, less one.
Eigen::VectorXd difference_power(const Eigen::VectorXd& samples);

/// A window, the square of half a sine, of as many samples.
Eigen::ArrayXd taper_of(Eigen::Index samples);

/// The power of channels x samples through the taper, summed over the channels, by frequency bins
/// from 0; of at most smooth_count samples.
Eigen::ArrayXd tapered_power(const Eigen::MatrixXd& channels);

/// Fewest lines of a moving channel's spectrum.
inline constexpr Eigen::Index kFewestLines = 8;

/// rad/s up to which some channel's motion stands out from its noise, by means of `lines` lines.
double band_of_motion(const Eigen::MatrixXd& grid, double step, const Eigen::VectorXd& noise,
                      Eigen::Index lines);

/// The largest number up to `samples` with a fast Fourier transform.
Eigen::Index smooth_count(Eigen::Index samples);

}  // namespace dashpot::identification
