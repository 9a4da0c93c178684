"""The impedance controller."""

from __future__ import annotations

import dataclasses
import enum
import json
import math
import numbers
import os
import re
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._core import Error
from ._results import Array, ComplexArray, IntArray, Result, TextArray, stack, table, to_gain, to_numbers, to_vector
from ._robot import is_cartesian, is_tool, known_projector, selected


class Status(enum.IntEnum):
    """Result of one tick: the most severe of several, which is the last in this list. From
    SETPOINT_STALE on a safe torque replaces the springs'; docs/safety.md describes each."""

    OK = 0
    TORQUE_LIMITED = 1
    NEAR_JOINT_LIMIT = 2
    LITTLE_MARGIN = 3
    WRENCH_NOT_FINITE = 4
    SETPOINT_REJECTED = 5
    WEIGHT_NOT_HELD = 6
    SETPOINT_STALE = 7
    SETPOINT_LOST = 8
    FAULT_LATCHED = 9
    TOO_MANY_RESTARTS = 10
    TIME_GAP = 11
    WRONG_RATE = 12
    COLLISION = 13
    INSTABILITY = 14
    TIP_SPEED_LIMIT = 15
    VELOCITY_LIMIT = 16
    WALL = 17
    POSITION_LIMIT = 18
    STATE_FROZEN = 19
    STATE_CONTRADICTORY = 20
    TIME_BACKWARD = 21
    BRAKE_DOUBTED = 22
    STATE_NOT_FINITE = 23
    STATE_WRONG_SIZE = 24
    STATE_JUMP = 25
    NOT_FINITE = 26

    @property
    def text(self) -> str:
        return _core.status_text(int(self))



