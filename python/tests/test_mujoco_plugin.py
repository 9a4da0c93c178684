"""libdashpot_mujoco.so in MuJoCo, from Python. Skipped without either."""

import os
import pathlib
import re
import time

import numpy as np
import pytest

import dashpot
from conftest import HOME, ROOT

mujoco = pytest.importorskip("mujoco")
LIBRARY = pathlib.Path(os.environ.get("DASHPOT_MUJOCO_PLUGIN",
                                      ROOT / "build/release/libdashpot_mujoco.so"))
if not LIBRARY.exists():
    pytest.skip("libdashpot_mujoco.so was not built (DASHPOT_MUJOCO)", allow_module_level=True)
mujoco.mj_loadPluginLibrary(str(LIBRARY))

ROTORS = 0.1
CONFIG = """
robot: {{urdf: {root}/sim/models/panda.urdf, base: panda_link0, tip: panda_hand_tcp,
        reflected_inertia: 0.1, viscous_friction: 0}}
control: {{period: {period}, mode: {mode}}}
gains:
  joint: {{stiffness: [600, 600, 600, 600, 100, 100, 20], damping_ratio: 0.3}}
  task: {{stiffness: [500, 500, 500, 30, 30, 30], damping_ratio: 0.7}}
analysis: {{sampled: {{interval: 0.1 s}}}}
"""


def model_of(tmp_path, *, mode="joint", period="1 ms", integrator="implicitfast", more="", world="",
             sensor=True, **attributes):
    """A Panda whose arm has the plugin; each step takes a millisecond."""
    config = tmp_path / "config.yaml"
    config.write_text(CONFIG.format(root=ROOT, mode=mode, period=period))
    plain = mujoco.MjModel.from_xml_path(str(ROOT / "sim/models/panda.urdf"))
    mujoco.mj_saveLastXML(str(tmp_path / "plain.xml"), plain)
    keys = {"config": config, **attributes}
    instance = "".join(f'<config key="{key}" value="{value}"/>' for key, value in keys.items())
    text = (tmp_path / "plain.xml").read_text()
    text = re.sub("(<mujoco[^>]*>)", r"\1" + f"""
      <option timestep="0.001" integrator="{integrator}"><flag contact="disable"/></option>
      <extension><plugin plugin="dashpot.impedance"><instance name="arm">{instance}</instance>
      </plugin></extension>""", text, count=1)
    text = text.replace("<worldbody>", "<worldbody>" + world, 1)
    if sensor:
        more += '<sensor><plugin name="modes" plugin="dashpot.impedance" instance="arm"/></sensor>'
    text = text.replace("</mujoco>", more + "</mujoco>")
    (tmp_path / "scene.xml").write_text(text)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    model.dof_armature[:7] = ROTORS
    model.dof_damping[:] = 0
    model.dof_frictionloss[:] = 0
    data = mujoco.MjData(model)
    data.qpos[:7] = HOME
    return model, data


def test_the_arm_is_held_and_its_modes_are_sensed(tmp_path):
    model, data = model_of(tmp_path)
    for _ in range(500):
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(data.qpos[:7], HOME, atol=2e-3)
    assert np.abs(data.qfrc_passive[:7]).max() > 5  # the weight
    for _ in range(1000):  # another thread finds the margin
        mujoco.mj_step(model, data)
        if data.sensordata[2]:
            break
        time.sleep(0.01)
    status, fault, margin, count = data.sensordata[:4]
    assert (status, fault, count) == (0, 0, 7) and 1 < margin < 1000
    robot = dashpot.Robot.from_urdf(ROOT / "sim/models/panda.urdf", "panda_link0", "panda_hand_tcp",
                                    reflected_inertia=[ROTORS] * 7)
    expected = dashpot.closed_loop(robot, data.qpos[:7],
                                   joint_stiffness=[600, 600, 600, 600, 100, 100, 20],
                                   joint_damping_ratio=0.3).modes
    np.testing.assert_allclose(data.sensordata[4:11], expected.natural_frequency, rtol=1e-3)
    np.testing.assert_allclose(data.sensordata[11:18], 0.3, rtol=1e-3)


def test_the_arm_moves_as_its_modes_say(tmp_path):
    """Eigenvalues of the linear map that fits the motion, beside those in the sensor."""
    model, data = model_of(tmp_path)
    for _ in range(2000):
        mujoco.mj_step(model, data)
    random = np.random.default_rng(1)
    rest, stride, before, after = data.qpos[:7].copy(), 20, [], []
    for _ in range(12):
        data.qvel[:7] = 1e-4 * random.standard_normal(7)
        rows = []
        for _ in range(300):
            mujoco.mj_step(model, data)
            rows.append(np.concatenate([data.qpos[:7] - rest, data.qvel[:7]]))
        before += rows[10:-stride]
        after += rows[10 + stride:]
    step = np.linalg.lstsq(np.array(before), np.array(after), rcond=None)[0].T
    seen = np.log(np.linalg.eigvals(step).astype(complex)) / (1e-3 * stride)
    for omega, zeta in zip(data.sensordata[4:11], data.sensordata[11:18]):
        nearest = seen[np.argmin(abs(seen - omega * (-zeta + 1j * np.sqrt(1 - zeta**2))))]
        print(f"{omega:.3f} rad/s, ratio {zeta:.4f}; MuJoCo {abs(nearest):.3f}, "
              f"{-nearest.real / abs(nearest):.4f}")
        # The sensor shows the modes of a loop without a hold. MuJoCo moves by the new velocity,
        # which compensates most of the hold.
        assert abs(nearest) == pytest.approx(omega, rel=0.02)
        assert -nearest.real / abs(nearest) == pytest.approx(zeta, abs=0.01)


