"""Systems given by matrices: modes, responses, the sampled loop, damping design."""

from __future__ import annotations

import dataclasses
import warnings
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._results import Array, ComplexArray, Modes, Result, TextArray, make_modes, to_matrix, to_numbers, to_vector


def _impedance(M: npt.ArrayLike, C: npt.ArrayLike | None, K: npt.ArrayLike | None,
               jacobian: npt.ArrayLike | None, task_damping: npt.ArrayLike | None,
               task_stiffness: npt.ArrayLike | None) -> _core.Impedance:
    return _core.Impedance(to_numbers("mass", M, 2), to_matrix("damping", C),
                           to_matrix("stiffness", K), to_matrix("jacobian", jacobian),
                           to_matrix("task_damping", task_damping),
                           to_matrix("task_stiffness", task_stiffness))


def modes(M: npt.ArrayLike, C: npt.ArrayLike | None = None, K: npt.ArrayLike | None = None, *,
          jacobian: npt.ArrayLike | None = None, task_damping: npt.ArrayLike | None = None,
          task_stiffness: npt.ArrayLike | None = None, soft_frequency: float = 1e-6) -> Modes:
    """Returns the vibration modes of M q'' + C q' + K q = 0, with proved bounds.

    M, C and K are symmetric n x n matrices in SI units, and M is positive definite. With a jacobian
    J (m x n), J' C_C J and J' K_C J are added to C and K, where C_C is `task_damping` and K_C is
    `task_stiffness` (m x m). Modes slower than `soft_frequency` (rad/s) are called soft.

    Raises Error for matrices of the wrong size, that are not symmetric, or not finite, and for a
    mass that is not positive definite.
    """
    impedance = _impedance(M, C, K, jacobian, task_damping, task_stiffness)
    return make_modes(_core.modes(impedance, soft_frequency))


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Response(Result):
    """Motion of a system at t times: position and velocity of its n coordinates, the parts of
    them along the zero modes, and the shares of its m modes."""

    times: Array
    """t, s."""
    position: Array
    """t x n."""
    velocity: Array
    """t x n."""
    zero_mode_position: Array
    """t x n."""
    zero_mode_velocity: Array
    """t x n."""
    energy_share: Array
    """m: energy of each mode's own free motion at t = 0, relative to the sum of all."""
    zero_mode_share: float
    """The same of the drift along the zero modes. All shares add up to one."""
    cross_share: float
    """Energy of the whole motion minus that sum, relative to it: energy that modes share."""
    amplitude: Array
    """m x p: largest deflection of each point by each mode alone; infinite if it grows."""


def response(M: npt.ArrayLike, C: npt.ArrayLike | None, K: npt.ArrayLike | None,
             times: npt.ArrayLike, *, initial_position: npt.ArrayLike | None = None,
             initial_velocity: npt.ArrayLike | None = None, impulse: npt.ArrayLike | None = None,
             force: npt.ArrayLike | None = None, points: npt.ArrayLike | None = None) -> Response:
    """Returns the motion of M q'' + C q' + K q = f, in closed form.

    It starts at t = 0 from `initial_position` and `initial_velocity` (n each, zero by default).
    `impulse` (n, N s or N m s) acts at t = 0, and `force` (n, N or N m) from t = 0 on. Amplitudes
    belong to the points J q with J = `points` (p x n, such as three rows of Robot.jacobian), or
    to q. Raises Error as `modes` does, and for other sizes and times below zero.
    """
    return Response(**_core.response(
        _impedance(M, C, K, None, None, None), to_numbers("times", times, 1),
        to_vector("initial_position", initial_position),
        to_vector("initial_velocity", initial_velocity), to_vector("impulse", impulse),
        to_vector("force", force), to_matrix("points", points)))


def receptance(M: npt.ArrayLike, C: npt.ArrayLike | None, K: npt.ArrayLike | None,
               omega: npt.ArrayLike) -> ComplexArray:
    """Returns H = (K + i omega C - omega^2 M)^-1 (n x n) at omega (rad/s), from the modes; for an
    array of frequencies ... x n x n."""
    system, at = _impedance(M, C, K, None, None, None), np.asarray(omega, dtype=np.float64)
    each = [_core.receptance(system, one) for one in at.ravel().tolist()]
    return np.asarray(each).reshape(at.shape + np.shape(each[0]) if each else (0, 0, 0))


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class SampledModes(Result):
    """Modes of a loop that a computer closes once a period, each with its continuous mode."""

    natural_frequency: Array
    """m, rad/s; NaN if there is none."""
    damping_ratio: Array
    damped_frequency: Array
    """m, rad/s."""
    eigenvalues: ComplexArray
    """m x 2, log(z) / period, 1/s."""
    discrete_eigenvalues: ComplexArray
    """m x 2, z: eigenvalues of the map from tick to tick."""
    kind: TextArray
    """m of underdamped, critical, overdamped, undamped, unstable, soft, or alternating: a negative
    z, which changes the sign of the motion in every tick."""
    zero_modes: ComplexArray
    """z of the velocities along the zero modes that are damped."""
    memory: ComplexArray
    """z of the slow modes that the integral causes."""
    others: ComplexArray
    """z of the loop's own memory: delay, filter, last position."""
    spectral_radius: float
    """Largest |z|: the loop is stable below 1."""
    gain_margin: float
    """Stiffness and the controller's damping can grow by this factor before the loop is unstable."""
    continuous: Modes


