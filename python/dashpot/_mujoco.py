"""An arm of a MuJoCo model as a URDF, with the properties that a URDF lacks."""

from __future__ import annotations

import dataclasses
import importlib
import os
import warnings
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from ._core import Error
from ._results import Array


@dataclasses.dataclass(frozen=True)
class Arm:
    """What Robot reads."""

    urdf: str
    base: str
    tip: str
    reflected_inertia: list[float]
    gravity: Array
    """In the axes of the file's root link."""


def load(model: Any) -> tuple[Any, str]:
    """Returns an MjModel, given as such or as a path, and its name in messages."""
    if not isinstance(model, (str, os.PathLike)):
        return model, "MjModel"
    path = os.fspath(model)
    try:
        mujoco = importlib.import_module("mujoco")
    except ImportError:
        raise Error(f"{path}: MuJoCo reads it: pip install mujoco") from None
    try:
        read = (mujoco.MjModel.from_binary_path if path.endswith(".mjb")
                else mujoco.MjModel.from_xml_path)
        return read(path), path
    except ValueError as error:
        raise Error(f"{path}: {' '.join(str(error).split())}") from None


def _rotation(quaternion: Any) -> Array:
    """Of w, x, y, z, of any length."""
    w, x, y, z = np.asarray(quaternion, float) / np.linalg.norm(quaternion)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def _pose(position: Any = (0, 0, 0), rotation: Any = None) -> Array:
    pose = np.eye(4)
    pose[:3, 3] = position
    if rotation is not None:
        pose[:3, :3] = rotation
    return pose


