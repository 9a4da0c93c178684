"""python -m dashpot.franka: its duties with a robot that is made up here, and whole with the maker's
library and an arm of franky-sim behind it, where both are installed."""

import importlib.util
import itertools
import json
import os
import signal
import subprocess
import sys
import threading
import time
import types

import numpy as np
import pytest

import dashpot
from conftest import HOME, ROOT
from dashpot import _libfranka, franka

STIFFNESS, DAMPING = [100] * 4 + [30, 20, 10], [3] * 4 + [1, 1, 0.6]


def settings(**changes):
    """A configuration of an FR3, with sections of which some keys change."""
    config = {"robot": {"urdf": str(ROOT / "sim/models/fr3.urdf"), "base": "fr3_link0",
                        "tip": "fr3_hand_tcp", "drives": "fr3", "viscous_friction": 0.2},
              "control": {"period": 0.001, "mode": "joint"},
              "gains": {"joint": {"stiffness": STIFFNESS, "damping": DAMPING}},
              "limits": {"torque": [40] * 4 + [10] * 3, "torque_rate": 500},
              "feed_forward": {"gravity": False},
              "analysis": {"sampled": {"interval": 0.1, "delay": 1}}}
    for section, keys in changes.items():
        config[section] = {**config[section], **keys}
    return config


class State:
    """A state from pylibfranka of a robot that stands still."""

    END = np.array(dashpot.Robot.from_urdf(ROOT / "sim/models/fr3.urdf", "fr3_link0",
                                           "fr3_hand_tcp").pose(HOME))

    def __init__(self, tick, mode="Idle", q=HOME, dq=(0.0,) * 7):
        self.q, self.dq = [x + 1e-9 * (tick % 7) for x in q], list(dq)  # no frozen feedback
        self.time = types.SimpleNamespace(to_sec=lambda: 1e-3 * tick)
        self.robot_mode = types.SimpleNamespace(name=mode)
        self.control_command_success_rate = 0.98
        self.O_T_EE = State.END.T.ravel().tolist()


class MadeUpRobot:
    """pylibfranka with a robot that sends a state whenever one is read. After `events` ticks of the
    loop it calls what stands there, with itself."""

    class ControlException(Exception):
        pass

    RealtimeConfig = types.SimpleNamespace(kEnforce=0, kIgnore=1)

    def __init__(self, mode="Idle", events=None, step=1):
        self.mode, self.events, self.step = mode, events or {}, step
        self.tick, self.read, self.written, self.finished = 0, 0, [], []
        self.Robot = lambda address, realtime: self
        self.Torques = lambda tau: types.SimpleNamespace(tau_J=tau, motion_finished=False)

    def read_once(self):
        self.tick += self.step
        return State(self.tick, self.mode)

    def start_torque_control(self):
        return self

    def readOnce(self):
        self.read += 1
        self.events.get(self.read, lambda robot: None)(self)
        return self.read_once(), None

    def writeOnce(self, torques):
        self.written.append(list(torques.tau_J))
        self.finished.append(torques.motion_finished)


class MovingRobot(MadeUpRobot):
    """One whose joints follow the torque, with the inertia that they have at HOME. A state that is
    `frozen` stays as it is."""

    ARM = dashpot.Robot.from_urdf(ROOT / "sim/models/fr3.urdf", "fr3_link0", "fr3_hand_tcp",
                                  reflected_inertia=[0.195] * 4 + [0.074] * 3)

    def __init__(self, **options):
        super().__init__(**options)
        self.q, self.dq, self.speeds, self.frozen = np.array(HOME), np.zeros(7), [], None
        self.lost = 0  # states that have no velocity
        self.inertia = np.array(self.ARM.mass(HOME))

    def read_once(self):
        self.tick += self.step
        seen = State(self.tick if self.frozen is None else self.frozen.tick, self.mode, self.q, self.dq)
        seen.tick = self.tick
        if self.frozen is not None:
            seen.q, seen.dq = self.frozen.q, self.frozen.dq
            seen.time = State(self.tick).time
        self.last = seen
        if self.lost:
            self.lost -= 1
            seen.dq = np.full(7, np.nan)
        return seen

    def freeze(self):
        self.frozen = self.last

    def writeOnce(self, torques):
        super().writeOnce(torques)
        self.dq = self.dq + 1e-3 * np.linalg.solve(self.inertia, torques.tau_J)
        self.q = self.q + 1e-3 * self.dq
        self.speeds.append(np.abs(self.dq).max())


