"""`dashpot drive` against Drake: its messages, and arms that it simulates behind them."""
import importlib
import os
import re
import signal
import subprocess
import time

import numpy as np
import pytest

import dashpot
from conftest import ROOT

FINGERPRINTS = {"lcmt_iiwa_command": "ddc7c7738c815334", "lcmt_iiwa_status": "f16fb804284abca3",
                "lcmt_panda_command": "e68df777004d59d0", "lcmt_panda_status": "19571cdf4d82fae6"}
DEFINITIONS = ROOT / "lcmtypes"


@pytest.mark.parametrize("name", FINGERPRINTS)
def test_drake_has_the_same_members(name):
    try:
        message = getattr(importlib.import_module("drake"), name)
    except (ImportError, AttributeError):
        pytest.skip("Drake's messages are not installed")
    assert message._get_packed_fingerprint().hex() == FINGERPRINTS[name]
    text = (DEFINITIONS / f"{name}.lcm").read_text()
    assert all(f" {member}" in text for member in message.__slots__)


# Model, base, posture in rad, the driver's low-pass on torques in Hz; the stiffness of the example, a
# damping, and the friction of the description.
ARMS = {
    "iiwa": ("iiwa14", "iiwa_link_0", np.deg2rad([0, 30, 0, -80, 0, 60, 0]), 0,
             [150, 150, 100, 100, 40, 20, 8], [20, 20, 10, 10, 1.5, 0.7, 0.15], 0.5),
    "panda": ("panda", "panda_link0", np.array([0, -0.785, 0, -2.356, 0, 1.571, 0.785]), 30,
              [60, 60, 60, 60, 15, 10, 5], [8, 8, 8, 6, 0.6, 0.6, 0.2], 0.003)}
SETTLE, TAPS, FREE = 1500, 10, 200  # periods, taps, periods from one to the next


def new_command(directory, goal, stiffness, damping):
    """The bytes of a command_t that moves the arm and changes its gains."""
    subprocess.check_call(["lcm-gen", "-p", "--ppath", directory, DEFINITIONS / "command_t.lcm"])
    spec = importlib.util.spec_from_file_location("command_t",
                                                  directory / "dashpot/command_t.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    command = module.command_t()
    command.n = len(goal)
    command.sender = command.sequence = 1
    command.utime = int(1e6 * time.time())
    command.parts = command.MODE + command.JOINT_POSITION + command.JOINT_GAINS
    command.mode = command.JOINT
    command.joint_position = list(goal)
    command.tip_quaternion = [1, 0, 0, 0]
    command.joint_stiffness = np.diag(stiffness).tolist()
    command.joint_damping = np.diag(damping).tolist()
    command.null_stiffness = command.null_damping = [0] * command.n
    return command.encode()


def tapped(arm, stiffness, random):
    """The rows of an arm that is tapped and moves freely, again and again, between two rests."""
    for _ in range(SETTLE):
        arm.step()
    first = len(arm.rows)
    for _ in range(TAPS):
        tap = 2e-4 * np.array(stiffness) * random.uniform(-1, 1, len(stiffness))
        for k in range(FREE):
            arm.step(tap=tap if k < 20 else None)
    rows = arm.rows[first:]
    for _ in range(SETTLE):
        arm.step()
    return rows


def nearest(found, wanted):
    """For each of `wanted` the nearest of `found`, each of which is taken once."""
    found = list(found)
    return [found.pop(int(np.argmin(np.abs(np.array(found) - value)))) for value in wanted]


def pairs(frequency, ratio):
    """The eigenvalues of modes, 1/s."""
    root = np.sqrt(ratio.astype(complex)**2 - 1)
    return np.ravel(np.column_stack([-frequency * (ratio - root), -frequency * (ratio + root)]))


def check_modes(log, end, mass, stiffness, damping, friction, motion):
    """The last modes before `end`, us of the arm's time, against Drake's mass matrix and its motion."""
    modes, sampled = log["DASHPOT_MODES"], log["DASHPOT_SAMPLED_MODES"]
    last = np.flatnonzero(modes["utime"] < end)[-1]
    n = len(stiffness)
    inverse = np.linalg.inv(mass)
    continuous = np.linalg.eigvals(np.block(
        [[np.zeros((n, n)), np.eye(n)],
         [-inverse * stiffness, -inverse * (np.array(damping) + friction)]]))
    published = np.ravel(modes["eigenvalue_real"][last] + 1j * modes["eigenvalue_imag"][last])
    np.testing.assert_allclose(published, nearest(continuous, published), rtol=1e-5)

    last = np.flatnonzero(sampled["utime"] < end)[-1]
    frequency, ratio = sampled["natural_frequency"][last], sampled["damping_ratio"][last]
    moved = np.reshape(nearest(motion, pairs(frequency, ratio)), (n, 2))
    fitted = np.sqrt(moved.prod(axis=1))
    np.testing.assert_allclose(fitted, frequency, rtol=1e-4)
    np.testing.assert_allclose(-moved.sum(axis=1) / (2 * fitted), ratio, rtol=1e-3)


@pytest.mark.parametrize("kind", ARMS)
def test_modes_are_those_of_drakes_arm(kind, program, tmp_path):
    pytest.importorskip("pydrake", reason="Drake is not installed")
    from drake_arm import PERIOD, DrakeArm, eigenvalues
    model, base, start, cutoff, stiffness, damping, friction = ARMS[kind]
    config, log, says = (tmp_path / name for name in ("drive.yaml", "drive.lcm", "says"))
    # Constant damping, and the friction that Drake's arm has. Commands use the wall clock, which
    # differs from the clock of the simulation.
    text = (ROOT / f"controller/examples/{model}_drive.yaml").read_text()
    text, constant = re.subn("damping_ratio: 0.8", f"damping: {damping}", text)
    assert constant == 1
    config.write_text(re.sub(" *viscous_friction: .*\n", "", text)
                      .replace("../../sim", str(ROOT / "sim"))
                      .replace("analysis:", "commands: {silence: 30 s, oldest: 20 s}\nanalysis:"))
    url = f"udpm://239.255.76.67:{20000 + os.getpid() % 20000}?ttl=0"
    arm = DrakeArm(kind, ROOT / f"sim/models/{model}.urdf", base, url, start, cutoff)
    random = np.random.default_rng(1)
    goal = start + 0.05
    changed = 1.5 * np.array(stiffness), 1.2 * np.array(damping)
    found = []
    with open(says, "w") as stderr, subprocess.Popen(
            [program, "drive", config, f"--{kind}", "--commands", "--lcm-url", url, "--log", log],
            stdout=subprocess.DEVNULL, stderr=stderr) as drive:
        try:
            if not arm.begin():
                assert "no status on" in says.read_text(), says.read_text()
                pytest.skip(f"multicast does not work on this machine: {url}")
            for gains in ((stiffness, damping), changed):
                rows = tapped(arm, stiffness, random)
                found.append((1e6 * PERIOD * len(arm.rows), arm.mass(), *gains,
                              eigenvalues(rows, differenced=kind == "iiwa")))
                if gains is changed:
                    break
                arm.lcm.Publish("DASHPOT_COMMAND", new_command(tmp_path, goal, *changed))
        finally:
            drive.send_signal(signal.SIGTERM)
    assert drive.returncode == 0, says.read_text()
    np.testing.assert_allclose(arm.position, goal, atol=1e-4)
    messages = dashpot.read_log(log)
    for end, mass, k, d, motion in found:
        check_modes(messages, end, mass, k, d, friction, motion)
