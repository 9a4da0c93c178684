"""The controller against the plugin that other hosts load, through ctypes."""

import ctypes
import itertools
import re
import threading

import numpy as np
import pytest

import dashpot
from conftest import HOME, ROOT

STIFFNESS, DAMPING = (600.0, 600, 600, 600, 100, 100, 20), (20.0, 50, 8, 30, 5, 5, 1)
EXAMPLE = ROOT / "controller/examples/panda.yaml"


class Plugin:
    """The C interface, as far as it is needed here."""

    class State(ctypes.Structure):
        _fields_ = [("struct_size", ctypes.c_uint32), ("joints", ctypes.c_uint32),
                    ("time", ctypes.c_int64), ("position", ctypes.c_void_p),
                    ("velocity", ctypes.c_void_p), ("external_wrench", ctypes.c_void_p)]

    class Output(ctypes.Structure):
        _fields_ = [("struct_size", ctypes.c_uint32), ("joints", ctypes.c_uint32),
                    ("torque", ctypes.c_void_p)]

    def __init__(self, path, config):
        self.library = ctypes.CDLL(str(path))
        self.library.dashpot_create.restype = ctypes.c_void_p
        self.arm = ctypes.c_void_p(self.library.dashpot_create(str(config).encode()))
        assert self.arm

    def start(self, q):
        q = np.array(q, dtype=float)
        assert self.library.dashpot_start(self.arm, ctypes.c_void_p(q.ctypes.data), None) == 0

    def update(self, time, q, qd):
        q, qd, torque = np.array(q, dtype=float), np.array(qd, dtype=float), np.zeros(len(q))
        state = self.State(ctypes.sizeof(self.State), len(q), time, q.ctypes.data, qd.ctypes.data,
                           None)
        output = self.Output(ctypes.sizeof(self.Output), len(q), torque.ctypes.data)
        status = self.library.dashpot_update(self.arm, ctypes.byref(state), None,
                                             ctypes.byref(output))
        return torque, status


def swing(tick):
    """A state of an arm that swings a little."""
    t = tick * 0.001
    return (np.array(HOME) + 0.01 * (1 - np.cos(3 * t)), 0.03 * np.sin(3 * t) * np.ones(7))


def test_ticks_are_those_of_the_plugin(plugin):
    ours, theirs = dashpot.Controller(EXAMPLE), Plugin(plugin, EXAMPLE)
    ours.start(HOME)
    theirs.start(HOME)
    for tick in range(1, 300):
        q, qd = swing(tick)
        torque, status = ours.update(tick * 1_000_000, q, qd)
        expected, code = theirs.update(tick * 1_000_000, q, qd)
        assert status == code
        # The wheel is compiled for older processors, which round elsewhere.
        np.testing.assert_allclose(torque, expected, rtol=1e-8, atol=1e-8)
    found = ours.snapshot()
    assert found.tick == 299 and found.status == status == dashpot.Status.OK
    np.testing.assert_array_equal(found.torque, torque)
    np.testing.assert_array_equal(found.position, q)


def test_statuses_are_those_of_the_header():
    header = (ROOT / "controller/plugin.h").read_text()
    statuses = header[:header.index("NULL_ARGUMENT = ")]
    listed = {name: int(code) for name, code in re.findall(r"  DASHPOT_(\w+) = (\d+),", statuses)}
    assert {status.name: int(status) for status in dashpot.Status} == listed
    assert dashpot.Status.TORQUE_LIMITED.text == "torque, torque rate, power, speed or energy limited"


def test_a_dict_is_as_good_as_a_file(config, panda):
    config["gains"] = {"joint": {"stiffness": np.array(STIFFNESS), "damping": DAMPING}}
    config["motion"] = {"gain_time": 0.001}
    config["robot"]["gravity"] = (0, 0, np.float64(-9.81))
    controller = dashpot.Controller(config)
    assert controller.joints == 7 and controller.period == 0.001
    assert controller.joint_names == panda.joint_names
    controller.start(HOME)
    for tick in range(3):
        torque, status = controller.update(tick * controller.period, HOME, np.zeros(7))
        np.testing.assert_allclose(torque, panda.gravity(HOME), atol=1e-6)
        assert status is dashpot.Status.OK
    modes = controller.modes()
    closed = dashpot.closed_loop(panda, HOME, joint_stiffness=STIFFNESS, joint_damping=DAMPING)
    np.testing.assert_allclose(modes.natural_frequency, closed.modes.natural_frequency, rtol=1e-9)
    np.testing.assert_allclose(modes.damping_ratio, closed.modes.damping_ratio, rtol=1e-9)
    assert modes.shapes.shape == (7, 7) and modes.tick == 3 and "rad/s" in repr(modes)


