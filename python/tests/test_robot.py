"""The robot against `dashpot inspect`, which has tests against KDL."""

import json
import pickle
import subprocess
import warnings

import numpy as np
import pytest

import dashpot
from conftest import HOME, ROOT

QD = (0.1, -0.2, 0.3, 0.4, -0.5, 0.6, -0.7)
TASK = dict(task_stiffness=[200, 200, 200, 20, 20, 20],
            task_damping=[28.3, 28.3, 28.3, 8.94, 8.94, 8.94])


def text(values):
    return ",".join(map(str, values))


def test_dynamics_are_those_of_the_program(program, panda):
    printed = json.loads(subprocess.check_output(
        [program, "inspect", "--urdf", ROOT / "sim/models/panda.urdf", "--base", "panda_link0",
         "--tip", "panda_hand_tcp", "--q", text(HOME), "--qd", text(QD), "--json"]))
    close = dict(rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(panda.mass(HOME), printed["mass_matrix"], **close)
    np.testing.assert_allclose(panda.gravity(HOME), printed["gravity"], **close)
    np.testing.assert_allclose(panda.coriolis(HOME, QD), printed["coriolis"], **close)
    np.testing.assert_allclose(panda.jacobian(HOME), printed["jacobian"], **close)
    np.testing.assert_allclose(panda.jacobian_dot_qd(HOME, QD), printed["jacobian_dot_qd"], **close)
    np.testing.assert_allclose(panda.pose(HOME)[:3, 3], printed["tip_position"], **close)
    np.testing.assert_allclose(panda.pose(HOME)[:3, :3], printed["tip_rotation"], **close)
    assert panda.joint_names == tuple(joint["name"] for joint in printed["joints"])
    np.testing.assert_array_equal(panda.upper, [joint["upper"] for joint in printed["joints"]])
    assert len(panda) == 7 and panda.name == "panda"


def test_a_robot_survives_pickling(panda):
    heavy = dashpot.Robot.from_urdf(ROOT / "sim/models/panda.urdf", "panda_link0",
                                    "panda_hand_tcp", payload_mass=2, payload_center=[0, 0, 0.05],
                                    reflected_inertia=[0.1] * 7, gravity=[0, 0, -1.6])
    again = pickle.loads(pickle.dumps(heavy))
    np.testing.assert_array_equal(again.mass(HOME), heavy.mass(HOME))
    np.testing.assert_array_equal(again.gravity(HOME), heavy.gravity(HOME))
    assert np.linalg.norm(heavy.mass(HOME) - panda.mass(HOME)) > 0.1
    assert repr(again) == repr(heavy)
    with pytest.raises(ValueError):
        again.upper[0] = 9


def test_a_payload_weighs(panda):
    arm = (ROOT / "sim/models/panda.urdf", "panda_link0", "panda_hand_tcp")
    held = np.eye(4)
    held[:3, 3] = [0, 0, 0.05]
    heavy = dashpot.Robot.from_urdf(*arm, payload_mass=2, payload_center=[0, 0, 0.05])
    lift = dashpot.Robot.from_urdf(*arm, tool=held).jacobian(HOME)[2]
    np.testing.assert_allclose(heavy.gravity(HOME) - panda.gravity(HOME), 2 * 9.81 * lift,
                               atol=1e-9)


def test_a_tool_moves_the_tip(panda):
    tool = np.eye(4)
    tool[:3, 3] = [0, 0, 0.1]
    tool[1:3, 1:3] = [[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]]
    long = dashpot.Robot.from_urdf(ROOT / "sim/models/panda.urdf", "panda_link0", "panda_hand_tcp",
                                   tool=tool)
    np.testing.assert_allclose(long.pose(HOME), panda.pose(HOME) @ tool, atol=1e-12)


def test_bad_input_gives_the_programs_messages(panda, tmp_path):
    with pytest.raises(dashpot.Error, match="no-such-file.urdf: .*No such file"):
        dashpot.Robot.from_urdf("no-such-file.urdf", "a", "b")
    with pytest.raises(dashpot.Error, match="panda.urdf: .*'hand'"):
        dashpot.Robot.from_urdf(ROOT / "sim/models/panda.urdf", "panda_link0", "hand")
    bad = tmp_path / "bad.urdf"
    bad.write_text("<robot")
    with pytest.raises(dashpot.Error, match="bad.urdf"):
        dashpot.Robot.from_urdf(bad, "a", "b")
    with pytest.raises(dashpot.Error, match="q: has 2 entries, the robot has 7 joints"):
        panda.mass([1, 2])
    with pytest.raises(dashpot.Error, match="q: entry 3 is not a finite number"):
        panda.pose([0, 0, np.nan, 0, 0, 0, 0])
    with pytest.raises(dashpot.Error, match="q: a list of numbers is wanted"):
        panda.gravity(np.zeros((7, 1)))
    with pytest.raises(dashpot.Error, match="gravity: is 2, expected 3"):
        dashpot.Robot.from_urdf(ROOT / "sim/models/panda.urdf", "panda_link0", "panda_hand_tcp",
                                gravity=[0, 1])


def test_the_closed_loop_is_made_of_springs_and_dampers(panda):
    found = dashpot.closed_loop(panda, HOME, **TASK)
    J = panda.jacobian(HOME)
    np.testing.assert_allclose(found.mass, panda.mass(HOME), atol=1e-12)
    np.testing.assert_allclose(found.stiffness, J.T @ np.diag(TASK["task_stiffness"]) @ J,
                               atol=1e-10)
    np.testing.assert_allclose(
        found.damping, J.T @ np.diag(TASK["task_damping"]) @ J + np.diag(panda.viscous_friction),
        atol=1e-10)
    joint = dashpot.closed_loop(panda, HOME, joint_stiffness=[50.0] * 7, joint_damping=np.eye(7))
    np.testing.assert_allclose(joint.stiffness, 50 * np.eye(7), atol=1e-12)
    held = dashpot.closed_loop(panda, HOME, task_stiffness=TASK["task_stiffness"],
                               task_damping_ratio=0.7)
    np.testing.assert_allclose(held.modes.damping_ratio[:6], 0.7, atol=0.05)  # and friction
    q = np.array(HOME) + 0.3  # where the tool's axes differ from the base's
    R = np.kron(np.eye(2), panda.pose(q)[:3, :3])
    K = np.diag([2000.0, 600, 100, 10, 20, 30])
    tool = dashpot.closed_loop(panda, q, task_stiffness=K, task_damping=[0] * 6, frame="tool")
    np.testing.assert_allclose(
        tool.stiffness, panda.jacobian(q).T @ R @ K @ R.T @ panda.jacobian(q), atol=1e-9)
    position = dashpot.closed_loop(panda, HOME, **TASK, directions=["x", "y", "z"])
    np.testing.assert_allclose(position.stiffness, 200 * J[:3].T @ J[:3], atol=1e-9)
    assert len(position.modes) == 3 and len(position.modes.zero_modes) == 4
    force = dict(external_wrench=[0, 0, -50, 0, 0, 0])
    weight = dashpot.closed_loop(panda, HOME, **TASK, **force)
    np.testing.assert_allclose(weight.stiffness, found.stiffness, atol=1e-9)
    torques = dashpot.closed_loop(panda, HOME, **TASK, **force, load="joint_torques")
    assert np.abs(torques.stiffness - found.stiffness).max() > 1
    turning = dashpot.closed_loop(panda, HOME, **TASK, **force, load="tool_wrench")
    across = np.cross(J[3:].T, force["external_wrench"][:3]).T  # of the turned force, minus
    np.testing.assert_allclose(turning.stiffness - found.stiffness, -J[:3].T @ across, atol=1e-9)
    N = np.eye(7) - np.linalg.solve(panda.mass(HOME), J.T) @ np.linalg.solve(
        J @ np.linalg.solve(panda.mass(HOME), J.T), J)
    posture = dashpot.closed_loop(panda, HOME, **TASK, null_stiffness=[5.0] * 7,
                                  null_damping=[0] * 7)
    np.testing.assert_allclose(posture.stiffness - found.stiffness, 5 * N.T @ N, atol=1e-9)


def test_degrees_percent_and_transposed_tools_are_told(panda, config):
    with pytest.warns(UserWarning, match="if these are degrees"):
        panda.mass([0, -45, 0, -135, 0, 90, 45])
    with pytest.warns(UserWarning, match="70 is not a percentage"):
        dashpot.design_damping([[1]], [[100]], damping_ratio=70)
    arm = config["robot"]
    tool = np.eye(4)
    tool[3, 2] = 0.1
    with pytest.raises(dashpot.Error, match="tool: its last row is .*: is it transposed"):
        dashpot.Robot.from_urdf(arm["urdf"], arm["base"], arm["tip"], tool=tool)
    controller = dashpot.Controller({**config, "control": {"mode": "cartesian"}})
    controller.start(HOME)
    with pytest.warns(UserWarning, match="is it a damping ratio"):
        controller.set_gains(task_stiffness=[400] * 3 + [20] * 3, task_damping=[0.7] * 6)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # it has been asked
        controller.set_gains(task_stiffness=[400] * 3 + [20] * 3, task_damping=[0.8] * 6)


def test_a_closed_loop_that_cannot_be_is_refused(panda):
    for given, message in [
            (dict(task_stiffness=np.eye(5)), "gains.task.stiffness: is 5 x 5; 6 x 6"),
            (dict(task_stiffness=[-1, 0, 0, 0, 0, 0]), "task_stiffness"),
            (dict(task_stiffness=[1] * 6, joint_stiffness=[1] * 7), "not both"),
            (dict(task_stiffness=[1] * 6, frame="world"), "gains.task.frame: .*'world'"),
            (dict(task_stiffness=[1] * 6, directions=["w"]), "gains.task.directions: .*'w'"),
            (dict(task_stiffness=[1] * 6, task_damping=[1] * 6, task_damping_ratio=0.7),
             "gains.task.damping_ratio: stands beside damping"),
            (dict(task_stiffness=[1] * 6), "task_damping and task_damping_ratio: one of them"),
            (dict(joint_stiffness=[1] * 7), "joint_damping and joint_damping_ratio: one of them"),
            (dict(task_stiffness=[1] * 6, task_damping=[1] * 6, null_stiffness=[1] * 7),
             "null_damping and null_damping_ratio: one of them"),
            (dict(task_stiffness=[1] * 6, task_damping=[1] * 6, external_wrench=[1, 2]),
             "external_wrench"),
            (dict(task_stiffness=[1] * 6, external_wrench=[1] * 6, load="x"), "load: 'x'")]:
        with pytest.raises(dashpot.Error, match=message):
            dashpot.closed_loop(panda, HOME, **given)
    with pytest.raises(dashpot.Error, match="q: joint '.*' at .* rad is outside .*; if these are deg"):
        dashpot.closed_loop(panda, np.degrees(HOME), **TASK)
