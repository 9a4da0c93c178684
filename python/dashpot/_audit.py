"""What gains really do on an arm, at one posture and at many."""

from __future__ import annotations

import concurrent.futures
import dataclasses
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ._core import Error, Gains
from ._results import Array, Modes, Result, make_modes, to_gain, to_numbers
from ._robot import DIRECTIONS, Robot, check_postures, gains_text, known_projector, selected
from ._workers import Task, chunks_of, collect, workers


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class PostureAudit(Result):
    """A posture in full. The true number lies within the proved bound, where there is one."""

    q: Array
    """n, rad."""
    modes: Modes
    smallest_ratio: float
    """Smallest damping ratio of the modes that are not soft; NaN if all are soft."""
    fastest_pole: float
    """Real part of the fastest eigenvalue of the continuous loop, 1/s; negative if damped."""
    gain_margin: float
    """Factor by which stiffness and damping may grow together; NaN without a period."""
    assumes: list[str]
    """Effects that the loop omits, such as "gravity ideal", "rotors unknown"."""
    singular: bool
    smallest_ratio_bound: float
    fastest_pole_bound: float
    """1/s."""
    integral_decays: Array
    """Decay rates of the slow modes of the integral, 1/s, the slowest first; empty without an
    integral or a period."""
    rotors: str
    """known, or unknown if a joint has no reflected inertia: fast modes, pole and margin then belong
    to an arm without rotors (Robot.missing_rotors names the joints)."""
    reflected_inertia_for_margin: Array | None
    """n, kg m^2, that the joints without rotors need for the wanted margin; zeros where
    none is needed. None if rotors are known, without a period, or if no inertia is enough."""
    damping_ratios_with_rotors: Array
    """m, of the modes with published rotors of such an arm, or else with that inertia, in the order
    of the most similar modes without rotors; NaN without such a mode. Empty if neither is known."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Distribution(Result):
    """Distribution of one number over postures; each entry is the number at one posture."""

    median: float
    p05: float
    p95: float
    worst: float
    worst_q: Array
    """n, rad, the posture of the worst; empty if no posture has the number."""
    bound: float
    """Largest proved bound of the four entries; NaN for the gain margin."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class WorkspaceAudit(Result):
    """Summary of many postures."""

    samples: int
    singular: int
    smallest_ratio: Distribution
    fastest_pole: Distribution
    """1/s."""
    gain_margin: Distribution


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class DampingSuggestion(Result):
    """Damping that gives every mode the wanted ratio at one posture."""

    damping: Array
    """6 x 6 in the axes of the gains' frame, or n x n for joint springs."""
    diagonal: Array
    """Diagonal of `damping`, which makes the nearest diagonal matrix."""
    smallest_ratio: float
    diagonal_smallest_ratio: float


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Contact(Result):
    """What an arm may touch with its tip, press and hold."""

    q: Array
    """n, rad."""
    direction: Array
    """3, of length 1, in the base's axes."""
    limit: float
    """Stiffness up to which the loop is stable, N/m; 0: unstable without contact, infinite: above 1e9."""
    limit_lower: float
    """Stable with it, N/m, proved; NaN if nothing could be proved."""
    limit_upper: float
    """Unstable with it, N/m, proved."""
    frequency: float
    """Of the motion that begins to grow there, rad/s."""
    stable_if_rigid: bool
    """Stable with the tip held rigidly."""
    with_half_stiffness: float
    """The limit with half of the stiffness, N/m."""
    with_more_damping: float
    """The limit with 1.5 times the damping, N/m."""
    with_less_delay: float
    """The limit with a tick less of delay, N/m; NaN without delay."""
    passive: bool
    """Stable against everything that is passive."""
    missing_friction: float
    """Viscous friction that each joint lacks for passivity below the Nyquist frequency, N m s/rad."""
    weight: Array
    """n, against gravity, N m (N)."""
    effort: Array
    """n, its limit, N m (N); infinite: unknown."""
    forces: Array
    """8 x 6: direction in which the tip presses (3), force at which a joint reaches its limit (N),
    deflection of the springs there (m), and that joint, from 0; -1: none."""
    curve: Array
    """s x 3, for each `stiffness` of the call: the stiffness (N/m), the least damping ratio, and the
    natural frequency of that motion (rad/s)."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Audit(Result):
    """Result of `audit`; None for the parts that were not requested."""

    posture: PostureAudit | None
    workspace: WorkspaceAudit | None
    suggestion: DampingSuggestion | None


def _workspace(task: Task, samples: int, seed: int, postures: Array | None,
               executor: concurrent.futures.Executor | None) -> WorkspaceAudit:
    with workers(executor) as pool:
        chunks: list[Any]
        if postures is None:
            chunks = [(task.sample, (seed, first, count)) for first, count in chunks_of(samples)]
        else:
            chunks = [(task.numbers, (postures[first:first + count],))
                      for first, count in chunks_of(samples)]
        numbers = np.concatenate(collect(pool, chunks, samples))
    found = task.core.summarize(numbers, seed, postures)
    return WorkspaceAudit(found["samples"], found["singular"],
                          *(Distribution(**found[name])
                            for name in ("smallest_ratio", "fastest_pole", "gain_margin")))


def _damping(stiffness: npt.ArrayLike | None, damping: npt.ArrayLike | None,
             factor: float | None, name: str) -> Array | None:
    """Returns the damping given, or factor times the root of each entry of the stiffness."""
    if factor is None:
        return to_gain(name, damping)
    if damping is not None:
        raise Error(f"damping_factor: {name} is given as well")
    matrix = to_gain("stiffness", stiffness)
    if matrix is None or (matrix < 0).any():
        raise Error("damping_factor: has no meaning without a stiffness of entries of at least zero")
    return factor * np.sqrt(matrix)


def _measured(robot: Robot, joints: Mapping[str, Any]) -> Array:
    """Returns the positions of the robot's joints in the complete messages of a JointState topic."""
    names = [str(name) for name in joints.get("name", ())]
    missing = [name for name in robot.joint_names if name not in names]
    if missing or "position" not in joints:
        raise Error(f"postures: the topic has no positions of {', '.join(missing) or 'joints'}")
    columns = [names.index(name) for name in robot.joint_names]
    position: Array = np.asarray(joints["position"], float)[:, columns]
    complete: Array = position[np.isfinite(position).all(axis=1)]
    return complete