@pytest.mark.parametrize("change, message", [
    ({"limit": {}}, "limit: unknown key"),
    ({"control": {"period": -1}}, "control.period"),
    ({"control": {"period": "1 kg"}}, "control.period"),
    ({"gains": {"joint": {"stiffness": 1e6, "damping": 1}}}, "gains: .*gain margin"),
    ({"limits": {"torque": float("nan")}}, "limits.torque"),
    ({"limits": {"torque": object()}}, "object is neither"),
    ({"robot": {"urdf": "missing.urdf", "base": "a", "tip": "b"}}, "missing.urdf.*No such file"),
])
def test_bad_configurations_give_the_programs_messages(config, change, message):
    with pytest.raises(dashpot.Error, match=message) as error:
        dashpot.Controller({**config, **change})
    assert "line" not in str(error.value)


def test_a_missing_file_is_named():
    with pytest.raises(dashpot.Error, match="no-such-file.yaml: cannot be opened"):
        dashpot.Controller("no-such-file.yaml")


def test_setpoints_and_gains_are_followed(config):
    controller = dashpot.Controller(config)
    assert controller.snapshot() is None and controller.modes() is None
    controller.start(HOME)
    goal = np.array(HOME) + [0.1, 0, 0, 0, 0, 0, 0]
    controller.set_setpoint(joint_position=goal)
    controller.set_gains(joint_stiffness=STIFFNESS, joint_damping=DAMPING)
    for tick in range(400):
        controller.update(tick * controller.period, *swing(tick))
    found = controller.snapshot()
    assert found.status is dashpot.Status.OK
    assert 0.01 < found.reference_joint_position[0] < 0.11
    controller.reset()
    torque, _ = controller.update(1.0, HOME, np.zeros(7), dashpot.Setpoint(joint_position=goal))
    assert controller.snapshot().tick == 1
    assert 0 < controller.judge_gains(HOME, joint_stiffness=STIFFNESS) <= 2


def test_poses_are_goals_too(config, panda):
    config["control"] = {"mode": "cartesian"}
    controller = dashpot.Controller(config)
    controller.start(HOME)
    goal = panda.pose(HOME)
    goal[0, 3] += 0.05
    for tick in range(200):
        setpoint = dashpot.Setpoint(tip_pose=goal, time=tick * 0.001)
        torque, status = controller.update(tick * 0.001, HOME, np.zeros(7), setpoint)
        assert status is dashpot.Status.OK
    found = controller.snapshot()
    assert found.mode == "cartesian" and found.tip_error[0] > 0.001
    np.testing.assert_allclose(found.tip_pose, panda.pose(HOME), atol=1e-12)


def test_what_is_not_possible_is_refused_or_gives_a_status(config):
    controller = dashpot.Controller(config)
    for bad, message in [(dict(joint_stiffness=[-1] * 7), "joint_stiffness"),
                         (dict(joint_stiffness=np.eye(3)), "is 3 x 3, expected 7 x 7"),
                         (dict(joint_stiffness=[1e7] * 7, joint_damping=[1] * 7), "gain margin")]:
        with pytest.raises(dashpot.Error, match=message):
            controller.set_gains(**bad)
    for bad, message in [(dict(joint_position=[9] * 7), "joint_position"),
                         (dict(joint_position=[0, 0]), "is 2 x 1, expected 7 x 1"),
                         (dict(tip_pose=np.zeros((4, 4))), "rotation"),
                         (dict(joint_position=HOME, mode="fly"), "mode: 'fly'")]:
        with pytest.raises(dashpot.Error, match=message):
            controller.set_setpoint(**bad)
    with pytest.raises(TypeError):
        controller.set_gains(stiffness=1)
    with pytest.raises(dashpot.Error, match="time"):
        controller.update(float("nan"), HOME, np.zeros(7))
    controller.update(0.0, HOME, np.zeros(7))
    for q, status in [(np.full(7, np.nan), "STATE_NOT_FINITE"), (np.zeros(3), "STATE_WRONG_SIZE")]:
        torque, found = controller.update(0.001, q, np.zeros(7))
        assert found is dashpot.Status[status] and torque.shape == (7,) and np.isfinite(torque).all()


