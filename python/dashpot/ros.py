"""Shows in ROS 2 what gains do at an arm's posture: python -m dashpot.ros CONFIG.

It needs rclpy and messages, from a distribution or from PyPI. docs/ros.md has topics and parameters.
"""

from __future__ import annotations

import argparse
import importlib
import math
import signal
import statistics
import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from ._controller import Controller, Ending, Status
from ._core import Error

GAINS = ("joint_stiffness", "joint_damping", "joint_damping_ratio", "task_stiffness",
         "task_damping", "task_damping_ratio", "null_stiffness", "null_damping",
         "null_damping_ratio")
RINGS = 0.2  # damping ratio below which a mode rings
ARROW = 0.3  # m, of the marker
WATCHED = 50  # states before the torque begins
PERIOD_TOLERANCE = 0.2  # of the period
FADE = 0.2  # s from a stop to no torque
REPEATS = 30  # of the last torque, which is zero, every 10 ms: a topic may lose one message


class ModesNode:
    """The node `dashpot`: listens to joint states, and publishes the modes at the latest one."""

    def __init__(self, node: Any, config: str, torque_topic: str | None, dry_run: bool) -> None:
        """Raises Error for a refused configuration."""
        messages = {name: importlib.import_module(f"{name}.msg") for name in (
            "std_msgs", "sensor_msgs", "diagnostic_msgs", "visualization_msgs", "geometry_msgs")}
        self.node = node
        self.msg = messages
        self.controller = Controller(config)
        self.loop = self.controller._core.loop()
        self.names = self.controller.joint_names
        self.command = torque_topic is not None
        self.dry_run = dry_run
        self.failure: str | None = None
        self.ended = False
        self.torques = 0  # published
        self.statuses = [0] * len(Status)
        self._order: tuple[tuple[str, ...], list[int]] = ((), [])
        self._q: Any = None
        self._stamps: list[int] = []
        self._started = False
        self._warned = False
        self._ending = Ending(self.controller, FADE)
        self._stop = False
        empty: list[float] = []
        for name in GAINS:
            scalar = name.endswith("ratio")
            node.declare_parameter(name, 0.0 if scalar else empty, _dynamic())
        node.declare_parameter("mode", "cartesian" if self.loop["cartesian"] else "joint")
        node.declare_parameter("rate", 10.0)  # Hz, of analyses
        node.declare_parameter("shape", 1)  # of which mode the marker is, counted from 1
        node.declare_parameter("frame", "")  # of the marker: the base link
        node.add_on_set_parameters_callback(self._judge)
        qos = importlib.import_module("rclpy.qos").qos_profile_sensor_data
        std, diagnostic = messages["std_msgs"], messages["diagnostic_msgs"]
        publisher = node.create_publisher
        self._frequencies = publisher(std.Float64MultiArray, "~/natural_frequency", 10)
        self._ratios = publisher(std.Float64MultiArray, "~/damping_ratio", 10)
        self._margin = publisher(std.Float64, "~/gain_margin", 10)
        self._diagnostics = publisher(diagnostic.DiagnosticArray, "/diagnostics", 10)
        self._shape = publisher(messages["visualization_msgs"].Marker, "~/shape", 10)
        self._torque = publisher(std.Float64MultiArray, torque_topic, 1) if torque_topic else None
        node.create_subscription(messages["sensor_msgs"].JointState, "joint_states", self._take, qos)
        node.create_timer(1 / float(node.get_parameter("rate").value), self._analyze)

    def gains(self, changes: Any = ()) -> dict[str, Any]:
        """Returns the gains set by the parameters and their `changes`."""
        values = {name: self.node.get_parameter(name).value for name in GAINS}
        values.update({one.name: one.value for one in changes if one.name in GAINS})
        found: dict[str, Any] = {}
        for name, value in values.items():
            if isinstance(value, float):
                if value:
                    found[name] = value
            elif value is not None and len(value):
                found[name] = list(value)
        return found

    def stop(self) -> None:
        """Ends the node; the arm stops and the torque fades first, unless this is called again."""
        self.ended = self.ended or self._stop or not self._started
        self._stop = True

    def let_go(self) -> None:
        """Publishes a torque of zero, if torques were commanded, until subscribers have had time for it."""
        if self._torque is None or not self.torques:
            return
        zero = self.msg["std_msgs"].Float64MultiArray(data=[0.0] * len(self.names))
        for _ in range(REPEATS):
            self._torque.publish(zero)
            time.sleep(0.01)

    def _judge(self, changes: Any) -> Any:
        """Refuses gains and modes that the controller refuses."""
        result = importlib.import_module("rcl_interfaces.msg").SetParametersResult
        new = {one.name: one.value for one in changes}
        try:
            if new.get("mode", "joint") not in ("joint", "cartesian"):
                raise Error("mode: joint or cartesian")
            if not new.get("shape", 1) >= 1:
                raise Error("shape: modes are counted from 1")
            if set(new) & set(GAINS):
                gains = self.gains(changes)
                if self.command:  # it runs with them, unless they are refused
                    self.controller.set_gains(**gains)
                elif self._q is not None:
                    self.controller._modes_at(self._q, new.get("mode") or self._mode(), gains)
        except (Error, TypeError) as error:
            return result(successful=False, reason=str(error))
        return result(successful=True)

    def _mode(self) -> str:
        return str(self.node.get_parameter("mode").value)

    def _take(self, state: Any) -> None:
        """Takes a JointState, which may have more joints, in any order."""
        names = tuple(state.name)
        if names != self._order[0]:
            missing = [name for name in self.names if name not in names]
            if missing:
                if not self._warned:
                    self.node.get_logger().warning(f"joint states without {', '.join(missing)}")
                self._warned = True
                return
            self._order = names, [names.index(name) for name in self.names]
        order = self._order[1]
        if len(state.position) < len(names):
            return
        self._q = np.array([state.position[k] for k in order])
        if not self.command:
            return
        if len(state.velocity) < len(names):
            self._fail("joint_states: without velocities nothing can be damped")
            return
        velocity = np.array([state.velocity[k] for k in order])
        self._answer(state.header.stamp.sec * 1_000_000_000 + state.header.stamp.nanosec, velocity)

    def _fail(self, reason: str) -> None:
        self.failure = self.failure or reason
        self.ended = True

    def _answer(self, ns: int, velocity: Any) -> None:
        """One tick with the state of that time, ns."""
        if self.ended:
            return
        if not self._started:
            self._stamps.append(ns)
            if len(self._stamps) < WATCHED:
                return
            period = 1e-9 * statistics.median(
                b - a for a, b in zip(self._stamps, self._stamps[1:]))
            if abs(period - self.controller.period) > PERIOD_TOLERANCE * self.controller.period:
                self._fail(f"control.period: is {1e3 * self.controller.period:g} ms, but joint "
                           f"states come every {1e3 * period:g} ms by their stamps")
                return
            try:
                self.controller.start(self._q)
            except Error as error:
                self._fail(f"gains: {error}")
                return
            self._started = True
        if self._stop and not self.dry_run:
            self._ending.begin(ns)
        torque, status = self.controller.update(ns, self._q, velocity)
        self.statuses[status] += 1
        if self.dry_run:
            if status >= Status.FAULT_LATCHED:  # another program or person moves the arm
                self.controller.release()
            self.ended = self.ended or self._stop
            return
        left = self._ending.left(ns, self._q) if self._stop else 1.0
        if self.controller.needs_brakes() and not (
                status >= Status.STATE_NOT_FINITE and torque.any()):  # the last weight, for 2 s
            # A topic has no brakes: the torque ends.
            self._fail(f"{status.text}: the last torque was zero")
            left = 0.0
        torque = left * torque
        self.ended = left == 0
        assert self._torque is not None
        self._torque.publish(self.msg["std_msgs"].Float64MultiArray(data=torque.tolist()))
        self.torques += 1

    def _analyze(self) -> None:
        """Publishes modes, margin and diagnostics at the latest state."""
        if self._q is None:
            return
        gains, mode = self.gains(), self._mode()
        try:
            modes, jacobian, place = self.controller._modes_at(self._q, mode, gains)
            margin = self.controller.judge_gains(self._q, **gains)
        except (Error, TypeError) as error:
            self._tell(self._status("gains", 2, str(error), {}))
            return
        std = self.msg["std_msgs"]
        self._frequencies.publish(std.Float64MultiArray(data=modes.natural_frequency.tolist()))
        self._ratios.publish(std.Float64MultiArray(data=modes.damping_ratio.tolist()))
        self._margin.publish(std.Float64(data=margin))
        self._tell(*self._verdicts(modes, margin))
        self._mark(modes, jacobian, place)

    def _verdicts(self, modes: Any, margin: float) -> list[Any]:
        enough = float(self.loop["gain_margin"])
        found = {"gain margin": f"{margin:.4g}", "wanted": f"{enough:.4g}"}
        if margin < 1:
            verdicts = [self._status("gains", 2, "the sampled loop is unstable", found)]
        elif margin < enough:
            verdicts = [self._status("gains", 1, "little gain margin", found)]
        else:
            verdicts = [self._status("gains", 0, "the sampled loop keeps its margin", found)]
        rotors = str(self.loop["missing_rotors"])
        if rotors:
            verdicts.append(self._status("rotors", 1, f"the model has no rotors: {rotors}", {}))
        for k, (omega, zeta, kind) in enumerate(
                zip(modes.natural_frequency, modes.damping_ratio, modes.kind)):
            bad = kind == "unstable" or not zeta > 0
            level, text = ((2, "unstable") if bad else
                           (1, "rings") if zeta < RINGS else (0, str(kind)))
            verdicts.append(self._status(f"mode {k + 1}", level, text, {
                "natural frequency, rad/s": f"{omega:.6g}",
                "natural frequency, Hz": f"{omega / math.tau:.6g}",
                "damping ratio": f"{zeta:.6g}"}))
        return verdicts

    def _status(self, name: str, level: int, text: str, values: dict[str, str]) -> Any:
        diagnostic = self.msg["diagnostic_msgs"]
        return diagnostic.DiagnosticStatus(
            level=bytes([level]), name=f"dashpot: {name}", message=text, hardware_id="arm",
            values=[diagnostic.KeyValue(key=key, value=value) for key, value in values.items()])

    def _tell(self, *statuses: Any) -> None:
        array = self.msg["diagnostic_msgs"].DiagnosticArray(status=list(statuses))
        array.header.stamp = self.node.get_clock().now().to_msg()
        self._diagnostics.publish(array)

    def _mark(self, modes: Any, jacobian: Any, place: Any) -> None:
        """An arrow at the tip in the direction in which the mode moves it."""
        index = int(self.node.get_parameter("shape").value) - 1
        if index >= len(modes):
            return
        shape = modes.shapes[index]
        turned = shape * np.exp(-1j * np.angle(shape[np.argmax(np.abs(shape))]))
        way = jacobian[:3] @ turned.real
        length = float(np.linalg.norm(way))
        if not length > 0:
            return
        geometry = self.msg["geometry_msgs"]
        marker = self.msg["visualization_msgs"].Marker(ns="dashpot", id=0, type=0, action=0)
        marker.header.frame_id = str(self.node.get_parameter("frame").value)
        marker.header.stamp = self.node.get_clock().now().to_msg()
        ends = place, place + ARROW * way / length
        marker.points = [geometry.Point(x=float(x), y=float(y), z=float(z)) for x, y, z in ends]
        marker.scale.x, marker.scale.y = 0.01, 0.025
        rings = float(modes.damping_ratio[index]) < RINGS
        marker.color.r, marker.color.g, marker.color.a = (1.0, 0.3, 1.0) if rings else (0.2, 0.7, 1.0)
        marker.text = (f"mode {index + 1}: {modes.natural_frequency[index]:.3g} rad/s, ratio "
                       f"{modes.damping_ratio[index]:.3g}")
        self._shape.publish(marker)