@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Setpoint(Result):
    """Where the robot is to go; the controller moves there smoothly."""

    joint_position: npt.ArrayLike | None = None
    """n, rad. Mode joint: the goal. Mode cartesian: the posture of the null-space springs; None
    keeps the active one."""
    tip_pose: npt.ArrayLike | None = None
    """4 x 4, goal of mode cartesian."""
    wrench: npt.ArrayLike | None = None
    """6, that the tip exerts in addition, N and N m; None: zero."""
    mode: str | None = None
    """joint or cartesian; None: cartesian if there is a tip_pose."""
    time: float | None = None
    """When it was given, as in Controller.update; None: at the tick that takes it up."""

    def __post_init__(self) -> None:
        for name, dimensions in (("joint_position", 1), ("tip_pose", 2), ("wrench", 1)):
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, to_numbers(name, given, dimensions))
        if self.mode is None:
            object.__setattr__(self, "mode", "joint" if self.tip_pose is None else "cartesian")
        super().__post_init__()

    def _parts(self) -> tuple[Any, ...]:
        time = None if self.time is None else nanoseconds(self.time)
        return (is_cartesian(str(self.mode)), _column(self.joint_position), self.tip_pose,
                _column(self.wrench), time)


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Snapshot(Result):
    """Input and output of one tick."""

    time: int
    """ns, of the state."""
    tick: int
    """Counted from 1."""
    restarts: int
    """How often the springs restarted, the first time included."""
    status: Status
    fault: Status
    """The latched fault; OK: none."""
    mode: str
    position: Array
    """n, rad."""
    velocity: Array
    """n, rad/s."""
    torque: Array
    """n, N m."""
    law_torque: Array
    """n, N m, before the limits."""
    reference_joint_position: Array
    """n, rad, where the joint springs are fixed; in mode cartesian the posture."""
    tip_pose: Array
    """4 x 4."""
    reference_tip_pose: Array
    """4 x 4, where the Cartesian springs are fixed."""
    tip_error: Array
    """6, from tip to reference: m, and rotation vector, rad."""
    tip_wrench: Array
    """6, of the Cartesian springs, dampers and feed-forward, N and N m."""
    joint_damping_ratio: float
    """Ratio for which the active joint damping is designed; 0: damping given as numbers."""
    task_damping_ratio: float
    """Likewise of the Cartesian springs."""
    damping_level: float
    """Least share of its ratio that the sampled loop allows a mode; 1: no ratio is lowered."""
    energy_store: float
    """Energy in the tank, J; infinite if control.energy is free."""
    spring_share: float
    """Share of the springs' torque that the energy in the tank allows; 1: all."""
    payload_mass: float
    """kg, active at this tick; it changes gradually to the mass of set_payload."""
    payload_center: Array
    """3, of mass, m, from the tip link's origin in its axes."""
    payload_inertia: Array
    """3 x 3, kg m^2, about the centre."""
    tool: Array
    """4 x 4, the tool's frame in the tip link."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class TrackedModes(Result):
    """The modes at one tick, by falling natural frequency; terms and bounds as in Modes."""

    natural_frequency: Array
    damping_ratio: Array
    damped_frequency: Array
    eigenvalues: ComplexArray
    kind: TextArray
    error_bound: Array
    natural_frequency_bound: Array
    damping_ratio_bound: Array
    shapes: ComplexArray
    """m x n; zero if the configuration asks for no shapes."""
    label: IntArray
    """m; a mode keeps its label as long as it can be followed."""
    zero_modes: int
    """Number of motions that no spring resists."""
    time: int
    """ns, of the state that the modes belong to."""
    tick: int
    position: Array
    """n, of that state, rad."""
    status: str
    origin: str
    """tracked, reused or direct."""
    counters: dict[str, int]
    """Numbers of ticks by what the analysis did, see controller/plugin.h."""

    def __len__(self) -> int:
        return len(self.natural_frequency)

    def __repr__(self) -> str:
        head = (f"TrackedModes at tick {self.tick}: {len(self)}, zero modes: {self.zero_modes}, "
                f"status: {self.status}\n")
        return head + table({"label": self.label.tolist(),
                             "rad/s": self.natural_frequency.tolist(),
                             "ratio": self.damping_ratio.tolist(),
                             "1/s within": self.error_bound.tolist(), "kind": self.kind.tolist()})


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class TrackedSampledModes(Result):
    """The modes of the sampled loop at one tick, by falling continuous frequency; terms as in
    SampledModes."""

    natural_frequency: Array
    damping_ratio: Array
    damped_frequency: Array
    kind: TextArray
    continuous_frequency: Array
    continuous_ratio: Array
    spectral_radius: float
    gain_margin: float
    assumes: list[str]
    """Effects that the loop omits, such as "gravity ideal", "rotors unknown"."""
    time: int
    tick: int
    position: Array
    status: str


def nanoseconds(time: float) -> int:
    """Returns a time in ns, given as an integer number of ns or as seconds in a float."""
    if isinstance(time, numbers.Integral):
        return int(time)
    if not math.isfinite(time):
        raise Error("time: is not a finite number")
    return round(1e9 * time)


class Ending:
    """How a loop ends: the arm stops, and then its torque fades to nothing."""

    LONGEST = 1.0  # s; the torque fades then in any case
    LOOK = 0.1  # s between two checks of a stopping arm
    STANDS = 1e-3  # rad between two checks: less is standstill

    def __init__(self, controller: Controller, fade: float) -> None:
        """`fade`: how long the torque fades, s."""
        self._controller = controller
        self._fade = fade
        self._began: int | None = None  # ns
        self._fading: int | None = None  # since when, ns
        self._seen: tuple[int, Array] | None = None  # ns, and where the arm was then

    def begin(self, ns: int) -> None:
        """Before the tick at `ns`; the first call stops the arm."""
        if self._began is None:
            self._began = ns
            self._controller.stop()

    def left(self, ns: int, q: Array) -> float:
        """After that tick: the share of its torque to apply, 0 at the end."""
        if self._fading is None and self._stands(ns, q):
            self._fading = ns
        return 1.0 if self._fading is None else max(0.0, 1 - 1e-9 * (ns - self._fading) / self._fade)

    def _stands(self, ns: int, q: Array) -> bool:
        if ns - (self._began or 0) >= 1e9 * self.LONGEST:
            return True
        if self._seen is not None and ns - self._seen[0] < 1e9 * self.LOOK:
            return False
        before, self._seen = self._seen, (ns, np.array(q))
        return before is not None and float(np.abs(q - before[1]).max()) < self.STANDS


def _column(values: npt.ArrayLike | None) -> Array | None:
    return None if values is None else np.asarray(values, dtype=np.float64).reshape(-1, 1)


class Controller:
    """Impedance controller of one arm with n joints, the same that a host loads as plugin.

    One thread calls `update`, `stop` and `reset`, others may call the rest. Call `start` before the loop, so
    that gains are judged where the robot is:

        controller = dashpot.Controller("controller/examples/panda.yaml")
        controller.start(q)
        for tick in range(1000):  # every period, with what the robot reports
            torque, status = controller.update(tick * controller.period, q, qd)
    """

    def __init__(self, config: str | os.PathLike[str] | Mapping[str, Any]) -> None:
        """Takes the path of a configuration file, or its contents as a dict, in which a relative
        path of a URDF begins at the working directory. controller/examples/panda.yaml has all keys.

        Raises Error that names key and reason, also for gains with too small a gain margin.
        """
        if isinstance(config, Mapping):
            text = json.dumps(config, default=_plain)
            self._core = _core.Controller.from_text(text, os.getcwd())
        else:
            self._core = _core.Controller.from_file(os.fspath(config))
        self.joints: int = self._core.joints
        """n."""
        self.joint_names: tuple[str, ...] = tuple(self._core.joint_names())
        """n, from the base to the tip."""
        self._warned: set[str] = set()  # of what set_gains has, without its numbers
        self.period: float = self._core.period
        """Of the loop, s."""

    def __repr__(self) -> str:
        return f"Controller({self.joints} joints, {self.period} s)"

    def update(self, time: float, q: npt.ArrayLike, qd: npt.ArrayLike,
               setpoint: Setpoint | None = None, *,
               external_wrench: npt.ArrayLike | None = None) -> tuple[Array, Status]:
        """Does one tick: takes the state, and returns the torque (n, N m) and the status.

        `time` is of the state, on any clock that does not run backward: seconds as a float, or
        nanoseconds as an integer. q and qd (n, rad and rad/s) are measured. Without a set-point the
        last one stays active. `external_wrench` (6) is the wrench of the world on the tip. The
        torque is safe to send with every status; a bad state gives a status, not an exception.
        """
        torque, status = self._core.update(
            nanoseconds(time), np.asarray(q, dtype=np.float64), np.asarray(qd, dtype=np.float64),
            None if setpoint is None else setpoint._parts(),
            None if external_wrench is None else np.asarray(external_wrench, dtype=np.float64))
        return torque, Status(status)

    def needs_brakes(self) -> bool:
        """True if, after the last update, the host has to end the motion at once and to engage the
        robot's own brakes: no torque is known to be safe, or the state is lost."""
        return self._core.needs_brakes()

    def start(self, q: npt.ArrayLike, torque: npt.ArrayLike | None = None) -> None:
        """Prepares the loop with the robot at rest at q (n, rad), where it applies `torque` (n, N m;
        None: its weight). Raises Error for gains with too small a gain margin there. Warns of a
        limits.torque_rate that makes stops slow."""
        _warn(self._core.start(to_numbers("q", q, 1).reshape(-1, 1),
                               _column(to_vector("torque", torque))))

    def reset(self, torque: npt.ArrayLike | None = None) -> None:
        """Forgets history, faults and set-point, but not the gains. The torque-rate limit counts
        from `torque` (n, N m; None: the last one)."""
        self._core.reset(_column(to_vector("torque", torque)))

    def stop(self) -> None:
        """Stops the arm, before the loop ends: discards the set-point."""
        self._core.stop()

    def release(self) -> None:
        """Releases a latched fault at the next tick, unless its cause is still present."""
        self._core.release()

    def set_setpoint(self, setpoint: Setpoint | None = None, **parts: Any) -> None:
        """Sets the set-point for the next tick: a Setpoint, or its parts. Raises Error for an
        impossible one."""
        wanted = Setpoint(**parts) if setpoint is None else setpoint
        self._core.set_setpoint(*wanted._parts())

    def set_gains(self, *, joint_stiffness: npt.ArrayLike | None = None,
                  joint_damping: npt.ArrayLike | None = None,
                  joint_damping_ratio: float | None = None,
                  task_stiffness: npt.ArrayLike | None = None,
                  task_damping: npt.ArrayLike | None = None,
                  task_damping_ratio: float | None = None,
                  null_stiffness: npt.ArrayLike | None = None,
                  null_damping: npt.ArrayLike | None = None,
                  null_damping_ratio: float | None = None, null_projector: str | None = None,
                  frame: str | None = None,
                  directions: Sequence[str] | None = None) -> None:
        """Sets gains for the next tick; None keeps a gain. Matrices (n x n, 6 x 6) may be given as
        their diagonals, null_stiffness and null_damping have n entries. `null_projector` is
        "dynamic", "kinematic", "weighted" or "none", as in `control` of a configuration. Raises Error for impossible
        gains, and for gains with too small a gain margin of the sampled loop. Warns, once of each
        kind, if such gains are accepted because the margin was smaller before, and of gains that
        look like another unit or order."""
        given = {key: value for key, value in locals().items() if key != "self"}
        text = self._core.set_gains(_gains(given))
        kind = re.sub(r"\d[\d.e+-]*", "#", text)
        if kind not in self._warned:
            self._warned.add(kind)
            _warn(text)

    def set_payload(self, mass: float, center: npt.ArrayLike = (0, 0, 0),
                    inertia: npt.ArrayLike = ((0, 0, 0), (0, 0, 0), (0, 0, 0)), *,
                    tool: npt.ArrayLike | None = None,
                    gains: Mapping[str, Any] | None = None) -> None:
        """Sets the payload from the next tick on: mass (kg), centre (3, m, in the tip link) and
        inertia about it (3 x 3, kg m^2), and the pose of the tool in the tip link (4 x 4; None keeps
        it). `gains`, as for set_gains, take effect in the same tick. Weight and modes follow within
        motion.gain_time. Raises Error for a physically impossible payload, for one that the torque
        limits cannot hold, and if the gains then have too small a margin. Warns as set_gains does."""
        _warn(self._core.set_payload(float(mass), to_numbers("center", center, 1).reshape(-1, 1),
                                     to_numbers("inertia", inertia, 2),
                                     None if tool is None else to_numbers("tool", tool, 2),
                                     None if gains is None else _gains(dict(gains))))

    def limit_tip_speed(self, *, linear: float | None = None, angular: float | None = None,
                        limit: float | None = None) -> None:
        """Limits the tip's speed from the next tick on: of the moving reference (m/s, rad/s), and of
        the tip itself, where a higher speed is a fault (m/s). None is the configuration's limit,
        which is also the largest allowed. Raises Error for more, and for zero or less."""
        self._core.limit_tip_speed(*(math.inf if one is None else float(one)
                                     for one in (linear, angular, limit)))

    def judge_gains(self, position: npt.ArrayLike | None = None, **gains: Any) -> float:
        """Returns the gain margin of the sampled loop at `position` (n, rad; None: the latest) with
        gains as in set_gains, by default the configuration's: at most limits.gain_margin,
        below 1 if the loop is unstable."""
        return self._core.judge_gains(_column(to_vector("position", position)), _gains(gains))

    def publish(self, *urls: str) -> None:
        """Publishes states and modes of every tick over LCM from now on, as docs/plugin.md says, on
        each of these buses; without one on the bus of LCM_DEFAULT_URL or of this machine.
        "file:///tmp/arm.lcm?mode=w" writes a log. A thread without Python publishes, and only it may
        read results: until `stop_publishing`, snapshot, modes and sampled_modes raise Error."""
        self._core.publish("\n".join(urls))

    def stop_publishing(self) -> None:
        """Publishes the last tick, and ends what `publish` began."""
        self._core.stop_publishing()

    def modes_at(self, q: npt.ArrayLike, mode: str | None = None, **gains: Any) -> TrackedModes:
        """Returns the modes at rest at q (n, rad), as a loop would publish them, without a running
        loop. `mode` is joint or cartesian, and gains are as in set_gains; the configuration has the
        defaults, and decides whether there are shapes."""
        return self._modes_at(q, mode, gains)[0]

    def _modes_at(self, q: npt.ArrayLike, mode: str | None, gains: dict[str, Any]
                  ) -> tuple[TrackedModes, Array, Array]:
        """The modes, and at the tip the Jacobian (6 x n) and the place (3, m)."""
        cartesian = self._core.loop()["cartesian"] if mode is None else is_cartesian(mode)
        found, jacobian, place = self._core.modes_at(to_numbers("q", q, 1), cartesian, _gains(gains))
        return _tracked(found), jacobian, place

    def snapshot(self) -> Snapshot | None:
        """Returns the input and output of the latest tick; None before the first."""
        found = self._core.snapshot()
        if found is None:
            return None
        return Snapshot(**{**found, "status": Status(found["status"]),
                           "fault": Status(found["fault"])})

    def modes(self) -> TrackedModes | None:
        """Returns the modes of the latest analysed tick; None before the first."""
        found = self._core.modes()
        return None if found is None else _tracked(found)

    def sampled_modes(self) -> TrackedSampledModes | None:
        """Returns the latest analysis of the sampled loop (analysis.sampled.interval); None before
        the first."""
        found = self._core.sampled_modes()
        if found is None:
            return None
        return TrackedSampledModes(**{**found, "kind": np.array(found["kind"], dtype=np.str_)})


