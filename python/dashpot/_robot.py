"""The robot from its URDF, and its closed loop with springs and dampers."""

from __future__ import annotations

import dataclasses
import importlib
import json
import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core, _mujoco
from ._core import Error
from ._results import Array, Modes, Result, make_modes, to_gain, to_numbers, to_vector

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
PROJECTORS = ("dynamic", "kinematic", "weighted", "none")
LOADS = ("base_wrench", "tool_wrench", "joint_torques")


def _options(*, gravity: npt.ArrayLike | None = None, include_off_chain: bool = True,
             accept_inertias: bool | Sequence[str] = False, drives: str = "",
             drives_friction: bool | None = None, reflected_inertia: npt.ArrayLike | None = None,
             viscous_friction: npt.ArrayLike | None = None,
             coulomb_friction: npt.ArrayLike | None = None,
             gear_stiffness: npt.ArrayLike | None = None,
             gear_damping: npt.ArrayLike | None = None, position_sensor: str = "motor",
             payload_mass: float = 0, payload_center: npt.ArrayLike = (0, 0, 0),
             payload_inertia: npt.ArrayLike = ((0, 0, 0), (0, 0, 0), (0, 0, 0)),
             tool: npt.ArrayLike | None = None) -> dict[str, Any]:
    """Returns the options of from_urdf as a configuration has them in `robot`."""
    options: dict[str, Any] = {"include_off_chain": include_off_chain,
                               "accept_inertias": (accept_inertias
                                                   if isinstance(accept_inertias, bool)
                                                   else list(accept_inertias)),
                               "position_sensor": position_sensor}
    if drives or drives_friction:
        options["drives"] = drives
    if drives_friction is not None:
        options["drives_friction"] = drives_friction
    if gravity is not None:
        options["gravity"] = _sized("gravity", gravity, (3,))
    for name, values in (("reflected_inertia", reflected_inertia),
                         ("viscous_friction", viscous_friction),
                         ("coulomb_friction", coulomb_friction),
                         ("gear_stiffness", gear_stiffness), ("gear_damping", gear_damping)):
        if values is not None:
            rigid = name == "gear_stiffness"
            options[name] = ["none" if rigid and value == np.inf else value
                             for value in to_numbers(name, values, 1).tolist()]
    if payload_mass:
        options["payload"] = {"mass": float(payload_mass),
                              "center": _sized("payload_center", payload_center, (3,)),
                              "inertia": _sized("payload_inertia", payload_inertia, (3, 3))}
    if tool is not None:
        pose = np.array(_sized("tool", tool, (4, 4)))
        if np.abs(pose[3] - [0, 0, 0, 1]).max() > 1e-9:
            raise Error(f"tool: its last row is {pose[3].tolist()}, not 0, 0, 0, 1: is it transposed?")
        options["tool"] = {"position": pose[:3, 3].tolist(), "rpy": _mujoco.rpy_of(pose[:3, :3])}
    return options


def _expand(path: str, arguments: Mapping[str, str]) -> str:
    """Returns the URDF that a xacro makes."""
    package: Any = None
    for name in ("xacro", "xacrodoc"):
        try:
            package = package or importlib.import_module(name)
        except ImportError:
            continue
    if package is None:
        raise Error(f"{path}: is a xacro: pip install xacro (or xacrodoc), which expands it, or "
                    f"expand it first: xacro {path} > robot.urdf")
    try:
        if package.__name__ == "xacro":
            return str(package.process_file(path, mappings=dict(arguments)).toxml())
        return str(package.XacroDoc.from_file(path, subargs=dict(arguments)).to_urdf_string())
    except Exception as error:  # any kind, depending on the file
        raise Error(f"{path}: xacro: {' '.join(str(error).split())}") from None