def _task(robot: Robot, *, task_stiffness: npt.ArrayLike | None = None,
          task_damping: npt.ArrayLike | None = None, damping_factor: float | None = None,
          null_stiffness: npt.ArrayLike | None = None, null_damping: npt.ArrayLike | None = None,
          null_projector: str = "dynamic", null_weights: npt.ArrayLike | None = None,
          joint_stiffness: npt.ArrayLike | None = None,
          joint_damping: npt.ArrayLike | None = None, frame: str = "base",
          directions: Sequence[str] = DIRECTIONS, half_quaternion: bool = False,
          inertia_blocks: bool = False, period: float = 0, delay: int = 0, cutoff: float = 0,
          difference_velocity: bool = False, integral_time: float = 0, ideal_gravity: bool = False,
          margin: float = 2, soft_frequency: float = 0.1, lower: npt.ArrayLike | None = None,
          upper: npt.ArrayLike | None = None, outside_limits: bool = False,
          urdf_friction: bool = False) -> Task:
    """Returns the task of the gains and the loop that `audit` describes."""
    at_tip = joint_stiffness is None and joint_damping is None
    if not at_tip and not (task_stiffness is None and task_damping is None):
        raise Error("joint_stiffness: springs are fixed to a joint position or to a pose, not both")
    factor_of = (damping_factor, None) if at_tip else (None, damping_factor)
    if not float(delay).is_integer():
        raise Error(f"delay: {delay} is not a whole number of ticks; is it in s?")
    chosen = selected(directions)
    stiffness = to_gain("task_stiffness", task_stiffness)
    damping = _damping(task_stiffness, task_damping, factor_of[0], "task_damping")
    if at_tip and not all(chosen):
        keep = np.outer(chosen, chosen)
        stiffness = None if stiffness is None else stiffness * keep
        damping = None if damping is None else damping * keep
    gains = gains_text(
        joint_stiffness=joint_stiffness, task_stiffness=stiffness, task_damping=damping,
        joint_damping=_damping(joint_stiffness, joint_damping, factor_of[1], "joint_damping"),
        null_stiffness=null_stiffness, null_damping=null_damping, task_frame=frame)
    options: dict[str, Any] = {"half_quaternion": half_quaternion, "inertia_blocks": inertia_blocks,
                               **known_projector(null_projector, null_weights),
                               "period": float(period), "delay": delay, "cutoff": float(cutoff),
                               "difference_velocity": difference_velocity,
                               "integral_time": float(integral_time),
                               "ideal_gravity": ideal_gravity, "margin": float(margin),
                               "soft_frequency": float(soft_frequency)}
    for name, values in (("lower", lower), ("upper", upper)):
        if values is not None:
            options[name] = to_numbers(name, values, 1)
    task = Task(robot._for_gains(urdf_friction), gains, at_tip, options)
    for doubt in [] if inertia_blocks else Gains(robot._core, gains).doubts(robot._core):
        warnings.warn(doubt, stacklevel=3)
    if not outside_limits:
        check_postures(robot, "lower and upper", [options[k] for k in ("lower", "upper") if k in options])
    return task