def _tracked(found: dict[str, Any]) -> TrackedModes:
    return TrackedModes(**{**found, "kind": np.array(found["kind"], dtype=np.str_),
                           "label": np.array(found["label"], dtype=np.int64),
                           "shapes": stack(found["shapes"], found["position"].shape, complex)})


def _gains(given: dict[str, Any]) -> dict[str, Any]:
    """Returns gains as C++ reads them."""
    result: dict[str, Any] = {}
    for key, value in given.items():
        if value is None:
            continue
        if key == "frame":
            result["tool_frame"] = is_tool(value)
        elif key == "directions":
            result[key] = selected(value)
        elif key.endswith("_ratio"):
            result[key] = np.array([[float(value)]])
        elif key == "null_projector":
            result.update(known_projector(value, None))
        elif key.startswith("null_"):
            result[key] = _column(to_numbers(key, value, 1))
        elif key in ("joint_stiffness", "joint_damping", "task_stiffness", "task_damping"):
            result[key] = to_gain(key, value)
        else:
            raise TypeError(f"unknown gain '{key}'")
    return result


def _warn(text: str) -> None:
    if text:
        warnings.warn(text, stacklevel=3)


def _plain(value: object) -> object:
    """Returns numpy's arrays and numbers as lists and numbers."""
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise Error(f"config: {type(value).__name__} is neither a number, a text, a list nor a dict")