class Robot:
    """A serial chain of n moving joints between two links of a URDF. It cannot be changed, and can
    be pickled.

    Vectors are in the axes of the base link, twists and wrenches linear part first, at the tip. For
    a prismatic joint read m for rad and N for N m.
    """

    joint_names: tuple[str, ...]
    """n, from the base to the tip."""
    lower: Array
    """n, position limits, rad; -infinity for a continuous joint."""
    upper: Array
    velocity: Array
    """n, velocity limits, rad/s; infinite: no limit."""
    effort: Array
    """n, torque limits, N m; infinite: no limit."""
    viscous_friction: Array
    """n, N m s/rad."""
    coulomb_friction: Array
    """n, N m."""
    reflected_inertia: Array
    """n, of rotors and gears, kg m^2."""
    acceleration: Array
    """n, limits of acceleration, rad/s^2, of URDF 1.2 and later; infinite: no limit."""
    deceleration: Array
    jerk: Array
    """n, rad/s^3; likewise."""
    warnings: tuple[str, ...]
    """Doubtful entries of the description."""
    gear_stiffness: Array
    """n, N m/rad; infinite: rigid."""
    gear_damping: Array
    """n, N m s/rad, beside gear_stiffness."""

    def __init__(self, urdf: str, base: str, tip: str, *, file: str = "URDF",
                 **options: Any) -> None:
        """Reads the text of a URDF; `file` stands for it in messages. See from_urdf."""
        self._arguments = (urdf, base, tip, file, options)
        self._keys = {"urdf": file, "base": base, "tip": tip, **_options(**options)}
        self._core = _core.Robot(urdf, json.dumps({"robot": self._keys}))
        self.joint_names = tuple(self._core.joint_names())
        for name, values in self._core.joint_properties().items():
            values.flags.writeable = False
            setattr(self, name, values)
        self.warnings = tuple(self._core.warnings())

    @classmethod
    def from_urdf(cls, path: str | os.PathLike[str], base: str, tip: str, *,
                  gravity: npt.ArrayLike | None = None, include_off_chain: bool = True,
                  accept_inertias: bool | Sequence[str] = False, drives: str = "",
                  drives_friction: bool | None = None,
                  reflected_inertia: npt.ArrayLike | None = None,
                  viscous_friction: npt.ArrayLike | None = None,
                  coulomb_friction: npt.ArrayLike | None = None,
                  gear_stiffness: npt.ArrayLike | None = None,
                  gear_damping: npt.ArrayLike | None = None, position_sensor: str = "motor",
                  payload_mass: float = 0,
                  payload_center: npt.ArrayLike = (0, 0, 0),
                  payload_inertia: npt.ArrayLike = ((0, 0, 0), (0, 0, 0), (0, 0, 0)),
                  tool: npt.ArrayLike | None = None,
                  xacro_arguments: Mapping[str, str] | None = None) -> Robot:
        """Reads the chain from link `base` to link `tip` of the URDF at `path`. A xacro is expanded
        with `xacro_arguments` by the Python package xacro or xacrodoc, if one is installed.

        `gravity` (3, m/s^2) is in the axes of the file's root link, by default 9.81 along -z.
        Fingers and other links off the chain count as rigid at their zero position unless
        `include_off_chain` is False. `accept_inertias` accepts physically impossible inertias
        unchanged, for all links or for the named ones.
        `drives` names public values of reflected inertia, see published_drives, or a drives file
        of `dashpot calibrate` (.yaml). Their friction replaces the URDF's with `drives_friction`,
        and a file's friction unless that is False.
        `reflected_inertia` (n, kg m^2), `viscous_friction` (n, N m s/rad) and `coulomb_friction`
        (n, N m) replace the values of the drives and of the URDF. Elastic gears have
        `gear_stiffness` (n, N m/rad, numpy.inf: rigid) and `gear_damping` (n, N m s/rad) between a
        motor with the reflected inertia and its link; `position_sensor` says which of the two is
        measured, motor or link.
        A payload at the tip has `payload_mass` (kg), `payload_center`
        (3, m, in the tip link) and `payload_inertia` (3 x 3, kg m^2, about that centre). `tool` is
        the pose (4 x 4) of the tool's frame in the tip link; the tip is then this frame.

        Raises Error that names file, joint or link and reason, and warns of doubtful values, such as
        a mass that is probably not in kg.
        """
        options: dict[str, Any] = {
            "gravity": gravity, "include_off_chain": include_off_chain,
            "accept_inertias": accept_inertias, "drives": drives,
            "drives_friction": drives_friction, "reflected_inertia": reflected_inertia,
            "viscous_friction": viscous_friction, "coulomb_friction": coulomb_friction,
            "gear_stiffness": gear_stiffness, "gear_damping": gear_damping,
            "position_sensor": position_sensor, "payload_mass": payload_mass,
            "payload_center": payload_center, "payload_inertia": payload_inertia, "tool": tool}
        file = os.fspath(path)
        text = _core.read_urdf(file)
        try:
            robot = cls(text, base, tip, file=file, **options)
        except Error as error:
            if "is a xacro that is not expanded yet" not in str(error):
                raise
            robot = cls(_expand(file, xacro_arguments or {}), base, tip, file=file, **options)
        for said in robot.warnings:
            warnings.warn(f"{file}: {said}", stacklevel=2)
        return robot

    @classmethod
    def from_mujoco(cls, model: Any, base: str, tip: str, *, gravity: npt.ArrayLike | None = None,
                    reflected_inertia: npt.ArrayLike | None = None, **options: Any) -> Robot:
        """Reads the chain from body `base` to body or site `tip` of a mujoco.MjModel, or of the
        MJCF or MJB file at the path `model`, with armature as reflected inertia, damping, dry
        friction, gravity, and the limits of positions and actuators. Positions q are the same as in
        MuJoCo. Bodies off the chain count as rigid at the model's reference position (qpos0).

        `gravity` is in the axes of the model's world; other `options` are as in from_urdf:
        viscous_friction, coulomb_friction, the payload and the tool. Raises Error for ball and free
        joints on the chain, and warns of omitted effects.
        """
        loaded, name = _mujoco.load(model)
        arm = _mujoco.read_arm(loaded, name, base, tip)
        return cls(arm.urdf, arm.base, arm.tip, file=name, accept_inertias=True,
                   gravity=arm.gravity if gravity is None else gravity,
                   reflected_inertia=(arm.reflected_inertia if reflected_inertia is None
                                      else reflected_inertia), **options)

    def save(self, path: str | os.PathLike[str]) -> tuple[str, str]:
        """Writes the robot as files that the program and other programs read: its URDF to `path`,
        and beside it, ending in .yaml, a configuration with its drives, friction, payload and tool.
        Returns both paths."""
        urdf = os.fspath(path)
        config = os.path.splitext(urdf)[0] + ".yaml"
        robot = {**self._keys, "urdf": os.path.basename(urdf)}
        with open(urdf, "w", encoding="utf-8") as file:
            file.write(self._arguments[0])
        with open(config, "w", encoding="utf-8") as file:
            json.dump({"robot": robot}, file, indent=2)
            file.write("\n")
        return urdf, config

    def _for_gains(self, urdf_friction: bool) -> Robot:
        """Returns the robot without the viscous friction of its URDF, unless `urdf_friction` is true
        or other friction is specified."""
        urdf, base, tip, file, options = self._arguments
        stated = options.get("viscous_friction") is not None or self._keys.get(
            "drives_friction", _core.has_own_friction(options.get("drives", "")))
        if urdf_friction or stated or not self.viscous_friction.any():
            return self
        return _make_robot(urdf, base, tip, file,
                           {**options, "viscous_friction": np.zeros(len(self))})

    def __reduce__(self) -> tuple[Any, ...]:
        return _make_robot, self._arguments

    def __repr__(self) -> str:
        _, base, tip, file, _ = self._arguments
        return f"Robot({self.name}: {len(self)} joints from {base} to {tip}, {file})"

    def __len__(self) -> int:
        """Returns n."""
        return len(self.joint_names)

    @property
    def name(self) -> str:
        """The robot's name in the URDF."""
        return self._core.name

    @property
    def missing_rotors(self) -> str:
        """Names of the joints without reflected inertia, which makes fast modes and gain margins
        wrong; empty if all have it."""
        return self._core.missing_rotors()

    def _at(self, q: npt.ArrayLike) -> Array:
        """Returns q as numbers; warns of many turns that would fit as degrees."""
        values = _joint_values("q", q)
        if values.shape == (len(self),) and np.abs(values).max() > 13:
            complaint = self._core.outside_limits(values)
            if "degrees" in complaint:
                warnings.warn(f"q: {complaint}", stacklevel=3)
        return values

    def pose(self, q: npt.ArrayLike) -> Array:
        """Returns the pose of the tip at q (n, rad): 4 x 4, from the tip's axes into the base's."""
        return self._core.pose(self._at(q))

    def mass(self, q: npt.ArrayLike) -> Array:
        """Returns the mass matrix at q (n, rad): n x n, kg m^2."""
        return self._core.mass(self._at(q))

    def gravity(self, q: npt.ArrayLike) -> Array:
        """Returns the gradient of the potential energy at q (n, rad): n, N m, the torque that holds
        the arm."""
        return self._core.gravity(self._at(q))

    def coriolis(self, q: npt.ArrayLike, qd: npt.ArrayLike) -> Array:
        """Returns C(q, qd) qd: n, N m."""
        return self._core.coriolis(self._at(q), _joint_values("qd", qd))

    def jacobian(self, q: npt.ArrayLike) -> Array:
        """Returns J at q (n, rad): 6 x n, the tip's twist is J qd, linear rows first."""
        return self._core.jacobian(self._at(q))

    def jacobian_dot_qd(self, q: npt.ArrayLike, qd: npt.ArrayLike) -> Array:
        """Returns dJ/dt qd: 6, the tip's acceleration without joint accelerations."""
        return self._core.jacobian_dot_qd(self._at(q), _joint_values("qd", qd))


