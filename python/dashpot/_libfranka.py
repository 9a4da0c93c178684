"""libfranka's side of dashpot.franka: its errors, its limits, its socket, and how soon it is answered."""

from __future__ import annotations

import contextlib
import fcntl
import gc
import math
import os
import select
import socket
import struct
import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from ._controller import Controller
from ._core import Error

TORQUE_RATE = 1000.0  # N m/s, the robot's limit
UPRIGHT = 0.9998  # cosine of the largest angle of an upright base, 1 degree
TORQUE = (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0)  # N m, the robot's limits
LONGEST = 10_000  # us; slower answers count as this

RECOVER = ("then python -c \"import pylibfranka; "
           "pylibfranka.Robot('{robot}').automatic_error_recovery()\"")
# What ends a motion of the robot, as libfranka calls it, and what to do about it.
REFLEXES = {
    "communication_constraints_violation":
        "too many answers came late: nothing else on this computer, a kernel with PREEMPT_RT, a cable "
        "of its own to the robot",
    "controller_torque_discontinuity":
        "the torque changed faster than 1000 N m/s: a lower limits.torque_rate, and answers in time",
    "joint_reflex": "a joint met more than the robot's collision thresholds: clear the arm",
    "cartesian_reflex": "the tip met more than the robot's collision thresholds: clear the arm",
    "joint_velocity_violation": "a joint was too fast where it is: lower limits.velocity",
    "cartesian_velocity_violation": "the tip was too fast: lower limits.tip_velocity",
    "joint_position_limits_violation":
        "a joint is at its end: move it back in Desk, and narrow limits.position_lower, _upper",
    "power_limit_violation": "the motion needs too much power: lower limits.velocity or torque",
    "tau_j_range_violation": "the torque sensors are at their end: take load off the arm",
    "instability_detected": "the robot saw itself vibrate: less damping or stiffness, see the margin",
    "self_collision_avoidance_violation": "the arm is too near itself: move it by hand",
    "force_control_safety_violation": "external torque and model disagree: set the load in Desk",
}
MODES = {"UserStopped": "the stop button is pressed: release it",
         "Reflex": "it has stopped by a reflex: clear the cause, " + RECOVER,
         "Guiding": "it is guided by hand: leave the guiding mode",
         "AutomaticErrorRecovery": "it recovers: wait",
         "Move": "another program moves it: end that program",
         "Other": "open the brakes and switch FCI on, in Desk"}


class RobotStopped(RuntimeError):
    """The robot ended the loop, or vanished. The message names why and what to do."""


def advice(text: str, robot: str) -> str:
    """Returns what libfranka says, and what to do about the reflexes that it names."""
    known = [f"{name}: {what}" for name, what in REFLEXES.items() if name in text]
    if known:
        known.append(RECOVER.format(robot=robot))
    return "; ".join([" ".join(text.split()), *known])


def check_loop(controller: Controller) -> dict[str, Any]:
    """Returns the controller's data of its loop; raises Error unless they fit libfranka's loop."""
    loop = controller._core.loop()
    if controller.joints != 7:
        raise Error(f"robot: has {controller.joints} joints from base to tip, the robot 7")
    if loop["gravity"]:
        raise Error("feed_forward.gravity: must be false: the robot compensates gravity, which would "
                    "act twice")
    if loop["base_gravity"][2] > -UPRIGHT * np.linalg.norm(loop["base_gravity"]):
        raise Error("robot.gravity: is not along -z of the base: the robot compensates gravity for "
                    "an upright base, so that an arm on a wall or a ceiling would pull by the "
                    "difference")
    if loop["delay"] < 1:
        raise Error("analysis.sampled.delay: must be at least 1: a torque acts a period after its "
                    "state at the soonest")
    if loop["cutoff"] > 0:
        raise Error("analysis.sampled.cutoff: must be left out: torques that are written one by one "
                    "go through no low-pass of libfranka's")
    if abs(controller.period - 0.001) > 1e-9:
        raise Error("control.period: must be 1 ms, the robot's")
    for key, most in (("torque", TORQUE), ("torque_rate", (TORQUE_RATE,) * 7)):
        over = np.flatnonzero(loop[key] > np.array(most))
        if len(over):
            joint = int(over[0])
            raise Error(f"limits.{key}: {loop[key][joint]:g} of joint {joint + 1} is more than the "
                        f"{most[joint]:g} that the robot allows")
    return dict(loop)


