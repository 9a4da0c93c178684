#pragma once
// A mode that nothing speaks against, and its parts.
#include <dashpot/identification/identification.hpp>

#include <cmath>
#include <complex>

namespace dashpot::identification {

inline Eigen::VectorXcd shape_of(double x, double y) {
  return Eigen::VectorXcd{{x, y}} / std::hypot(x, y);
}

/// The eigenvalue above the real axis of an oscillation.
inline Complex oscillation(double w, double ratio) {
  return w * Complex(-ratio, std::sqrt(1 - ratio * ratio));
}

/// A mode that nothing speaks against in a record of 10 s with 1000 samples a second.
inline MeasuredMode good_mode(double w = 10, double ratio = 0.1) {
  MeasuredMode mode;
  mode.eigenvalues = {oscillation(w, ratio), std::conj(oscillation(w, ratio))};
  mode.natural_frequency = w;
  mode.natural_frequency_std = 0.01 * w;
  mode.damping_ratio = ratio;
  mode.damping_ratio_std = 0.01;
  mode.shape = shape_of(1, 0);
  mode.stability = 1;
  mode.energy = 0.5;
  return mode;
}

}  // namespace dashpot::identification