def published_drives() -> dict[str, dict[str, Any]]:
    """Returns public values of arms' drives by name: `reflected_inertia` (n, kg m^2),
    `viscous_friction` (n, N m s/rad) and `coulomb_friction` (n, N m; zeros: not published), with
    `source` and `doubt`. They were not measured on your arm."""
    return _core.published_drives()


def _make_robot(urdf: str, base: str, tip: str, file: str, options: dict[str, Any]) -> Robot:
    return Robot(urdf, base, tip, file=file, **options)


def _joint_values(name: str, values: npt.ArrayLike) -> Array:
    return to_numbers(name, values, 1)


def _sized(name: str, given: npt.ArrayLike, shape: tuple[int, ...]) -> list[Any]:
    numbers = to_numbers(name, given, len(shape))
    if numbers.shape != shape:
        raise Error(f"{name}: is {' x '.join(map(str, numbers.shape))}, "
                    f"expected {' x '.join(map(str, shape))}")
    listed: list[Any] = numbers.tolist()
    return listed


def check_postures(robot: Robot, name: str, postures: Iterable[Array]) -> None:
    """Raises Error for the first of the postures (n, rad) outside the robot's position limits."""
    for i, q in enumerate(postures):
        if len(q) != len(robot):
            raise Error(f"{name}: has {len(q)} entries, the robot has {len(robot)} joints")
        complaint = robot._core.outside_limits(q)
        if complaint:
            raise Error(f"{name}{'' if name == 'q' else f'[{i}]'}: {complaint}")


