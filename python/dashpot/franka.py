"""Drives a Franka Research 3 through libfranka: python -m dashpot.franka CONFIG --robot ADDRESS.

It needs the package pylibfranka, which contains the maker's library. docs/franka.md says how to
begin. `Session` does the same for your own program.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import os
import re
import signal
import statistics
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ._controller import Controller, Ending, Setpoint, Status
from ._core import Error

from ._libfranka import (  # isort: skip
    MODES, Answers, RobotStopped, Wire, advice, check_loop, exceptions, is_realtime, open_files, undisturbed)

WATCH = 0.3  # s of states before the start
FADE = 0.2  # s from a stop to no torque, at least
REPEAT = 100  # ticks from one repetition of a set-point to the next
TIP_TOLERANCE = 0.02  # m between the configuration's tip and the robot's end effector
SILENCE = 1.0  # s without a state, after which the robot is given up
PERIOD_TOLERANCE = 0.2  # of the period

class Session:
    """One loop with a robot. `run` blocks until its end; other threads may call the rest, and
    `controller.set_gains`, `set_payload` and `limit_tip_speed`."""

    def __init__(self, config: str | os.PathLike[str] | Mapping[str, Any], robot: str, *,
                 dry_run: bool = False, urls: Sequence[str] = (), publish: bool = True) -> None:
        """Reads the configuration, a path or a dict. `urls` are the buses and logs to publish on.
        Raises Error for a configuration that does not fit the robot's loop."""
        self.controller = Controller(config)
        self.robot = robot
        self.dry_run = dry_run
        self.running = False  # the loop has begun
        self.answers = Answers()
        self.statuses = [0] * len(Status)
        self.faults = 0
        self.fault = Status.OK  # latched; OK: none
        self.states = self.lost = self.sent = self.waited = 0
        self.period = 0.0
        self.tip_distance = 0.0  # m, from the configuration's tip to the robot's end effector
        self.success_rate = self.least_success_rate = 1.0
        loop = check_loop(self.controller)
        self._ending = Ending(self.controller,
                              max(FADE, float(np.max(loop["torque"] / loop["torque_rate"]))))
        self._urls = tuple(urls)
        self._publish = publish
        self._goal: Any = None  # parts of the active set-point
        self._news = False  # the set-point is new
        self._stop: str | None = None
        self._now = False
        self._lock = threading.Lock()

    def set_setpoint(self, setpoint: Setpoint | None = None, **parts: Any) -> None:
        """Sets where the arm has to go: a Setpoint, or its parts. It stays active until the next one,
        or a fault. Raises Error for an impossible one."""
        wanted = Setpoint(**parts) if setpoint is None else setpoint
        goal = wanted._parts()[:4]
        self.controller._core.check_setpoint(*goal)
        with self._lock:
            self._goal, self._news = goal, True

    def stop(self, why: str = "ended by the user", *, at_once: bool = False) -> None:
        """Ends the loop: the arm stops and the torque fades first, unless `at_once` is true."""
        self._now = self._now or at_once
        self._stop = self._stop or why

    def run(self, duration: float | None = None) -> dict[str, Any]:
        """Drives the robot until `stop`, or for `duration` seconds. Returns the report; its key
        `failure` is the reason if the robot or its state ended the loop, otherwise None."""
        franka = importlib.import_module("pylibfranka")
        before = open_files()
        failure = None
        ended = ""
        wire = None
        try:
            realtime = is_realtime()
            robot = franka.Robot(self.robot, franka.RealtimeConfig.kEnforce if realtime else
                                 franka.RealtimeConfig.kIgnore)
            wire = Wire(before)
            self._watch(robot, wire)
            if self._publish:
                self.controller.publish(*self._urls)
            with undisturbed():
                ended = self._converse(franka, robot, wire, duration)
        except (Error, RobotStopped) as error:
            failure = str(error)
        except exceptions(franka) as error:
            failure = advice(str(error), self.robot)
        finally:
            self.controller.stop_publishing()
            if wire is not None:
                wire.close()
        return self._report(ended or str(failure), failure)

    def _read(self, robot: Any, wire: Wire, control: Any = None) -> Any:
        """Returns the next state; None if there was none for 50 ms."""
        if not wire.wait(0.05):
            return None
        return robot.read_once() if control is None else control.readOnce()[0]

    def _watch(self, robot: Any, wire: Wire) -> None:
        """Watches states for a while; raises Error or RobotStopped if something is wrong."""
        times: list[float] = []
        silent = time.monotonic()
        while not times or times[-1] - times[0] < WATCH:
            state = self._read(robot, wire)
            if state is None:
                if time.monotonic() - silent > SILENCE:
                    raise RobotStopped("the robot sends no states")
                continue
            silent = time.monotonic()
            times.append(state.time.to_sec())
            self.waited += 1
        self.period = statistics.median(b - a for a, b in zip(times, times[1:]))
        if abs(self.period - self.controller.period) > PERIOD_TOLERANCE * self.controller.period:
            raise Error(f"control.period: is {1e3 * self.controller.period:g} ms, but states come "
                        f"every {1e3 * self.period:g} ms")
        if not np.isfinite([state.q, state.dq]).all():
            raise RobotStopped("the robot's positions or velocities are not finite")
        mode = state.robot_mode.name
        if not self.dry_run and mode != "Idle":
            raise RobotStopped(f"the robot is not ready (mode {mode}): " +
                               MODES.get(mode, "see Desk").format(robot=self.robot))
        self.controller.start(state.q)
        place = self.controller._modes_at(state.q, None, {})[2]
        self.tip_distance = float(np.linalg.norm(place - np.array(state.O_T_EE)[12:15]))
        if self.tip_distance > TIP_TOLERANCE:
            print(f"dashpot.franka: the configuration's tip is {1e3 * self.tip_distance:.0f} mm from the "
                  "robot's end effector (O_T_EE): it has another tool, or is another arm",
                  file=sys.stderr, flush=True)

    def _converse(self, franka: Any, robot: Any, wire: Wire, duration: float | None) -> str:
        """Answers states until the end. Returns why it ended."""
        control = None if self.dry_run else robot.start_torque_control()
        torques = franka.Torques([0.0] * 7)
        update = self.controller._core.update
        q, qd = np.zeros(7), np.zeros(7)
        latched = int(Status.FAULT_LATCHED)
        first = last = None  # states, s by the robot
        silent = 0.0
        while True:
            state = self._read(robot, wire, control)
            if state is None:
                silent += 0.05
                if silent > SILENCE:
                    raise RobotStopped(f"no state for {SILENCE:g} s: the robot is off, or the "
                                       "connection is lost")
                if self._stop and (self.dry_run or self._now):
                    return self._stop
                continue
            silent = 0.0
            arrived = wire.arrived()
            now = state.time.to_sec()
            self.states += 1
            if last is None:
                first, self.running = now, True
                print("watching; nothing is commanded" if self.dry_run else
                      "the arm is held where it is", file=sys.stderr, flush=True)
            else:
                self.lost += max(0, round(1e3 * (now - last)) - 1)
            last = now
            if duration is not None and now - float(first or 0) >= duration:
                self.stop("ended after its time")
            q[:], qd[:] = state.q, state.dq
            ns = 1_000_000 * round(1e3 * now)
            if self._stop and not self.dry_run:
                self._ending.begin(ns)
            torque, status = update(ns, q, qd, self._setpoint(ns), None)
            self.statuses[status] += 1
            if status >= latched or self.fault:
                self._note_fault(status)
            if control is None:
                if self._stop:
                    return self._stop
                continue
            if status >= latched and self.controller.needs_brakes():
                self._engage(franka, control, torques, torque.tolist(), status)
            left = 1.0 if not self._stop else 0.0 if self._now else self._ending.left(ns, q)
            torques.motion_finished = left == 0
            torques.tau_J = (left * torque).tolist()
            control.writeOnce(torques)
            self.sent += 1
            self.answers.add(time.time_ns() - arrived)
            self._note_rate(state.control_command_success_rate)
            if torques.motion_finished:
                return str(self._stop)

    def _engage(self, franka: Any, control: Any, torques: Any, values: list[float],
                status: int) -> None:
        """Ends the motion at once, so that the robot holds itself, and raises RobotStopped."""
        reason = f"{Status(status).text}: the motion was ended, look at the robot before the next start"
        torques.tau_J, torques.motion_finished = values, True
        try:
            control.writeOnce(torques)
            self.sent += 1
        except exceptions(franka) as error:
            reason += "; " + advice(str(error), self.robot)
        raise RobotStopped(reason)

    def _note_rate(self, rate: float) -> None:
        self.success_rate = rate
        if rate < self.least_success_rate and self.sent > REPEAT:  # zero before it has counted
            self.least_success_rate = rate

    def _setpoint(self, ns: int) -> Any:
        """The set-point for the tick at `ns`, as the core takes it; None keeps the active one."""
        if self._stop or not self._news and (self._goal is None or self.states % REPEAT):
            return None
        with self._lock:
            self._news = False
            return None if self._goal is None else (*self._goal, ns)

    def _note_fault(self, status: int) -> None:
        if status < Status.FAULT_LATCHED:
            self.fault = Status.OK
            return
        if self.fault == Status.OK:
            self.faults += 1
            with self._lock:
                self._goal, self._news = None, False
        if status > self.fault:  # the worst is reported, not the first
            self.fault = Status(status)
            if not self.dry_run:
                print(f"dashpot.franka: a fault, the arm is damped: {self.fault.text}",
                      file=sys.stderr, flush=True)
        if self.dry_run:  # another program or person moves the arm: not a fault of this loop
            self.controller.release()

    def _report(self, ended: str, failure: str | None) -> dict[str, Any]:
        snapshot = self.controller.snapshot() if self.running else None
        # At the last posture, with the springs: the modes of the last tick belong to the brake.
        found = None if snapshot is None else self.controller.modes_at(snapshot.position)
        return {
            "driver": "libfranka", "robot": self.robot, "dry_run": self.dry_run,
            "running": self.running, "ended": ended, "failure": failure, "period": self.period,
            "tip_distance": self.tip_distance,
            "states": {"received": self.states, "awaited": self.waited, "lost": self.lost},
            "commands_sent": self.sent,
            "success_rate": {"last": self.success_rate, "least": self.least_success_rate},
            "latency": self.answers.summary(), "ticks": sum(self.statuses),
            "restarts": 0 if snapshot is None else snapshot.restarts, "faults": self.faults,
            "fault": None if self.fault == Status.OK else self.fault.text,
            "tick_statuses": {Status(k).text: n for k, n in enumerate(self.statuses) if n},
            "modes": [] if found is None else
            [{"natural_frequency": omega, "damping_ratio": zeta} for omega, zeta in
             zip(found.natural_frequency.tolist(), found.damping_ratio.tolist())]}