def rpy_of(R: Array) -> tuple[float, float, float]:
    """Returns roll, pitch and yaw of a rotation. Yaw is computed first, then pitch, so that their
    product is correct even if yaw and roll turn about one axis."""
    yaw = np.arctan2(R[1, 0], R[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    pitch = np.arctan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    sine = np.sin(pitch) * (c * R[0, 1] + s * R[1, 1]) + np.cos(pitch) * R[2, 1]
    return float(np.arctan2(sine, c * R[1, 1] - s * R[0, 1])), float(pitch), float(yaw)


def _numbers(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)


def _origin(pose: Array) -> str:
    return f'<origin xyz="{_numbers(pose[:3, 3])}" rpy="{_numbers(rpy_of(pose[:3, :3]))}"/>'


class _Writer:
    """Writes the chain from body `base` to body or site `tip`."""

    def __init__(self, model: Any, name: str) -> None:
        self.mujoco: Any = importlib.import_module("mujoco")
        self.model, self.name = model, name
        self.parts: list[str] = []
        self.links: set[str] = set()
        self.joints: list[int] = []

    def fail(self, reason: str) -> Error:
        return Error(f"{self.name}: {reason}")

    def find(self, kind: Any, name: str) -> int:
        return int(self.mujoco.mj_name2id(self.model, kind, name))

    def name_of(self, kind: Any, index: int, word: str) -> str:
        return self.mujoco.mj_id2name(self.model, kind, index) or f"{word}{index}"

    def body_name(self, body: int) -> str:
        return self.name_of(self.mujoco.mjtObj.mjOBJ_BODY, body, "body")

    def link(self, name: str, body: int | None = None) -> str:
        """Adds a link, with the inertia of `body`; returns its unique name."""
        while name in self.links:
            name += "_"
        self.links.add(name)
        inertial = ""
        if body is not None and self.model.body_mass[body] > 0:
            m = self.model
            pose = _pose(m.body_ipos[body], _rotation(m.body_iquat[body]))
            x, y, z = (repr(float(moment)) for moment in m.body_inertia[body])
            inertial = (f"<inertial>{_origin(pose)}"
                        f'<mass value="{float(m.body_mass[body])!r}"/><inertia ixx="{x}" ixy="0" '
                        f'ixz="0" iyy="{y}" iyz="0" izz="{z}"/></inertial>')
        self.parts.append(f"<link name={quoteattr(name)}>{inertial}</link>")
        return name

    def joint(self, name: str, kind: str, parent: str, child: str, pose: Array,
              more: str = "") -> None:
        self.parts.append(f'<joint name={quoteattr(name)} type="{kind}"><parent '
                          f"link={quoteattr(parent)}/><child link={quoteattr(child)}/>"
                          f"{_origin(pose)}{more}</joint>")

    def fixed(self, parent: str, name: str, pose: Array, body: int | None = None) -> str:
        child = self.link(name, body)
        self.joint(f"to {child}", "fixed", parent, child, pose)
        return child

    def body_pose(self, body: int) -> Array:
        """In the parent body, at the model's reference position."""
        return _pose(self.model.body_pos[body], _rotation(self.model.body_quat[body]))

    def effort(self, joint: int) -> float:
        """Torque limit by the joint's actuators and its own limit, N m; 0: no limit."""
        m, most = self.model, 0.0
        gain, bias = int(self.mujoco.mjtGain.mjGAIN_FIXED), int(self.mujoco.mjtBias.mjBIAS_NONE)
        at_joint = int(self.mujoco.mjtTrn.mjTRN_JOINT)
        for a in range(m.nu):
            if m.actuator_trntype[a] != at_joint or (
                    m.actuator_trnid[a, 0] != joint):
                continue
            if m.actuator_forcelimited[a]:
                force = np.abs(m.actuator_forcerange[a]).min()
            elif (m.actuator_ctrllimited[a] and m.actuator_gaintype[a] == gain
                  and m.actuator_biastype[a] == bias):
                force = abs(m.actuator_gainprm[a, 0]) * np.abs(m.actuator_ctrlrange[a]).min()
            else:
                most = np.inf
                break
            most += force * abs(m.actuator_gear[a, 0])
        if m.jnt_actfrclimited[joint]:
            own = float(np.abs(m.jnt_actfrcrange[joint]).min())
            most = own if most == 0 else min(most, own)
        return float(most) if np.isfinite(most) else 0.0

    def moving(self, parent: str, j: int, pose: Array) -> tuple[str, Array]:
        """Adds joint j; returns its link, and the body's pose in this link without later joints."""
        m, mjt = self.model, self.mujoco.mjtJoint
        name = self.name_of(self.mujoco.mjtObj.mjOBJ_JOINT, j, "joint")
        if m.jnt_type[j] not in (int(mjt.mjJNT_HINGE), int(mjt.mjJNT_SLIDE)):
            raise self.fail(f"joint '{name}': ball and free joints are not supported on the chain")
        slides = m.jnt_type[j] == int(mjt.mjJNT_SLIDE)
        anchor, axis = m.jnt_pos[j], m.jnt_axis[j]
        limited = bool(m.jnt_limited[j])
        lower, upper = m.jnt_range[j] if limited else (-1e6, 1e6)
        dof = m.jnt_dofadr[j]
        kind = "prismatic" if slides else "revolute" if limited else "continuous"
        child = self.link(f"link of {name}")
        self.joint(name, kind, parent, child, pose @ _pose(anchor),
                   f'<axis xyz="{_numbers(axis)}"/><limit lower="{float(lower)!r}" '
                   f'upper="{float(upper)!r}" effort="{self.effort(j)!r}" velocity="0"/>'
                   f'<dynamics damping="{float(np.ravel(m.dof_damping[dof])[0])!r}" '
                   f'friction="{float(m.dof_frictionloss[dof])!r}"/>')
        self.joints.append(j)
        reference = m.qpos0[m.jnt_qposadr[j]]  # where the body is as its pose says
        back = (_pose(-reference * axis) if slides else
                _pose(rotation=_rotation([np.cos(reference / 2),
                                          *(-np.sin(reference / 2) * axis)])))
        return child, back @ _pose(-anchor)

    def hang(self, body: int, link: str, but: int) -> None:
        """Adds the branches of a body, rigid at the reference position, except the branch `but`."""
        open_bodies = [(body, link)]
        while open_bodies:
            at, parent = open_bodies.pop()
            for child in map(int, np.flatnonzero(self.model.body_parentid == at)):
                if child not in (0, but):
                    open_bodies.append((child, self.fixed(parent, self.body_name(child),
                                                          self.body_pose(child), child)))

    def warn(self) -> None:
        """Warns of effects on the chain that MuJoCo has and a Robot lacks."""
        m, said = self.model, []
        if np.any(np.asarray(m.jnt_stiffness)[self.joints]):
            said.append("springs of joints (stiffness) are left out")
        joints = int(self.mujoco.mjtEq.mjEQ_JOINT)
        for e in range(m.neq):
            if m.eq_type[e] == joints and m.eq_active0[e] and (
                    {int(m.eq_obj1id[e]), int(m.eq_obj2id[e])} & set(self.joints)):
                said.append("equality constraints of joints are left out")
                break
        if m.ntendon and np.any(m.tendon_armature):
            said.append("the armature of tendons is left out")
        for text in said:
            warnings.warn(f"{self.name}: {text}", stacklevel=4)

    def write(self, base: str, tip: str) -> Arm:
        m, kinds = self.model, self.mujoco.mjtObj
        first, last = self.find(kinds.mjOBJ_BODY, base), self.find(kinds.mjOBJ_BODY, tip)
        site = -1
        if last < 0:
            site = self.find(kinds.mjOBJ_SITE, tip)
            last = int(m.site_bodyid[site]) if site >= 0 else -1
        for what, index, name in (("body", first, base), ("body or site", last, tip)):
            if index < 0:
                raise self.fail(f"there is no {what} '{name}'; its bodies are "
                                f"{', '.join(map(self.body_name, range(m.nbody)))}"[:1000])
        path = []
        at = last
        while at != first:
            if at == 0:
                raise self.fail(f"'{tip}' is not beyond the base, '{base}'")
            path.append(at)
            at = int(m.body_parentid[at])
        path.reverse()

        world = _pose()
        at = first
        while at != 0:
            world = self.body_pose(at) @ world
            at = int(m.body_parentid[at])
        link = self.link(self.body_name(0)) if first == 0 else (
            self.fixed(self.link("world"), base, world))
        for i, body in enumerate(path):
            pose = self.body_pose(body)
            for j in range(m.body_jntadr[body], m.body_jntadr[body] + m.body_jntnum[body]):
                link, pose = self.moving(link, int(j), pose)
            link = self.fixed(link, self.body_name(body), pose, body)
            self.hang(body, link, path[i + 1] if i + 1 < len(path) else -1)
        if site >= 0:
            link = self.fixed(link, tip, _pose(m.site_pos[site], _rotation(m.site_quat[site])))
        self.warn()
        armature = [float(m.dof_armature[m.jnt_dofadr[j]]) for j in self.joints]
        gravity = np.array(m.opt.gravity, float)
        if m.opt.disableflags & int(self.mujoco.mjtDisableBit.mjDSBL_GRAVITY):
            gravity[:] = 0
        root = bytes(m.names).split(b"\0")[0].decode(errors="replace")
        text = "\n".join([f"<robot name={quoteattr(root or 'arm')}>", *self.parts, "</robot>"])
        start = self.body_name(0) if first == 0 else base
        return Arm(text + "\n", start, link, armature, gravity)


def read_arm(model: Any, name: str, base: str, tip: str) -> Arm:
    """Returns the chain from body `base` to body or site `tip` of an MjModel."""
    return _Writer(model, name).write(base, tip)
