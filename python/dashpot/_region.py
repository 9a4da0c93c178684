"""One damping matrix for many postures."""

from __future__ import annotations

import concurrent.futures
import dataclasses
import warnings
from typing import Any

import numpy.typing as npt

from ._core import Error
from ._results import Array, Result, to_numbers
from ._robot import Robot, check_postures, gains_text, known_projector
from ._workers import Task, chunks_of, collect, workers


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class RegionDesign(Result):
    """One positive semidefinite damping matrix, and its worst results."""

    damping: Array
    """6 x 6 in the axes of the gains' frame, or n x n for joint springs."""
    level: float
    """Smallest ratio over all postures, relative to the wanted ratio, at most 1."""
    violation: float
    """By how much a ratio exceeds the largest allowed ratio."""
    worst_q: Array
    """n, rad, the posture of the smallest ratio; empty if no posture has a ratio."""
    share: float
    """Share of the damping for continuous loops with which the sampled loops keep their margin."""
    gain_margin: float
    """Smallest over all postures; infinite without a period."""
    margin_q: Array
    """n, rad, the posture of the smallest gain margin; empty without a period."""


def design_region(robot: Robot, *, damping_ratio: float = 0.7,
                  task_stiffness: npt.ArrayLike | None = None,
                  joint_stiffness: npt.ArrayLike | None = None,
                  null_stiffness: npt.ArrayLike | None = None,
                  null_damping: npt.ArrayLike | None = None, null_projector: str = "dynamic",
                  null_weights: npt.ArrayLike | None = None, frame: str = "base",
                  half_quaternion: bool = False, structure: str = "full",
                  largest_ratio: float | None = None, soft_frequency: float = 0.1,
                  samples: int = 0, seed: int = 0, lower: npt.ArrayLike | None = None,
                  upper: npt.ArrayLike | None = None, postures: npt.ArrayLike | None = None,
                  outside_limits: bool = False, urdf_friction: bool = False,
                  period: float = 0, delay: int = 0, cutoff: float = 0,
                  difference_velocity: bool = False, integral_time: float = 0,
                  ideal_gravity: bool = False, gain_margin: float = 2,
                  executor: concurrent.futures.Executor | None = None) -> RegionDesign:
    """Returns one constant damping matrix for many postures, as `dashpot design --region` does.

    It seeks the largest level such that every mode at every posture has at least level times
    `damping_ratio`, and at most `largest_ratio` (by default 1, or 1.5 times the wanted ratio
    if that is more). Postures, springs and null-space gains are as in `audit`; `structure` is
    full, block or diagonal. Modes below `soft_frequency` (rad/s) do not count.

    With a `period` (s) the matrix is lowered as a whole until the sampled loop of every posture
    keeps the `gain_margin`. The loop is as in `audit`: `delay` (ticks), `cutoff` (Hz),
    `difference_velocity`, `integral_time` (s), `ideal_gravity`.

    The search uses only postures that limit the result. The workers of an `executor` of
    concurrent.futures judge all postures in chunks, and return only the few worst ones. The result
    is the same to the last bit for any executor and number of workers.

    Warns if a ratio at some posture is less than a tenth of the wanted ratio, or more than the
    largest allowed ratio.

    Raises Error and BrokenExecutor as `audit` does, and Error without postures and if no share of
    the damping keeps the gain margin.
    """
    if (task_stiffness is None) == (joint_stiffness is None):
        raise Error("task_stiffness: give one of task_stiffness and joint_stiffness")
    if not period and (delay or cutoff or difference_velocity or integral_time or ideal_gravity
                       or gain_margin != 2):
        raise Error("period: missing; the other numbers of a loop need it")
    gains = gains_text(joint_stiffness=joint_stiffness, task_stiffness=task_stiffness,
                       null_stiffness=null_stiffness, null_damping=null_damping, task_frame=frame)
    options: dict[str, Any] = {"half_quaternion": half_quaternion, "inertia_blocks": False,
                               **known_projector(null_projector, null_weights),
                               "period": float(period), "delay": int(delay),
                               "cutoff": float(cutoff),
                               "difference_velocity": bool(difference_velocity),
                               "integral_time": float(integral_time),
                               "ideal_gravity": ideal_gravity,
                               "soft_frequency": float(soft_frequency)}
    for name, values in (("lower", lower), ("upper", upper)):
        if values is not None:
            options[name] = to_numbers(name, values, 1)
    task = Task(robot._for_gains(urdf_friction), gains, task_stiffness is not None, options)
    given = None if postures is None else to_numbers("postures", postures, 2)
    samples = samples if given is None else len(given)
    if not outside_limits:
        check_postures(robot, "postures", [] if given is None else given)
    if samples < 1:
        raise Error("samples: a region without postures")
    with workers(executor) as pool:
        def ask_all(question: Any) -> list[Any]:
            *asked, members = question
            return collect(pool, [
                (task.judge, ((*asked, [i for i in members if first <= i < first + count]), seed,
                              first, count, None if given is None else given[first:first + count]))
                for first, count in chunks_of(samples)], samples)

        found = task.core.design_region(samples, seed, given, float(damping_ratio), structure,
                                        largest_ratio, float(gain_margin), ask_all)
    if not found.pop("kept"):
        raise Error(f"gain_margin: no share of the damping keeps {gain_margin:.3g} at every posture; "
                    f"the largest is {found['gain_margin']:.3g}, with {found['share']:.3g} of it")
    region = RegionDesign(**found)
    if region.violation > 1e-6:
        warnings.warn("design_region: the existing damping exceeds largest_ratio by "
                      f"{region.violation:.3g}", stacklevel=2)
    elif region.level < 0.1:
        warnings.warn(f"design_region: the smallest ratio is {region.level:.3g} of the wanted ratio; "
                      "largest_ratio or the structure limits it", stacklevel=2)
    return region