def _dynamic() -> Any:
    """A parameter that may be of any type: an empty list has none."""
    return importlib.import_module("rcl_interfaces.msg").ParameterDescriptor(dynamic_typing=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """The program. Returns its exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m dashpot.ros", description=str(__doc__).split(":")[0] + ".",
        epilog="Names and parameters as with any node: --ros-args -r joint_states:=/arm/joint_states "
        "-p shape:=2")
    parser.add_argument("config", metavar="CONFIG", help="configuration file of the controller")
    parser.add_argument("--torque-topic", metavar="T",
                        help="commands the efforts of a simulator there (std_msgs/Float64MultiArray)")
    parser.add_argument("--dry-run", action="store_true", help="computes efforts, and commands nothing")
    given = list(sys.argv[1:] if arguments is None else arguments)
    begin = given.index("--ros-args") if "--ros-args" in given else len(given)
    options = parser.parse_args(given[:begin])
    try:
        rclpy: Any = importlib.import_module("rclpy")
    except ImportError as error:
        print(f"dashpot.ros: {error}; docs/ros.md says what to install", file=sys.stderr)
        return 1
    handlers = importlib.import_module("rclpy.signals").SignalHandlerOptions
    rclpy.init(args=given[begin:], signal_handler_options=handlers.NO)
    node = rclpy.create_node("dashpot")
    try:
        modes = ModesNode(node, options.config, options.torque_topic, options.dry_run)
    except Error as error:
        print(f"dashpot.ros: {error}", file=sys.stderr)
        node.destroy_node()
        rclpy.shutdown()
        return 2
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: modes.stop())
    while rclpy.ok() and not modes.ended:
        rclpy.spin_once(node, timeout_sec=0.05)
    modes.let_go()
    node.destroy_node()
    rclpy.shutdown()
    for status, count in enumerate(modes.statuses):
        if count:
            print(f"{count} x {Status(status).text}")
    if options.torque_topic:
        print(f"torques commanded: {modes.torques}")
    if modes.failure:
        print(f"dashpot.ros: {modes.failure}", file=sys.stderr)
        return 1 if modes.torques else 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