def audit(robot: Robot, q: npt.ArrayLike | None = None, *,
          task_stiffness: npt.ArrayLike | None = None, task_damping: npt.ArrayLike | None = None,
          damping_factor: float | None = None, null_stiffness: npt.ArrayLike | None = None,
          null_damping: npt.ArrayLike | None = None, null_projector: str = "dynamic",
          null_weights: npt.ArrayLike | None = None,
          joint_stiffness: npt.ArrayLike | None = None,
          joint_damping: npt.ArrayLike | None = None, frame: str = "base",
          directions: Sequence[str] = DIRECTIONS, half_quaternion: bool = False,
          inertia_blocks: bool = False, period: float = 0, delay: int = 0, cutoff: float = 0,
          difference_velocity: bool = False, integral_time: float = 0,
          ideal_gravity: bool = False, margin: float = 2, soft_frequency: float = 0.1,
          damping_ratio: float | None = None, samples: int = 0, seed: int = 0,
          lower: npt.ArrayLike | None = None, upper: npt.ArrayLike | None = None,
          postures: npt.ArrayLike | Mapping[str, Any] | None = None, outside_limits: bool = False,
          urdf_friction: bool = False,
          executor: concurrent.futures.Executor | None = None) -> Audit:
    """Returns what gains really do on a robot.

    At posture q (n, rad; without `samples` and `postures` the middle of the position limits): its
    modes, smallest damping ratio, fastest pole and gain margin, and, with a `damping_ratio`, the
    damping that gives every mode this ratio. Over many postures: the distributions of these
    numbers. The postures are `samples` ones, spread evenly by a sequence of number `seed` between
    `lower` and `upper` (n, rad; by default the position limits), or `postures` (s x n, rad, or a
    topic of JointState as read_log returns it, whose joints are found by name).

    Postures outside the position limits are refused, unless `outside_limits`. Viscous friction
    specified for the robot adds damping; the friction of its URDF does so only with `urdf_friction`.

    Gains are as in `closed_loop`; `damping_factor` F stands for a damping of F sqrt(K), entry by
    entry. With `half_quaternion` the controller's error is half of the rotation vector; with
    `inertia_blocks` it multiplies gains by the tip's inertia, separately for translation and
    rotation; with a `null_projector` of "kinematic" instead of "dynamic" null-space gains act through
    I - J^+ J, with "weighted" through I - J^+ J with `null_weights` in J^+, with "none" in all joints.
    The loop has a `period` (s; 0: no gain margin), `delay` (ticks), a low-pass of `cutoff` (Hz; 0:
    none), `difference_velocity`, and an integral of the springs with `integral_time` (s; 0: none),
    which affects only the gain margin. The torque against gravity is as late as the rest, unless it
    is `ideal_gravity`, as of a robot that holds itself. If the robot lacks reflected inertia, the
    posture has the inertia that would suffice for a gain margin of `margin`. Modes below
    `soft_frequency` (rad/s) are soft.

    An `executor` of concurrent.futures maps over chunks of postures, by default one of threads. The
    results are the same to the last bit for any executor and number of workers.

    Raises Error for gains that are not symmetric positive semidefinite, or of another size. Raises
    concurrent.futures.BrokenExecutor, which says how many postures were done, if a worker dies and
    its executor does not start the work again.
    """
    task = _task(
        robot, task_stiffness=task_stiffness, task_damping=task_damping,
        damping_factor=damping_factor, null_stiffness=null_stiffness, null_damping=null_damping,
        null_projector=null_projector, null_weights=null_weights, joint_stiffness=joint_stiffness,
        joint_damping=joint_damping, frame=frame, directions=directions, half_quaternion=half_quaternion,
        inertia_blocks=inertia_blocks, period=period, delay=delay, cutoff=cutoff,
        difference_velocity=difference_velocity, integral_time=integral_time,
        ideal_gravity=ideal_gravity, margin=margin, soft_frequency=soft_frequency, lower=lower,
        upper=upper, outside_limits=outside_limits, urdf_friction=urdf_friction)
    if isinstance(postures, Mapping):
        postures = _measured(robot, postures)
    given = None if postures is None else to_numbers("postures", postures, 2)
    samples = samples if given is None else len(given)
    if q is None and samples == 0 and damping_ratio is None:
        q = robot._core.default_posture()
    if not outside_limits:
        check_postures(robot, "q", [] if q is None else [to_numbers("q", q, 1)])
        check_postures(robot, "postures", [] if given is None else given)
    posture = workspace = suggestion = None
    if q is not None:
        at = to_numbers("q", q, 1)
        found = task.core.posture(at)
        posture = PostureAudit(**{**found, "modes": make_modes(found["modes"])})
        if damping_ratio is not None:
            suggestion = DampingSuggestion(**task.core.suggest(at, damping_ratio))
    elif damping_ratio is not None:
        raise Error("damping_ratio: is wanted at a posture, but q is missing")
    if samples > 0:
        workspace = _workspace(task, samples, seed, given, executor)
    return Audit(posture, workspace, suggestion)


def contact(robot: Robot, q: npt.ArrayLike | None = None, *,
            direction: npt.ArrayLike | None = None, damper: float = 0, mass: float = 0,
            stiffness: npt.ArrayLike = (), period: float = 0.001, **stated: Any) -> Contact:
    """Returns what an arm may touch with its tip at posture q (n, rad; by default the middle of the
    position limits): a spring with a `damper` (N s/m) and a `mass` (kg) along a `direction` (3, in the
    base's axes), or along the direction with the lowest limit.

    Gains and loop have the keywords of `audit`. For each `stiffness` (N/m) the result has the
    least damped motion.

    Raises Error like `audit`, for a direction of zero or in which the tip cannot move, and for a
    damper or mass that is negative.
    """
    task = _task(robot, period=period, **stated)
    at = robot._core.default_posture() if q is None else to_numbers("q", q, 1)
    if not stated.get("outside_limits", False):
        check_postures(robot, "q", [at])
    along = None if direction is None else to_numbers("direction", direction, 1)
    if along is not None and len(along) != 3:
        raise Error(f"direction: has {len(along)} entries, expected 3")
    touched = to_numbers("stiffness", stiffness, 1).tolist()
    return Contact(**task.core.contact(at, along, float(damper), float(mass), touched))