def one_damping(part: str, stiffness: npt.ArrayLike | None, damping: npt.ArrayLike | None,
                ratio: float) -> None:
    """Raises Error for springs without a damping matrix or ratio."""
    if stiffness is not None and np.any(stiffness) and damping is None and not ratio:
        raise Error(f"{part}_damping and {part}_damping_ratio: one of them is wanted beside "
                    f"{part}_stiffness; {part}_damping = zeros is a loop without damping")


def known_projector(null_projector: str, null_weights: npt.ArrayLike | None) -> dict[str, Any]:
    """Returns a projector of the null space, and its weights if it has some."""
    if null_projector not in PROJECTORS:
        raise Error(f"null_projector: {null_projector!r} is not one of {', '.join(PROJECTORS)}")
    if null_weights is None:
        return {"null_projector": null_projector}
    weights = to_numbers("null_weights", null_weights, 1)
    if null_projector != "weighted" or not (weights > 0).all():
        raise Error("null_weights: they are positive, and go with null_projector='weighted'")
    return {"null_projector": null_projector, "null_weights": weights}


def selected(directions: Sequence[str]) -> list[bool]:
    """Returns which of the six directions are named."""
    for direction in directions:
        if direction not in DIRECTIONS:
            raise Error(f"directions: '{direction}' is not one of {', '.join(DIRECTIONS)}")
    return [direction in directions for direction in DIRECTIONS]


def is_tool(frame: str) -> bool:
    """Returns whether the frame of gains is the tool's."""
    if frame not in ("base", "tool"):
        raise Error(f"frame: '{frame}' is not one of base, tool")
    return frame == "tool"


def gains_text(**given: Any) -> str:
    """Returns gains as a configuration has them: task_damping is gains.task.damping. None, or a ratio
    of 0, counts as missing."""
    gains: dict[str, dict[str, Any]] = {"joint": {}, "task": {}, "null_space": {}}
    for key, value in given.items():
        part, _, name = key.partition("_")
        if value is None or (name == "damping_ratio" and value == 0):
            continue
        if name in ("stiffness", "damping"):
            value = np.asarray((to_vector if part == "null" else to_gain)(key, value)).tolist()
        gains["null_space" if part == "null" else part][name] = value
    return json.dumps({"gains": gains}, default=float)