def to_table(report: Mapping[str, Any]) -> str:
    """Returns the report as text."""
    lines = [f"libfranka, {report['robot']}" + (", dry run: nothing was commanded"
                                                if report["dry_run"] else ""),
             report["ended"]]
    if not report["running"]:
        return "\n  ".join([*lines, "the loop did not begin"])
    states, took = report["states"], report["latency"]
    lines.append(f"states: {states['received']}; periods without one {states['lost']}; "
                 f"commands sent: {report['commands_sent']}")
    if report["commands_sent"]:
        rate = report["success_rate"]
        lines.append(f"answers in time by the robot's count: {100 * rate['last']:.4g} %, at the least "
                     f"{100 * rate['least']:.4g} %")
        lines.append("from state to answer: " + ", ".join(
            f"{name} {1e6 * took[key]:.0f} us" for name, key in
            (("median", "median"), ("99 %", "p99"), ("99.9 %", "p999"), ("longest", "longest"))))
    lines.append(f"ticks: {report['ticks']}; springs restarted {report['restarts']} times, faults "
                 f"{report['faults']}")
    lines += [f"  {count} x {name}" for name, count in report["tick_statuses"].items()]
    if report["modes"]:
        lines.append("modes, rad/s (ratio): " + " ".join(
            f"{mode['natural_frequency']:.4g} ({mode['damping_ratio']:.3g})"
            for mode in report["modes"]))
    if report["fault"]:
        lines.append(f"fault: {report['fault']}")
    return "\n  ".join(lines)