@pytest.fixture
def run(monkeypatch):
    def drive(robot, config=None, duration=None, **options):
        monkeypatch.setitem(sys.modules, "pylibfranka", robot)
        session = franka.Session(config or settings(), "10.0.0.1", publish=False, **options)
        robot.session = session
        return session.run(duration)
    return drive


@pytest.mark.parametrize("section, keys, reason", [
    ("feed_forward", {"gravity": True}, "feed_forward.gravity"),
    ("robot", {"gravity": [0, 0, 9.81]}, "robot.gravity: is not along -z of the base"),
    ("robot", {"gravity": [0.6, 0, -9.79]}, "robot.gravity"),
    ("analysis", {"sampled": {"interval": 0.1}}, "analysis.sampled.delay"),
    ("analysis", {"sampled": {"delay": 1, "cutoff": 100.0}}, "analysis.sampled.cutoff"),
    ("control", {"period": 0.002}, "control.period"),
    ("limits", {"torque": [40] * 4 + [10, 20, 10], "beyond_model": True},
     "limits.torque: 20 of joint 6"),
    ("limits", {"torque_rate": 1500}, "limits.torque_rate: 1500 of joint 1")])
def test_another_loop_is_refused(section, keys, reason):
    with pytest.raises(dashpot.Error, match=reason):
        franka.Session(settings(**{section: keys}), "10.0.0.1")


@pytest.mark.parametrize("mode, word", [("UserStopped", "stop button"), ("Guiding", "by hand"),
                                        ("Reflex", "automatic_error_recovery"),
                                        ("Move", "another program")])
def test_a_robot_that_is_not_ready_gets_no_torque(run, mode, word):
    robot = MadeUpRobot(mode)
    report = run(robot)
    assert mode in report["failure"] and word in report["failure"] and not report["running"]
    assert robot.written == []


def test_a_robot_with_another_period_gets_no_torque(run):
    robot = MadeUpRobot(step=2)
    assert "states come every 2 ms" in run(robot)["failure"]
    assert robot.written == []


def test_gains_are_judged_where_the_arm_is_before_the_first_torque(run, monkeypatch):
    asked = []

    def start(self, q, torque=None):
        asked.append(q)
        raise dashpot.Error("gains: too little margin")
    monkeypatch.setattr(dashpot.Controller, "start", start)
    robot = MadeUpRobot()
    report = run(robot)
    np.testing.assert_allclose(asked, [HOME], atol=1e-8)
    assert report["failure"] == "gains: too little margin" and robot.written == []
    monkeypatch.undo()
    stiff = settings(gains={"joint": {"stiffness": STIFFNESS, "damping": [400] * 7}})
    with pytest.raises(dashpot.Error, match="gains"):
        franka.Session(stiff, "10.0.0.1")


def test_a_dry_run_commands_nothing_and_finds_the_modes(run):
    robot = MadeUpRobot("Guiding")
    report = run(robot, duration=0.2, dry_run=True)
    assert report["failure"] is None and report["ended"] == "ended after its time"
    assert robot.written == [] and robot.read == 0 and report["commands_sent"] == 0
    assert report["ticks"] == 201 and len(report["modes"]) == 7


def test_another_end_effector_is_told(run, capfd, monkeypatch):
    assert run(MadeUpRobot(), duration=0.01)["tip_distance"] < 1e-6
    assert "end effector" not in capfd.readouterr().err
    other = State.END.copy()
    other[:3, 3] += [0, 0.03, 0.04]
    monkeypatch.setattr(State, "END", other)
    assert run(MadeUpRobot(), duration=0.01)["tip_distance"] == pytest.approx(0.05, abs=1e-6)
    assert "the configuration's tip is 50 mm from the robot's end effector" in capfd.readouterr().err