def is_cartesian(mode: str) -> bool:
    """Returns whether springs are fixed to a pose of the tip."""
    if mode not in ("joint", "cartesian"):
        raise Error(f"mode: '{mode}' is not one of joint, cartesian")
    return mode == "cartesian"


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class ClosedLoop(Result):
    """The robot with springs and dampers, M q'' + C q' + K q = f, where its springs are at rest. With
    elastic gears n counts their motors as well, after the joints."""

    mass: Array
    """M, n x n, kg m^2."""
    damping: Array
    """C, n x n, N m s/rad, the joints' viscous friction included."""
    stiffness: Array
    """K, n x n, N m/rad; not symmetric with an external wrench, or with elastic gears and measured
    links."""
    modes: Modes


def closed_loop(robot: Robot, q: npt.ArrayLike, *, task_stiffness: npt.ArrayLike | None = None,
                task_damping: npt.ArrayLike | None = None, task_damping_ratio: float = 0,
                null_stiffness: npt.ArrayLike | None = None,
                null_damping: npt.ArrayLike | None = None, null_damping_ratio: float = 0,
                joint_stiffness: npt.ArrayLike | None = None,
                joint_damping: npt.ArrayLike | None = None, joint_damping_ratio: float = 0,
                frame: str = "base", directions: Sequence[str] = DIRECTIONS,
                external_wrench: npt.ArrayLike | None = None, load: str = "base_wrench",
                soft_frequency: float = 0.1, null_projector: str = "dynamic",
                null_weights: npt.ArrayLike | None = None) -> ClosedLoop:
    """Returns the loop that Dashpot's controller closes around the robot at rest at q (n, rad).

    Matrices are symmetric positive semidefinite, and may be given as their diagonals. With
    `joint_stiffness` or `joint_damping` (n x n) springs are fixed to a joint position, otherwise to
    a pose of the tip, with `task_stiffness` K_C and `task_damping` C_C (6 x 6, in the axes of
    `frame`, base or tool). In the motions that the selected `directions` leave free act
    `null_stiffness` and `null_damping` (n each), through the dynamically consistent projector or,
    with a `null_projector` of "kinematic", the projector of the pseudo-inverse, or with "weighted"
    and `null_weights` W (n, positive) I - W^-1 J' (J W^-1 J')^-1 J; with "none" they act in all
    joints, and if tip and null space have a ratio, all springs have the tip's. A damping ratio above
    0 has the damping designed for it; the robot's viscous friction comes on top, and moves the
    ratios. The springs hold an `external_wrench` (6, of the world on the tip, in the base's axes) at
    q; `load` says how it moves with the arm, which adds stiffness: base_wrench, tool_wrench (it turns
    with the tip), joint_torques (its joint torques are constant).

    Raises Error for a posture outside the position limits, gains that the controller would refuse,
    and springs without damping, or with both a matrix and a ratio.
    """
    if load not in LOADS:
        raise Error(f"load: {load!r} is not one of {', '.join(LOADS)}")
    projector = known_projector(null_projector, null_weights)
    kind = 0 if external_wrench is None else 1 + LOADS.index(load)
    at_tip = joint_stiffness is None and joint_damping is None and joint_damping_ratio == 0
    if not at_tip and not (task_stiffness is None and task_damping is None):
        raise Error("joint_stiffness: springs are fixed to a joint position or to a pose, not both")
    posture = _joint_values("q", q)
    check_postures(robot, "q", [posture])
    gains = _core.Gains(robot._core, gains_text(
        joint_stiffness=joint_stiffness, joint_damping=joint_damping,
        joint_damping_ratio=joint_damping_ratio, task_stiffness=task_stiffness,
        task_damping=task_damping, task_damping_ratio=task_damping_ratio, task_frame=frame,
        task_directions=list(directions), null_stiffness=null_stiffness,
        null_damping=null_damping, null_damping_ratio=null_damping_ratio))
    for part, stiffness, damping, ratio in (
            ("joint", joint_stiffness, joint_damping, joint_damping_ratio),
            ("task", task_stiffness, task_damping, task_damping_ratio),
            ("null", null_stiffness, null_damping, null_damping_ratio)):
        one_damping(part, stiffness, damping, ratio)
    for doubt in gains.doubts(robot._core):
        warnings.warn(doubt, stacklevel=2)
    found = _core.closed_loop(robot._core, posture, gains, at_tip,
                              to_vector("external_wrench", external_wrench), kind, soft_frequency,
                              null_projector, projector.get("null_weights"))
    return ClosedLoop(found["mass"], found["damping"], found["stiffness"],
                      make_modes(found["modes"]))