class Answers:
    """Times of answers, us, from the arrival of a state until the torque is written."""

    def __init__(self) -> None:
        self.counts = [0] * (LONGEST + 1)
        self.total = 0
        self.longest = 0

    def add(self, ns: int) -> None:
        us = ns // 1000
        self.total += 1
        self.counts[0 if us < 0 else min(us, LONGEST)] += 1
        if us > self.longest:
            self.longest = us

    def share(self, share: float) -> float:
        """Returns the time in s within which this share of the answers came; 0 without any."""
        wanted, count = math.ceil(share * self.total), 0
        for us, more in enumerate(self.counts):
            count += more
            if count >= wanted:
                return 1e-6 * us
        return 0.0

    def summary(self) -> dict[str, float]:
        return {"median": self.share(0.5), "p99": self.share(0.99), "p999": self.share(0.999),
                "longest": 1e-6 * self.longest}


class Wire:
    """The socket on which libfranka receives states, found among the files that the connection has
    opened. The loop waits on it here, because pylibfranka waits with the interpreter's lock."""

    STAMP = 0x8907  # SIOCGSTAMPNS: when the kernel got what was read last

    def __init__(self, before: set[str]) -> None:
        self._poll = select.poll()
        self._socket: socket.socket | None = None
        for name in open_files() - before:
            with contextlib.suppress(OSError):
                heard = socket.socket(fileno=os.dup(int(name)))
                if heard.type == socket.SOCK_DGRAM:
                    self._socket = heard
                    self._poll.register(heard, select.POLLIN)
                else:
                    heard.close()

    def wait(self, seconds: float) -> bool:
        """Waits for a state; True if there is one, or if the socket is unknown."""
        return self._socket is None or bool(self._poll.poll(1000 * seconds))

    def arrived(self) -> int:
        """Returns when the state that was read last arrived, ns since 1970-01-01 UTC."""
        if self._socket is not None:
            with contextlib.suppress(OSError):
                stamp = fcntl.ioctl(self._socket, self.STAMP, bytes(16))
                seconds, ns = struct.unpack("ll", stamp)
                return int(seconds * 1_000_000_000 + ns)
        return time.time_ns()

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()


def open_files() -> set[str]:
    try:
        return set(os.listdir("/proc/self/fd"))
    except OSError:
        return set()


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Turns garbage collection off, and gives this thread priority if the system allows it."""
    interval = sys.getswitchinterval()
    collecting = gc.isenabled()
    gc.collect()
    gc.disable()
    sys.setswitchinterval(1e-4)
    policy = None
    with contextlib.suppress(OSError, AttributeError):
        policy = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(60))
    try:
        yield
    finally:
        if policy is not None:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(0, *policy)
        sys.setswitchinterval(interval)
        if collecting:
            gc.enable()


def exceptions(franka: Any) -> tuple[type[BaseException], ...]:
    """Returns what libfranka throws; pylibfranka has no common base for it."""
    found = (getattr(franka, name) for name in dir(franka) if name.endswith("Exception"))
    return tuple(one for one in found if isinstance(one, type) and issubclass(one, BaseException))


def is_realtime() -> bool:
    """True if the kernel has PREEMPT_RT, which libfranka then requires."""
    try:
        with open("/sys/kernel/realtime", encoding="ascii") as file:
            return file.read(1) == "1"
    except OSError:
        return False
