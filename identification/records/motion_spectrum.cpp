#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/records/motion_spectrum.hpp>

#include <unsupported/Eigen/FFT>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::identification {

namespace {

constexpr Index kOnset = 20;       ///< part of a record over which its begin is made smooth
constexpr double kStandsOut = 10;  ///< times the noise's power

}  // namespace

Index smooth_count(Index samples) {
  for (Index n = samples;; --n) {
    Index rest = n;
    for (const Index factor : {2, 3, 5}) {
      while (rest % factor == 0) rest /= factor;
    }
    if (rest == 1 && n % 2 == 0) return n;
  }
}

VectorXd difference_power(const VectorXd& samples) {
  Index N = samples.size() - 1;
  while (smooth_count(N) != N) ++N;  // a length with a fast Fourier transform
  Eigen::FFT<double> fft;
  VectorXcd lines;
  VectorXd differences = VectorXd::Zero(N);
  differences.head(samples.size() - 1) =
      samples.tail(samples.size() - 1) - samples.head(samples.size() - 1);
  fft.fwd(lines, differences);
  return lines.segment(1, std::max<Index>(1, N / 2 - 1)).cwiseAbs2();
}

ArrayXd taper_of(Index samples) {
  return 0.5 - 0.5 * ArrayXd::LinSpaced(samples, 0, 2 * std::numbers::pi).cos();
}

ArrayXd tapered_power(const MatrixXd& channels) {
  const Index N = smooth_count(channels.cols());
  const ArrayXd taper = taper_of(N);
  ArrayXd power = ArrayXd::Zero(N / 2);
  Eigen::FFT<double> fft;
  VectorXcd spectrum;
  for (Index c = 0; c < channels.rows(); ++c) {
    const VectorXd shown = channels.row(c).head(N).transpose().array() * taper;
    fft.fwd(spectrum, shown);
    power += spectrum.head(N / 2).array().abs2();
  }
  return power;
}

double band_of_motion(const MatrixXd& grid, double step, const VectorXd& noise, Index lines) {
  const Index begin = std::max<Index>(1, grid.cols() / kOnset);
  const ArrayXd onset = ArrayXd::LinSpaced(begin, 0, std::numbers::pi / 2).sin().square();
  double band = 0;
  for (Index c = 0; c < grid.rows(); ++c) {
    VectorXd rising = grid.row(c).transpose().array() - grid(c, grid.cols() - 1);
    rising.head(onset.size()).array() *= onset;  // a sudden begin has all frequencies
    const VectorXd power = difference_power(rising);
    const double width = std::numbers::pi / (static_cast<double>(power.size() + 1) * step);
    for (Index from = 0; from + lines <= power.size(); from += lines) {
      const double w = width * (static_cast<double>(from) + 0.5 * static_cast<double>(lines));
      const double floor =
          static_cast<double>(grid.cols()) * std::pow(2 * std::sin(w * step / 2) * noise[c], 2);
      if (power.segment(from, lines).mean() > kStandsOut * floor) {
        band = std::max(band, width * static_cast<double>(from + lines));
      }
    }
  }
  return band;
}

}  // namespace dashpot::identification