def _make_sampled(found: dict[str, Any]) -> SampledModes:
    return SampledModes(**{**found, "kind": np.array(found["kind"], dtype=np.str_),
                           "continuous": make_modes(found["continuous"])})


def _integral(time: float, K: npt.ArrayLike | None, jacobian: npt.ArrayLike | None,
              task_stiffness: npt.ArrayLike | None) -> Array | None:
    """Returns K_I, n x n, of the integral of the task's springs, or, without a jacobian, of K."""
    if not 0 <= time < np.inf:
        raise _core.Error(f"integral_time: {time} s is negative, or not finite")
    if time == 0:
        return None
    if jacobian is None or task_stiffness is None:
        springs = to_matrix("stiffness", K)
        square = springs is not None and springs.shape[0] == springs.shape[1]
        return springs / time if springs is not None and square else None
    J, task = to_numbers("jacobian", jacobian, 2), to_numbers("task_stiffness", task_stiffness, 2)
    if task.shape != (len(J), len(J)):
        raise _core.Error(f"task_stiffness: is {task.shape}, and the jacobian {J.shape}")
    return J.T @ task @ J / time


def sampled_modes(M: npt.ArrayLike, C: npt.ArrayLike | None, K: npt.ArrayLike | None, *,
                  period: float, delay: int = 0, torque_cutoff: float = 0,
                  difference_velocity: bool = False, friction: npt.ArrayLike | None = None,
                  gravity_gradient: npt.ArrayLike | None = None,
                  integral_time: float = 0) -> SampledModes:
    """Returns the modes of the sampled loop: the torque -K q - C q' is computed once a
    `period` (s), acts `delay` ticks later, is held until the next tick, and passes a first-order
    low-pass of `torque_cutoff` (Hz; 0: none). With `difference_velocity` the controller uses
    (q_k - q_k-1) / period for q'. `friction` (n x n) is the part of C in the joints, and
    `gravity_gradient` (n x n) the gradient of the gravity that the controller compensates. With an
    `integral_time` t (s; 0: none) the controller also integrates its springs: its torque has another
    term -s with s' = K q / t.

    Raises Error as `modes` does, and for a period that is not positive.
    """
    impedance = _impedance(M, C, K, None, None, None)
    loop = _core.SampledLoop(period, delay, torque_cutoff, difference_velocity,
                             to_matrix("friction", friction),
                             to_matrix("gravity_gradient", gravity_gradient),
                             _integral(integral_time, K, None, None))
    return _make_sampled(_core.sampled_modes(impedance, loop))


@dataclasses.dataclass(frozen=True)
class Miss:
    """A mode that misses the wanted ratio."""

    mode: int
    """Index in the modes, from 0."""
    natural_frequency: float
    wanted: float
    obtained: float
    reason: str
    """soft, overdone, structure, coupling or loop."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class DampingDesign(Result):
    """A positive semidefinite damping matrix and the modes that it gives."""

    damping: Array
    """C_C (m x m) if the stiffness is given in task space, otherwise C (n x n)."""
    modes: Modes
    misses: tuple[Miss, ...]
    """Empty if every mode has its ratio."""
    indefinite_by: float
    """Most negative eigenvalue of the exact answer where `misses` are overdone, 1/s; else zero."""
    sampled: SampledModes | None = None
    """Of the sampled loop, if a period was given."""
    level: float = 1
    """Share of the wanted ratios with which the sampled loop keeps its gain margin."""
    kept: bool = True
    """False if no damping keeps the gain margin: do not use the design."""


def design_damping(M: npt.ArrayLike, K: npt.ArrayLike | None = None, *, damping_ratio: float = 0.7,
                   jacobian: npt.ArrayLike | None = None,
                   task_stiffness: npt.ArrayLike | None = None,
                   damping: npt.ArrayLike | None = None, structure: str = "full",
                   start: npt.ArrayLike | None = None, soft_frequency: float = 1e-3,
                   period: float | None = None, delay: int = 0, torque_cutoff: float = 0,
                   integral_time: float = 0, gain_margin: float = 2) -> DampingDesign:
    """Returns the damping with which every mode has `damping_ratio`.

    The springs are `task_stiffness` K_C (m x m) at `jacobian` J (m x n), or K (n x n) alone. The
    design is added to the existing `damping` (n x n). `structure` is full, block or diagonal; with
    `start` the result is near that matrix. Modes below `soft_frequency` (rad/s) get less. With a
    `period` (s) the loop is sampled as in `sampled_modes`, with an integral of only the task's
    springs, and keeps `gain_margin`.

    Raises Error as `modes` does.
    """
    if damping_ratio > 5:
        warnings.warn(f"a damping ratio of {damping_ratio} is not a percentage", stacklevel=2)
    loop = None
    if period is not None:
        loop = _core.SampledLoop(period, delay, torque_cutoff, False, None, None,
                                 _integral(integral_time, K, jacobian, task_stiffness))
    found = _core.design_damping(_impedance(M, damping, K, jacobian, None, task_stiffness),
                                 damping_ratio, soft_frequency, structure,
                                 to_matrix("start", start), loop, gain_margin)
    found["modes"] = make_modes(found["modes"])
    found["misses"] = tuple(Miss(*miss) for miss in found["misses"])
    if "sampled" in found:
        found["sampled"] = _make_sampled(found["sampled"])
    return DampingDesign(**found)
