"""python -m dashpot.ros with rclpy, in processes of their own. Skipped without it."""

import contextlib
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import dashpot
from conftest import HOME, ROOT

for name in ("rclpy", "sensor_msgs.msg", "diagnostic_msgs.msg", "visualization_msgs.msg"):
    pytest.importorskip(name, reason="ROS 2 is not installed", exc_type=ImportError)
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from visualization_msgs.msg import Marker

CONFIG = ROOT / "controller/examples/panda.yaml"
NAMES = [f"panda_joint{k}" for k in range(1, 8)]
GAINS = {"joint_stiffness": [600, 600, 600, 600, 100, 100, 20], "joint_damping_ratio": 0.5}
DOMAIN = str(1 + os.getpid() % 100)  # other tests, and other people, are on other domains


class Peer:
    """A node that sends joint states and hears what the other one publishes."""

    def __init__(self):
        rclpy.init(domain_id=int(DOMAIN))
        self.node = rclpy.create_node("peer")
        self.states = self.node.create_publisher(JointState, "/joint_states", 10)
        self.heard = {}
        self.torques = []
        for topic, kind in (("/dashpot/natural_frequency", Float64MultiArray),
                            ("/dashpot/damping_ratio", Float64MultiArray),
                            ("/dashpot/gain_margin", Float64), ("/diagnostics", DiagnosticArray),
                            ("/dashpot/shape", Marker)):
            self.node.create_subscription(kind, topic, self.note(topic), 10)
        self.node.create_subscription(Float64MultiArray, "/effort", self.torques.append,
                                      qos_profile_sensor_data)

    def note(self, topic):
        return lambda message: self.heard.__setitem__(topic, message)

    def send(self, q, qd=(0.0,) * 7, time_ns=0):
        message = JointState(name=["finger", *reversed(NAMES)])
        message.position = [0.04, *map(float, reversed(q))]
        message.velocity = [0.0, *map(float, reversed(qd))]
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time_ns, 1_000_000_000)
        self.states.publish(message)

    def until(self, there, q=HOME, seconds=60):
        """Sends the same state until something is there."""
        end = time.monotonic() + seconds
        while not there():
            assert time.monotonic() < end, self.heard.keys()
            self.send(q)
            rclpy.spin_once(self.node, timeout_sec=0.02)

    def set(self, **values):
        client = self.node.create_client(SetParameters, "/dashpot/set_parameters")
        assert client.wait_for_service(timeout_sec=60)
        request = SetParameters.Request()
        for name, value in values.items():
            kind = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value) \
                if isinstance(value, float) else ParameterValue(
                    type=ParameterType.PARAMETER_DOUBLE_ARRAY, double_array_value=value)
            request.parameters.append(Parameter(name=name, value=kind))
        future = client.call_async(request)
        rclpy.spin_until_future_complete(self.node, future, timeout_sec=60)
        return future.result().results


@pytest.fixture
def peer():
    one = Peer()
    yield one
    one.node.destroy_node()
    rclpy.shutdown()


@contextlib.contextmanager
def start(*arguments):
    process = subprocess.Popen([sys.executable, "-m", "dashpot.ros", *map(str, arguments)],
                               env={**os.environ, "ROS_DOMAIN_ID": DOMAIN},
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def end(process, status=0):
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=1200)
    assert process.returncode == status, out + err
    return out


def test_modes_of_the_posture_are_published(peer):
    controller = dashpot.Controller(CONFIG)
    with start(CONFIG, "--ros-args", "-p", "frame:=panda_link0") as process:
        peer.until(lambda: len(peer.heard) >= 5)
        expected = controller.modes_at(HOME)
        np.testing.assert_allclose(peer.heard["/dashpot/natural_frequency"].data,
                                   expected.natural_frequency, rtol=1e-12)
        np.testing.assert_allclose(peer.heard["/dashpot/damping_ratio"].data,
                                   expected.damping_ratio, rtol=1e-12)
        assert peer.heard["/dashpot/gain_margin"].data == pytest.approx(
            controller.judge_gains(HOME))
        statuses = {one.name: one for one in peer.heard["/diagnostics"].status}
        assert "no rotors" in statuses["dashpot: rotors"].message
        assert statuses["dashpot: rotors"].level == b"\1"
        mode = {value.key: value.value for value in statuses["dashpot: mode 1"].values}
        assert float(mode["damping ratio"]) == pytest.approx(expected.damping_ratio[0], rel=1e-5)
        marker = peer.heard["/dashpot/shape"]
        assert marker.header.frame_id == "panda_link0" and marker.text.startswith("mode 1: ")
        tip = dashpot.Robot.from_urdf(ROOT / "sim/models/panda.urdf", "panda_link0",
                                      "panda_hand_tcp").pose(HOME)[:3, 3]
        first, last = (np.array([p.x, p.y, p.z]) for p in marker.points)
        np.testing.assert_allclose(first, tip, atol=1e-9)
        assert np.linalg.norm(last - first) == pytest.approx(0.3)
        end(process)