def _seconds(text: str) -> float:
    match = re.fullmatch(r"([0-9.eE+-]+) ?s?", text)
    try:
        value = float(match.group(1)) if match else math.nan
    except ValueError:
        value = math.nan
    if not 1e-3 <= value <= 1e7:
        raise argparse.ArgumentTypeError("a time from 1e-3 to 1e7 s")
    return value


def main(arguments: Sequence[str] | None = None) -> int:
    """The program. Returns its exit status: 2 for refused input, 1 if the robot stops."""
    parser = argparse.ArgumentParser(
        prog="python -m dashpot.franka", description=str(__doc__).split(":")[0] + ".",
        epilog="Read docs/franka.md first; begin with --dry-run. Ctrl-C ends it: the arm stops and the "
        "torque fades; the second one ends it at once.")
    parser.add_argument("config", metavar="CONFIG", help="configuration file of the controller")
    parser.add_argument("--robot", metavar="ADDRESS", required=True, help="of the robot")
    parser.add_argument("--dry-run", action="store_true",
                        help="computes and publishes everything, and commands nothing")
    parser.add_argument("--lcm-url", metavar="URL", default="", help="bus (default: "
                        "LCM_DEFAULT_URL, or multicast within this machine)")
    parser.add_argument("--log", metavar="FILE", help="LCM log to write")
    parser.add_argument("--duration", metavar="S", type=_seconds, help="ends after this time")
    parser.add_argument("--json", action="store_true", help="ends with JSON instead of a table")
    options = parser.parse_args(arguments)
    urls = [options.lcm_url] + ([f"file://{options.log}?mode=w"] if options.log else [])
    try:
        importlib.import_module("pylibfranka")
    except ImportError as error:
        print(f"dashpot.franka: {error}: pip install pylibfranka", file=sys.stderr)
        return 1
    try:
        session = Session(options.config, options.robot, dry_run=options.dry_run, urls=urls)
    except Error as error:
        print(f"dashpot.franka: {error}", file=sys.stderr)
        return 2
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: session.stop(at_once=session._stop is not None))
    report = session.run(options.duration)
    print(json.dumps({"config": options.config, **report}, indent=2) if options.json else
          to_table(report))
    if report["failure"] is None:
        return 0
    print(f"dashpot.franka: {report['failure']}", file=sys.stderr)
    return 1 if report["running"] else 2


if __name__ == "__main__":
    sys.exit(main())