def test_in_a_dry_run_faults_do_not_last(run):
    robot = MadeUpRobot("Guiding")
    read_once = robot.read_once

    def with_a_gap():
        robot.tick += 50 * (robot.tick == 500)
        return read_once()
    robot.read_once = with_a_gap
    report = run(robot, duration=0.5, dry_run=True)
    assert report["faults"] == 1 and report["fault"] is None
    assert report["tick_statuses"]["ok"] > 400


def go(robot):
    robot.session.set_setpoint(joint_position=np.array(HOME) + 0.5)


@pytest.mark.parametrize("kind, stops", [(MadeUpRobot, 100), (MovingRobot, 500)])
def test_the_arm_stops_and_the_torque_fades_before_the_end(run, kind, stops):
    """The set-point ends after one second; within `stops` ticks the arm stands, and only then the
    torque fades over 0.2 s."""
    robot = kind(events={500: go})
    report = run(robot, duration=1)
    assert report["failure"] is None and report["success_rate"]["least"] == 0.98
    size = np.abs(robot.written).max(axis=1)
    assert size[0] < 0.6  # the first torque is what the rate allows
    assert size[900] > 0.3
    assert 1201 + 100 <= len(size) <= 1201 + stops
    assert robot.finished == [False] * (len(size) - 1) + [True] and size[-1] == 0
    assert report["tick_statuses"]["set-point lost, damping"] == len(size) - 1000
    if kind is MovingRobot:
        assert robot.speeds[999] > 0.1 and max(robot.speeds[-200:]) < 0.02
        print(f"{robot.speeds[999]:.3f} rad/s, {1e-3 * sum(robot.speeds[1000:]):.4f} rad on")
        assert sum(robot.speeds[1000:]) < 0.1 * 1e3 * robot.speeds[999]


def test_what_moves_on_delays_the_end_by_a_second_at_most(run):
    """Something else drags the arm along, whatever the torque."""
    robot = MovingRobot(events={1000: lambda robot: setattr(robot, "inertia", 1e9 * np.eye(7)),
                                500: go})
    report = run(robot, duration=1)
    assert report["failure"] is None and robot.speeds[-1] > 0.1
    assert len(robot.written) == 1001 + 1000 + 200


@pytest.mark.parametrize("ticks", [5, 1000])
def test_a_state_that_is_lost_ends_the_motion_when_its_fault_latches(run, ticks):
    robot = MovingRobot(events={1000: lambda robot: setattr(robot, "lost", ticks)})
    report = run(robot, duration=1.5)
    if ticks == 5:
        assert report["failure"] is None and report["faults"] <= 1
    else:
        assert report["failure"].startswith("state not finite")
        assert 1010 <= len(robot.finished) <= 1013 and robot.finished[-1]


def test_an_arm_that_needs_its_brakes_ends_the_motion_at_once(run, capfd):
    """The worst status is reported, not the first fault."""
    robot = MovingRobot(events={500: go, 990: lambda robot: setattr(robot, "tick", robot.tick + 30),
                                1000: MovingRobot.freeze})
    report = run(robot)
    assert report["failure"].startswith("state frozen") and report["running"]
    assert report["fault"].startswith("state frozen") and report["faults"] == 1
    counts = report["tick_statuses"]
    assert sum(count for name, count in counts.items() if name.startswith("state frozen")) == 1
    assert robot.finished == [False] * (len(robot.finished) - 1) + [True]
    assert len(robot.finished) < 1100
    told = capfd.readouterr().err
    assert told.index("gap between states") < told.index("state frozen")