def test_a_goal_is_a_body(tmp_path):
    model, data = model_of(tmp_path, mode="cartesian", goal="goal", base="world",
                           world='<body name="goal" mocap="true"/>')
    robot = dashpot.Robot.from_urdf(ROOT / "sim/models/panda.urdf", "panda_link0", "panda_hand_tcp")
    goal = np.array(robot.pose(HOME))
    goal[:3, 3] += [0.03, -0.04, 0.02]
    data.mocap_pos[0] = goal[:3, 3]
    mujoco.mju_mat2Quat(data.mocap_quat[0], goal[:3, :3].ravel())
    for _ in range(4000):
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(robot.pose(data.qpos[:7])[:3, 3], goal[:3, 3], atol=1e-3)


def test_ticks_come_as_often_as_the_period_says(tmp_path):
    log = tmp_path / "log.lcm"
    model, data = model_of(tmp_path, period="2 ms", lcm_url=f"file://{log}?mode=w", sensor=False)
    for _ in range(100):
        mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)  # no step, so no tick
    del data, model
    states = dashpot.read_log(log)["DASHPOT_STATE"]
    assert states["tick"][-1] in (50, 51)
    assert np.median(np.diff(states["utime"]) / np.diff(states["tick"])) == 2000


@pytest.mark.parametrize("then", [0, 10])  # s; a keyframe may have any time
def test_a_reset_begins_anew(tmp_path, then):
    model, data = model_of(tmp_path)
    for _ in range(50):
        mujoco.mj_step(model, data)
    mujoco.mj_resetData(model, data)
    data.time = then
    data.qpos[:7] = np.array(HOME) + 0.1
    for _ in range(200):
        mujoco.mj_step(model, data)
    assert data.sensordata[0] == 0 and data.sensordata[1] == 0
    np.testing.assert_allclose(data.qpos[:7], np.array(HOME) + 0.1, atol=2e-3)


def test_an_arm_may_be_placed_after_a_look(tmp_path):
    model, data = model_of(tmp_path)
    data.qpos[:7] = np.array(HOME) + 0.3
    mujoco.mj_forward(model, data)
    data.qpos[:7] = HOME
    for _ in range(200):
        mujoco.mj_step(model, data)
    assert data.sensordata[0] == 0 and data.sensordata[1] == 0
    np.testing.assert_allclose(data.qpos[:7], HOME, atol=2e-3)


def test_each_data_has_an_arm_of_its_own(tmp_path):
    model, _ = model_of(tmp_path)
    starts = [np.array(HOME) + shift for shift in (0, 0.1, -0.1)]
    several = [mujoco.MjData(model) for _ in starts]
    for data, start in zip(several, starts):
        data.qpos[:7] = start
    for _ in range(200):
        for data in several:
            mujoco.mj_step(model, data)
    for data, start in zip(several, starts):
        np.testing.assert_allclose(data.qpos[:7], start, atol=2e-3)
        assert data.sensordata[1] == 0


def test_a_number_in_userdata_releases_a_fault(tmp_path):
    model, data = model_of(tmp_path, more='<size nuserdata="2"/>', release=1)

    def fault_after(steps):
        for _ in range(steps):
            mujoco.mj_step(model, data)
        return dashpot.Status(round(data.sensordata[1]))
    assert fault_after(10) == dashpot.Status.OK
    data.qvel[0] = 3
    assert fault_after(1000) == dashpot.Status.VELOCITY_LIMIT
    data.userdata[:] = 1
    assert fault_after(1) == dashpot.Status.OK and data.userdata.tolist() == [1, 0]
    data.qvel[0] = 3
    assert fault_after(100) == dashpot.Status.VELOCITY_LIMIT  # one number releases one fault
    mujoco.mj_resetData(model, data)
    data.qpos[:7] = HOME
    assert fault_after(10) == dashpot.Status.OK


def test_an_arm_that_needs_its_brakes_is_named_once(tmp_path, capfd):
    model, data = model_of(tmp_path)
    for _ in range(300):
        mujoco.mj_step(model, data)
        data.qpos[:7], data.qvel[:7] = HOME, 0.1  # as feedback that is frozen
    said = capfd.readouterr().err
    assert said.count("would have to engage its brakes") == 1 and "state frozen" in said


@pytest.mark.parametrize("attributes, reason", [
    ({"config": "nowhere.yaml"}, "nowhere.yaml"),
    ({"prefix": "other_"}, "the model has no joint 'other_panda_joint1'"),
    ({"goal": "moon"}, "the model has no body 'moon'"),
    ({"integrator": "RK4"}, "RK4 has states between steps"),
    ({"period": "1.5 ms"}, "is not a multiple of the model's timestep"),
    ({"release": "0"}, "'0' is not an index of userdata, which has 0 numbers"),
    ({"release": "1x"}, "'1x' is not an index of userdata"),
    ({"lcm_url": "nonsense"}, "nonsense")])
def test_what_does_not_fit_is_refused(attributes, reason, tmp_path, capfd):
    with pytest.raises(Exception):  # noqa: B017  # of MuJoCo, whose kind is not said
        model_of(tmp_path, sensor=False, **attributes)
    assert reason in capfd.readouterr().err


def test_actuators_that_pull_as_well_are_named(tmp_path, capfd):
    model_of(tmp_path, more='<actuator><position joint="panda_joint2" kp="100"/></actuator>')
    assert "an actuator of the model pulls joint 'panda_joint2'" in capfd.readouterr().err