def test_gains_are_parameters(peer):
    controller = dashpot.Controller(CONFIG)
    with start(CONFIG, "--ros-args", "-p", "mode:=joint") as process:
        peer.until(lambda: "/dashpot/natural_frequency" in peer.heard)
        results = peer.set(joint_stiffness=[float(k) for k in GAINS["joint_stiffness"]],
                           joint_damping_ratio=0.5)
        assert all(one.successful for one in results), results
        expected = controller.modes_at(HOME, "joint", **GAINS)

        def changed():
            found = peer.heard["/dashpot/damping_ratio"].data
            return len(found) == 7 and np.allclose(found, expected.damping_ratio, rtol=1e-9)
        peer.until(changed)
        refused = peer.set(joint_stiffness=[1.0, 2.0])[0]
        assert not refused.successful and "joint_stiffness" in refused.reason
        end(process)


def ends_without_torque(peer):
    """Whether the last torques are zero: more than one, as the last message of a node may be lost."""
    for _ in range(50):
        rclpy.spin_once(peer.node, timeout_sec=0.01)
    return not np.any([torque.data for torque in peer.torques[-2:]])


@pytest.mark.parametrize("interrupts", [1, 2])
def test_it_commands_efforts_and_lets_them_fade(peer, tmp_path, interrupts):
    """A made-up arm that stands still: its weight is commanded, then less and less, then nothing."""
    config = tmp_path / "config.yaml"
    config.write_text(f"""
robot: {{urdf: {ROOT}/sim/models/panda.urdf, base: panda_link0, tip: panda_hand_tcp}}
control: {{period: 10 ms}}
gains: {{joint: {{stiffness: 20, damping_ratio: 0.7}}}}
""")
    with start(config, "--torque-topic", "/effort") as process:
        for k in range(6000):
            peer.send(np.array(HOME) + 1e-9 * (k % 7), time_ns=k * 10_000_000)
            rclpy.spin_once(peer.node, timeout_sec=0.01)
            if peer.torques and k % 50 == 0:
                break
        weight = dashpot.Robot.from_urdf(ROOT / "sim/models/panda.urdf", "panda_link0",
                                         "panda_hand_tcp").gravity(HOME)
        np.testing.assert_allclose(peer.torques[-1].data, weight, atol=1e-3)
        for _ in range(interrupts):  # the second one leaves out the fading
            process.send_signal(signal.SIGINT)
            time.sleep(0.2)
        limit = time.monotonic() + 60
        while process.poll() is None and time.monotonic() < limit:
            k += 1
            peer.send(np.array(HOME) + 1e-9 * (k % 7), time_ns=k * 10_000_000)
            rclpy.spin_once(peer.node, timeout_sec=0.01)
        process.kill()  # if it has not ended by itself
        assert ends_without_torque(peer)
        assert process.returncode == 0
        assert "torques commanded: " in process.stdout.read()


@pytest.mark.parametrize("velocity, status", [(0.1, "state frozen"), (np.nan, "state not finite")])
def test_an_arm_that_needs_its_brakes_ends_it(peer, velocity, status):
    """Joint states that do not change, though the arm is said to move; and lost velocities."""
    with start(CONFIG, "--torque-topic", "/effort") as process:
        k, limit = 0, time.monotonic() + 60
        while process.poll() is None and time.monotonic() < limit:
            k += 1
            moves = bool(peer.torques)
            q = np.array(HOME) + (0 if moves else 1e-9 * (k % 7))
            peer.send(q, [velocity if moves else 0.0] * 7, time_ns=k * 1_000_000)
            rclpy.spin_once(peer.node, timeout_sec=0.01)
        process.terminate()  # if it did not end by itself
        assert process.wait(60) == 1
        assert ends_without_torque(peer)
        assert status in process.stderr.read()


def test_another_period_is_refused(peer):
    with start(CONFIG, "--torque-topic", "/effort") as process:
        k, limit = 0, time.monotonic() + 60
        while process.poll() is None and time.monotonic() < limit:
            k += 1
            peer.send(HOME, time_ns=k * 10_000_000)
            rclpy.spin_once(peer.node, timeout_sec=0.01)
        process.terminate()  # if it did not end by itself
        assert process.wait(60) == 2
        assert process.returncode == 2 and not peer.torques
        assert "joint states come every 10 ms" in process.stderr.read()