@pytest.mark.parametrize("parts, reason", [
    ({"joint_position": [np.nan] * 7}, "joint_position"),
    ({"joint_position": [0.0] * 6}, "joint_position"),
    ({"joint_position": [100.0] * 7}, "joint_position"),
    ({"tip_pose": np.eye(4) * np.nan}, "tip"), ({"tip_pose": 2 * np.eye(4)}, "tip"),
    ({"joint_position": HOME, "wrench": [np.inf] * 6}, "wrench"), ({"mode": "joint"}, "NULL")])
def test_a_set_point_that_is_not_possible_is_refused(parts, reason):
    session = franka.Session(settings(), "10.0.0.1")
    with pytest.raises(ValueError, match=reason):
        session.set_setpoint(**parts)
    session.set_setpoint(joint_position=HOME)


def test_the_set_point_stays_in_force(run):
    """The loop repeats the set-point; otherwise it would be stale after a tenth of a second."""
    def moved(robot):
        robot.session.set_setpoint(joint_position=np.array(HOME) + 0.02)
    report = run(MadeUpRobot(events={10: moved}), duration=1)
    of_setpoints = {name: n for name, n in report["tick_statuses"].items() if "set-point" in name}
    assert of_setpoints == {"set-point lost, damping": report["ticks"] - 1000}, report  # at the end


def test_a_gap_latches_and_the_arm_is_damped(run):
    def gap(robot):
        robot.tick += 50
    robot = MadeUpRobot(events={300: gap})
    report = run(robot, duration=1)
    assert report["faults"] == 1 and report["states"]["lost"] == 50
    assert "gap between states" in report["fault"]
    assert report["tick_statuses"]["fault latched, damping until released"] > 500
    assert np.abs(robot.written[400:]).max() < 1e-4  # at rest there is nothing to hold


def test_a_released_fault_is_over(run):
    """The set-point from before the fault is not taken up again."""
    def moved(robot):
        robot.session.set_setpoint(joint_position=np.array(HOME) + 0.2)

    def gap(robot):
        robot.tick += 50
    robot = MadeUpRobot(events={10: moved, 300: gap,
                                400: lambda robot: robot.session.controller.release()})
    report = run(robot, duration=1)
    assert np.abs(robot.written[250]).max() > 0.1
    assert np.abs(robot.written[700:]).max() < 1e-3
    assert report["faults"] == 1 and report["fault"] is None and report["restarts"] == 2


@pytest.mark.parametrize("reflex", ["communication_constraints_violation",
                                    "controller_torque_discontinuity", "joint_reflex"])
def test_reflexes_are_named_with_what_to_do(run, reflex):
    def fails(robot):
        raise robot.ControlException(f'libfranka: motion aborted by reflex! ["{reflex}"]')
    report = run(MadeUpRobot(events={20: fails}))
    assert report["failure"].count(reflex) == 2 and _libfranka.REFLEXES[reflex] in report["failure"]
    assert "pylibfranka.Robot('10.0.0.1').automatic_error_recovery()" in report["failure"]
    assert report["running"] and report["commands_sent"] == 19


def test_shares_of_answers():
    answers = franka.Answers()
    for us in (*range(1, 100), 20_000):
        answers.add(1000 * us)
    assert answers.share(0.5) == pytest.approx(50e-6)
    assert answers.share(0.99) == pytest.approx(99e-6)
    assert answers.share(1) == pytest.approx(0.01) and answers.longest == 20_000


# With the maker's library and franky-sim.

