"""The brake on MuJoCo's arms, which share no code with the controller. Skipped without MuJoCo."""

import xml.etree.ElementTree

import numpy as np
import pytest

import dashpot

mujoco = pytest.importorskip("mujoco")

PERIOD = 1e-3
SEVEN = [0, 0.524, 0, -1.396, 0, 1.047, 0]
FRANKA = [0, -0.785, 0, -2.356, 0, 1.571, 0.785]
ARMS = {  # base, tip, posture
    "panda": ("panda_link0", "panda_hand_tcp", FRANKA),
    "fr3": ("fr3_link0", "fr3_hand_tcp", FRANKA),
    "iiwa14": ("iiwa_link_0", "iiwa_link_ee_kuka", SEVEN),
    "iiwa7": ("iiwa_link_0", "iiwa_link_ee_kuka", SEVEN),
    "xarm7": ("link_base", "link_eef", [0, -0.3, 0, 0.8, 0, 1.1, 0]),
}


def stop(root, name, rotors, joints, **limits):
    """A gap of 20 ms at 0.9 of the velocity limits of the first joints, no friction. Returns the
    seconds until a tenth of the speed is left for good, the largest way of a joint and joint 1's in
    degrees, and the greatest speed over its limit."""
    base, tip, home = ARMS[name]
    path = root / f"sim/models/{name}.urdf"
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = PERIOD
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    model.dof_armature[:] = rotors
    model.dof_damping[:] = 0
    model.dof_frictionloss[:] = 0
    data = mujoco.MjData(model)
    robot = dashpot.Robot.from_urdf(path, base, tip, reflected_inertia=[rotors] * 7)
    limits_of = {joint.get("name"): joint.find("limit")
                 for joint in xml.etree.ElementTree.parse(path).iter("joint")}
    limit = np.array([float(limits_of[model.joint(i).name].get("velocity")) for i in range(7)])
    data.qpos[:] = home
    data.qvel[:joints] = 0.9 * limit[:joints]
    controller = dashpot.Controller({
        "robot": {"urdf": str(path), "base": base, "tip": tip, "reflected_inertia": rotors},
        "control": {"period": PERIOD}, "limits": limits, "analysis": {"where": "off"}})
    controller.reset(robot.gravity(data.qpos.copy()))
    slow, way, fastest = None, np.zeros(7), 0
    start = data.qpos.copy()
    for tick in range(1000):
        late = 20_000_000 if tick else 0
        torque, status = controller.update(tick * 1_000_000 + late, data.qpos.copy(),
                                           data.qvel.copy())
        assert tick == 0 or status >= dashpot.Status.FAULT_LATCHED
        data.qfrc_applied[:] = torque
        mujoco.mj_step(model, data)
        share = (abs(data.qvel) / limit).max()
        way = np.maximum(way, abs(data.qpos - start))
        fastest = max(fastest, share)
        if share > 0.09:
            slow = None
        elif slow is None:
            slow = tick * PERIOD
    return slow, np.degrees(way.max()), np.degrees(way[0]), fastest


@pytest.mark.parametrize("rotors", [0, 0.1])
@pytest.mark.parametrize("name", ARMS)
def test_joint_1_stops_within_20_degrees(root, name, rotors):
    slow, way, first, fastest = stop(root, name, rotors, 1)
    print(f"{name}, rotors {rotors}: {slow} s, {first:.1f} of {way:.1f} deg, {fastest:.2f}")
    assert slow is not None and slow <= 0.25
    assert first <= 20
    assert fastest <= 0.95


@pytest.mark.parametrize("rotors", [0, 0.1])
@pytest.mark.parametrize("name", ARMS)
def test_all_joints_stop(root, name, rotors):
    slow, way, _, fastest = stop(root, name, rotors, 7)
    print(f"{name}, rotors {rotors}: {slow} s, {way:.1f} deg, {fastest:.2f}")
    assert slow is not None and slow <= 0.25
    assert fastest <= 1


def test_a_stopping_time_of_a_second_is_slower(root):
    slow, _, first, _ = stop(root, "panda", 0.1, 1, stopping_time=1)
    assert slow is None or slow > 0.25
    assert first > 20