def test_gains_that_are_taken_though_their_margin_is_small_are_warned_of(config):
    controller = dashpot.Controller(config)
    folded = [0, -0.2, 0, -2.9, 0, 2.9, 0.785]  # where the achievable ratio is lower

    def gains(damping):
        return dict(joint_stiffness=[300] * 7, joint_damping=[damping, 1, 1, 1, 1, 1, 1])

    low, high = 10.0, 1e4
    while high > 1.001 * low:
        middle = np.sqrt(low * high)
        if controller.judge_gains(HOME, **gains(middle)) >= 2:
            low = middle
        else:
            high = middle
    controller.update(0.0, HOME, np.zeros(7))
    controller.set_gains(**gains(low))
    for tick in range(1, 100):
        controller.update(0.001 * tick, folded, np.zeros(7))
    with pytest.raises(dashpot.Error, match="gain margin"):
        controller.set_gains(**gains(1.02 * low))
    with pytest.warns(UserWarning, match="asks for 2; taken because it was") as warned:
        controller.set_gains(**gains(0.98 * low))
        controller.set_payload(0.5, [0.3, 0, 0.05], np.diag([0.001] * 3))
    assert [one.filename for one in warned] == [__file__] * 2


def test_a_payload_comes_with_its_gains(config):
    soft = {"joint_stiffness": np.array(STIFFNESS) / 4}
    frequencies = []
    for together, after in [(None, None), (soft, None), (None, soft)]:
        controller = dashpot.Controller(config)
        controller.start(HOME)
        with pytest.raises(dashpot.Error, match="gain margin"):
            controller.set_payload(1.5, gains={"joint_stiffness": [1e7] * 7})
        with pytest.raises(TypeError, match="unknown gain 'stiffness'"):
            controller.set_payload(1.5, gains={"stiffness": 1})
        controller.set_payload(1.5, gains=together)
        if after is not None:
            controller.set_gains(**after)
        for tick in itertools.count():  # until a thread that helps with modes has its turn
            controller.update(tick * 0.001, HOME, np.zeros(7))
            modes = controller.modes()
            if modes.tick > 700 and modes.natural_frequency.size:
                break
        assert controller.snapshot().payload_mass == pytest.approx(1.5)
        frequencies.append(modes.natural_frequency)
    stiff, with_gains, and_then_gains = frequencies
    np.testing.assert_allclose(with_gains, and_then_gains, rtol=1e-9)
    assert abs(with_gains[0] / stiff[0] - 1) > 0.1


def test_payload_and_speed_can_be_told_in_the_loop(config):
    controller = dashpot.Controller(config)
    controller.start(HOME)
    for bad, message in [(dict(mass=-1), "mass is negative"),
                         (dict(mass=1, inertia=np.diag([1, 0, 0])), "triangle"),
                         (dict(mass=100), "limits.torque"),
                         (dict(mass=1, center=[0, 0]), "center"),
                         (dict(mass=1, tool=np.zeros((4, 4))), "tool")]:
        with pytest.raises(dashpot.Error, match=message):
            controller.set_payload(**bad)
    with pytest.raises(dashpot.Error, match="motion.linear_velocity 9"):
        controller.limit_tip_speed(linear=9)
    controller.limit_tip_speed(linear=0.1, limit=0.5)
    tool = np.eye(4)
    tool[2, 3] = 0.1
    controller.update(0.0, HOME, np.zeros(7))
    controller.set_payload(1.5, [0, 0, 0.05], np.diag([0.002, 0.002, 0.001]), tool=tool)
    for tick in range(1, 700):
        controller.update(tick * 0.001, HOME, np.zeros(7))
    found = controller.snapshot()
    assert found.payload_mass == pytest.approx(1.5)
    np.testing.assert_allclose(found.payload_center, [0, 0, 0.05], atol=1e-12)
    np.testing.assert_allclose(found.payload_inertia, np.diag([0.002, 0.002, 0.001]), atol=1e-12)
    np.testing.assert_allclose(found.tool, tool, atol=1e-12)