class Arm:
    """The process of franka_arm.py, and a session with it on a thread."""

    def __init__(self, process, address):
        self.process, self.address = process, address
        self.report = {}

    def tell(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def begin(self, config, log):
        self.session = franka.Session(config, self.address, urls=[f"file://{log}?mode=w"])
        self.thread = threading.Thread(
            target=lambda: self.report.update(self.session.run()), daemon=True)
        self.thread.start()
        self.until(100)

    def until(self, states):
        while self.session.states < states and self.thread.is_alive():
            time.sleep(0.01)

    def pass_by(self, states):
        first = self.session.states
        self.until(first + states)
        return first

    def end(self, stop=True):
        if stop:
            self.session.stop()
        self.thread.join(30)
        assert not self.thread.is_alive()
        return self.report


counter = itertools.count(1)


@pytest.fixture
def arm():
    for name in ("pylibfranka", "franky_sim", "mujoco"):
        if importlib.util.find_spec(name) is None:
            pytest.skip(f"{name} is not installed")
    pid = os.getpid()
    address = f"127.{100 + next(counter)}.{pid // 250 % 250}.{1 + pid % 250}"
    with subprocess.Popen([sys.executable, ROOT / "python/tests/franka_arm.py", address],
                          stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        yield Arm(process, address)
        if process.poll() is None:
            process.kill()


def seen_modes(log, windows):
    """The eigenvalues, 1/s, of the linear map over 20 ticks that fits best what moved freely."""
    stride = 20
    state = log["DASHPOT_STATE"]
    rows = np.hstack([state["joint_position"], state["joint_velocity"]])
    at = {int(tick): row for row, tick in enumerate(state["tick"])}
    pairs = [(at[k], at[k + stride]) for first, last in windows for k in range(first, last - stride)
             if k in at and k + stride in at]
    before, after = np.array(pairs).T
    known = np.hstack([rows[before], np.ones((len(before), 1))])
    step = np.linalg.lstsq(known, rows[after], rcond=None)[0][:14].T
    return np.log(np.linalg.eigvals(step).astype(complex)) / (1e-3 * stride)


def check_modes(log, windows):
    """The sampled modes published last in the windows agree with the arm's motion. The masses in
    franky-sim's model differ: by up to 4 % in the mass matrix."""
    published = log["DASHPOT_SAMPLED_MODES"]
    row = np.flatnonzero(published["tick"] <= windows[-1][1])[-1]
    seen = seen_modes(log, windows)
    for omega, zeta in zip(published["natural_frequency"][row], published["damping_ratio"][row]):
        nearest = seen[np.argmin(abs(seen - omega * (-zeta + 1j * np.sqrt(1 - zeta**2))))]
        print(f"{omega:.3f} rad/s, ratio {zeta:.3f}; the arm {abs(nearest):.3f}, "
              f"{-nearest.real / abs(nearest):.3f}")
        assert abs(nearest) == pytest.approx(omega, rel=0.06)
        assert -nearest.real / abs(nearest) == pytest.approx(zeta, abs=0.04)


def test_modes_are_those_of_the_arm_behind_libfranka(arm, tmp_path):
    """Held, pushed, with other gains pushed again, and ended."""
    arm.begin(settings(), tmp_path / "log.lcm")
    random = np.random.default_rng(1)
    windows = []
    for factor in (1, 1.5):
        free = []
        arm.session.controller.set_gains(joint_stiffness=factor * np.array(STIFFNESS),
                                         joint_damping=DAMPING)
        arm.pass_by(700)  # motion.gain_time
        for _ in range(12):
            push = np.array([15] * 4 + [5] * 3) * random.uniform(-1, 1, 7)
            arm.tell("push 20 " + " ".join(map(str, push)))
            first = arm.pass_by(400)
            free.append((first + 60, first + 390))
        windows.append(free)
    report = arm.end()
    assert report["failure"] is None and report["faults"] == 0 and report["tip_distance"] < 0.001
    assert report["states"]["lost"] == 0 and report["success_rate"]["last"] == 1
    log = dashpot.read_log(tmp_path / "log.lcm")
    frequencies = []
    for free in windows:
        check_modes(log, free)
        rows = log["DASHPOT_MODES"]["tick"] <= free[-1][1]
        frequencies.append(log["DASHPOT_MODES"]["natural_frequency"][rows][-1])
    assert frequencies[1] == pytest.approx(np.sqrt(1.5) * frequencies[0], rel=0.02)


def test_the_tip_moves_where_it_is_told(arm, tmp_path):
    config = settings(control={"mode": "cartesian"},
                      gains={"task": {"stiffness": [500] * 3 + [30] * 3, "damping_ratio": 0.7}})
    arm.begin(config, tmp_path / "log.lcm")
    robot = dashpot.Robot.from_urdf(ROOT / "sim/models/fr3.urdf", "fr3_link0", "fr3_hand_tcp")
    goal = np.array(robot.pose(HOME))
    goal[:3, 3] += [0.03, -0.04, 0.02]
    arm.session.set_setpoint(tip_pose=goal)
    arm.pass_by(4000)
    assert arm.end()["failure"] is None
    state = dashpot.read_log(tmp_path / "log.lcm")["DASHPOT_STATE"]
    steady = np.flatnonzero(state["tick"] <= arm.session.states - 250)[-1]  # the torque fades then
    away = np.linalg.norm(state["tip_position"][steady] - goal[:3, 3])
    print(f"away from the goal by {1e3 * away:.2f} mm")
    assert away < 0.006  # the weights of the two models differ


def test_a_blow_is_a_fault_and_its_release_takes_up_the_springs(arm, tmp_path):
    arm.begin(settings(limits={"velocity": 0.5}), tmp_path / "log.lcm")
    arm.tell("push 50 0 0 0 60 0 0 0")
    arm.pass_by(600)
    assert arm.session.fault == dashpot.Status.VELOCITY_LIMIT
    arm.session.controller.release()
    arm.pass_by(300)
    assert arm.session.fault == dashpot.Status.OK
    report = arm.end()
    assert report["failure"] is None and report["faults"] == 1 and report["restarts"] == 2


@pytest.mark.parametrize("line, words", [
    ("stop", ["UserStopped", "release it"]),
    ("reflex communication_constraints_violation", ["PREEMPT_RT", "automatic_error_recovery"])])
def test_a_robot_that_stops_ends_the_loop_with_a_reason(arm, tmp_path, line, words):
    arm.begin(settings(), tmp_path / "log.lcm")
    arm.tell(line)
    report = arm.end(stop=False)
    assert report["running"] and report["failure"]
    print(report["failure"])
    again = franka.Session(settings(), arm.address, publish=False).run()
    said = report["failure"] + again["failure"]
    print(again["failure"])
    assert not again["running"] and all(word in said for word in words)


def test_a_robot_that_vanishes_ends_the_loop(arm, tmp_path):
    arm.begin(settings(), tmp_path / "log.lcm")
    arm.process.kill()
    report = arm.end(stop=False)
    print(report["failure"])
    assert report["running"] and ("no state for 1 s" in report["failure"]
                                  or "libfranka" in report["failure"])


def test_the_program_ends_with_ctrl_c(arm, tmp_path):
    command = [sys.executable, "-m", "dashpot.franka", ROOT / "controller/examples/fr3_franka.yaml",
               "--robot", arm.address, "--json", "--lcm-url", f"file://{tmp_path}/bus.lcm?mode=w",
               "--log", tmp_path / "log.lcm"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True) as process:
        assert process.stderr.readline() == "the arm is held where it is\n"
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=1200)
        assert process.returncode == 0, err
    report = json.loads(out)
    assert report["ended"] == "ended by the user" and report["commands_sent"] >= 200
    states = [dashpot.read_log(tmp_path / name)["DASHPOT_STATE"] for name in ("bus.lcm", "log.lcm")]
    assert states[0]["tick"][-1] == states[1]["tick"][-1] == report["ticks"]


def test_the_program_says_what_is_missing():
    """The example's configuration fits; without a robot nothing begins."""
    done = subprocess.run([sys.executable, "-m", "dashpot.franka",
                           ROOT / "controller/examples/fr3_franka.yaml", "--robot", "127.0.0.1",
                           "--json"], capture_output=True, text=True, timeout=1200)
    if importlib.util.find_spec("pylibfranka") is None:
        assert done.returncode == 1 and "pip install pylibfranka" in done.stderr
        return
    assert done.returncode == 2 and "dashpot.franka: " in done.stderr
    assert json.loads(done.stdout)["running"] is False
