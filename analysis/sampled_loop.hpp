#pragma once
#include <dashpot/analysis/elastic_form.hpp>
#include <dashpot/analysis/sampled/sampled_spectrum.hpp>
#include <dashpot/analysis/spectrum/spectrum_result.hpp>

namespace dashpot::analysis {

/// Computes the modes of  M q'' + C q' + K q = 0  where C and K act through a computer. The robot
///     M q'' + D q' + (G + P) q = f
/// moves under a torque f that is held from tick k to tick k + 1. The controller commands
///     u_k = (H + P - K) q_k - (C - D) v_k,   v_k = q'_k, or (q_k - q_k-1) / T if differenced,
///     f_k = f_k-1 + (1 - exp(-2 pi f_c T)) (u_k-d - f_k-1),   or u_k-d without a filter,
/// H = G unless SampledLoop::compensation differs.
/// With states w of SampledLoop::memory, u_k has another term -output w_k.
/// The state x = (q, q', [v], u_k-d .. u_k-1, [f], [w]) goes from tick to tick as x_k+1 = A x_k.
/// This is exact, because the robot's part of A is a matrix exponential. The eigenvalues z of A are
/// given as lambda = log(z) / T, which compare with the continuous eigenvalues. To first order in
/// omega T the hold acts like a delay of T/2: natural_frequency grows by the factor 1 + zeta omega
/// t and the damping ratio falls by (1 - 2 zeta^2) omega t / 2, with t = (d + 1/2) T plus the lag
/// of the filter.
///
/// `spectrum` has to be the spectrum of `system`; with gears it is not read, and the modes belong
/// to the system that SampledLoop::gears make of it. Each of its modes gets the z nearest to its
/// eigenvalues, moved by the loop's delays to first order, nearest pairs first. That is meaningful
/// while omega T stays well below 1.
///
/// Call it less often than every tick, because it allocates, and solves one dense eigenproblem of
/// up to (4 + d) n + m rows; if all springs and dampers of the controller act in fewer than n
/// directions, a delay and the filter have only so many rows each. Throws std::invalid_argument for
/// matrices of other sizes or entries that are not finite, a period that is not positive, a
/// negative delay or cutoff, and a spectrum without modes because of its status. Throws
/// std::runtime_error if the eigenvalue iteration does not converge.
template <int N>
SampledSpectrum sample_loop(const System<N>& system, const Spectrum<N>& spectrum,
                            const SampledLoop& loop);

/// Returns the factor by which the controller's K - P and C - D and what SampledLoop::memory puts
/// out may grow together before the loop becomes unstable, to six digits. It is the first boundary
/// above 1, searched in steps of a quarter, or infinity if there is none up to `most`. If the loop
/// is unstable as it is, the result is the first boundary below 1, or zero if there is none down to
/// 1e-3. Motions with |log z| / T below SampledLoop::slowest do not count; where the state has more
/// than 100 rows, in sample_loop's fewer ones for a delay and a filter, that is at least 1e-6 / T.
/// The search takes ten to some tens of eigenproblems, or, with more than 100 rows, of counts whose
/// work does not grow with the delay. Throws like sample_loop.
template <int N>
double gain_margin(const System<N>& system, const Spectrum<N>& spectrum, const SampledLoop& loop,
                   double most = 1e6);

/// Returns whether gain_margin is at least `margin`, from the few factors that its search would try
/// up to there; for a margin below 1, whether the loop is stable with it or as it is. Throws
/// likewise, and for a negative margin.
bool keeps_margin(const System<>& system, const Spectrum<>& spectrum, const SampledLoop& loop,
                  double margin);

/// Returns the gain margin of an elastic form, without a spectrum.
template <int N>
double gain_margin(const ElasticForm<N>& form, const SampledLoop& loop, double most = 1e6);

}  // namespace dashpot::analysis