def test_faults_latch_until_they_are_released(config):
    controller = dashpot.Controller(config)
    controller.start(HOME)
    for tick in range(3):
        controller.update(tick * 0.001, HOME, np.zeros(7))
    _, status = controller.update(1.0, HOME, np.zeros(7))
    assert status is dashpot.Status.TIME_GAP and controller.snapshot().fault is status
    _, status = controller.update(1.001, HOME, np.zeros(7))
    assert status is dashpot.Status.FAULT_LATCHED
    controller.release()
    _, status = controller.update(1.002, HOME, np.zeros(7))
    assert status in (dashpot.Status.OK, dashpot.Status.TORQUE_LIMITED)


def test_the_sampled_loop_is_analysed_beside(config):
    config["analysis"] = {"sampled": {"interval": "2 ms"}}
    controller = dashpot.Controller(config)
    controller.start(HOME)
    waiting = threading.Event()
    for tick in range(2000):
        controller.update(tick * 0.001, *swing(tick))
        waiting.wait(0.001)
        found = controller.sampled_modes()
        if found is not None:
            break
    assert found.spectral_radius < 1 and len(found.natural_frequency) == 7
    np.testing.assert_allclose(found.continuous_frequency, controller.modes().natural_frequency,
                               rtol=1e-2)


def test_gains_may_come_from_another_thread(config):
    controller = dashpot.Controller(config)
    controller.start(HOME)
    stop, problems = threading.Event(), []

    def change():
        stiffness = 0
        while not stop.is_set():
            stiffness = (stiffness + 1) % 100
            try:
                controller.set_gains(joint_stiffness=np.add(STIFFNESS, stiffness / 10),
                                     joint_damping=DAMPING)
                controller.set_setpoint(joint_position=HOME)
                controller.modes()
                controller.snapshot()
            except Exception as error:  # noqa: BLE001
                problems.append(error)

    thread = threading.Thread(target=change)
    thread.start()
    try:
        for tick in range(3000):  # faster than a real loop, so that set-points may come late
            torque, status = controller.update(tick * 0.001, *swing(tick))
            assert np.isfinite(torque).all() and status <= dashpot.Status.SETPOINT_LOST, status
    finally:
        stop.set()
        thread.join()
    assert not problems


def test_publishes_each_tick_on_every_bus(config, tmp_path):
    controller = dashpot.Controller(config)
    controller.start(HOME)
    logs = tmp_path / "a.lcm", tmp_path / "b.lcm"
    controller.publish(*(f"file://{log}?mode=w" for log in logs))
    with pytest.raises(dashpot.Error, match="read by the publisher"):
        controller.modes()
    for tick in range(50):
        controller.update(tick * controller.period, HOME, [0] * 7)
    controller.stop_publishing()
    assert controller.modes() is not None
    for log in logs:
        states = dashpot.read_log(log)["DASHPOT_STATE"]
        assert states["tick"][-1] == 50
        np.testing.assert_array_equal(states["joint_position"][-1], HOME)
    with pytest.raises(dashpot.Error, match="nowhere"):
        controller.publish("nowhere")


def test_modes_at_a_posture_are_those_of_the_loop(config, panda):
    controller = dashpot.Controller(config)
    gains = {"joint_stiffness": [300] * 7, "joint_damping_ratio": 0.4}
    found = controller.modes_at(HOME, "joint", **gains)
    expected = dashpot.closed_loop(panda, HOME, **gains).modes
    np.testing.assert_allclose(found.natural_frequency, expected.natural_frequency, rtol=1e-9)
    np.testing.assert_allclose(found.damping_ratio, expected.damping_ratio, rtol=1e-9)
    assert len(controller.modes_at(HOME)) == 7 and found.shapes.shape == (7, 7)
    with pytest.raises(dashpot.Error, match="q: "):
        controller.modes_at([0] * 6)
    for call in (controller.modes_at, controller.start, controller.judge_gains):
        with pytest.raises(dashpot.Error, match="'panda_joint2' at -44.* if these are degrees"):
            call(np.degrees(HOME))
