"""Modes under a load beside MuJoCo, which shares no code with the controller. Skipped without it."""

import time

import numpy as np
import pytest

import dashpot

mujoco = pytest.importorskip("mujoco")

PERIOD = 2.5e-4
ROTORS = 0.1  # kg m^2, of all joints in both
ARMS = {  # base, tip, posture
    "panda": ("panda_link0", "panda_hand_tcp", [0, -0.785, 0, -2.356, 0, 1.571, 0.785]),
    "fr3": ("fr3_link0", "fr3_hand_tcp", [0.3, -0.6, 0.2, -2.1, 0.1, 1.7, 0.6]),
    "iiwa14": ("iiwa_link_0", "iiwa_link_ee_kuka", [0.2, 0.6, 0.3, -1.2, 0.2, 1.0, 0.3]),
    "gen3": ("base_link", "end_effector_link", [0.2, 0.5, 0.3, 1.3, 0.2, 0.9, 0.4]),
    "xarm7": ("link_base", "link_eef", [0.2, -0.4, 0.3, 0.9, 0.2, 1.1, 0.4]),
}


class Loop:
    """The controller on MuJoCo's arm, whose tip a steady wrench pushes."""

    def __init__(self, root, name, wrench, **null_space):
        base, tip, home = ARMS[name]
        path = root / f"sim/models/{name}.urdf"
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.model.opt.timestep = PERIOD
        self.model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        self.model.dof_armature[:] = ROTORS
        self.model.dof_damping[:] = 0
        self.model.dof_frictionloss[:] = 0
        self.data = mujoco.MjData(self.model)
        self.robot = dashpot.Robot.from_urdf(path, base, tip, reflected_inertia=[ROTORS] * 7)
        self.body = self.model.nbody - 1
        self.wrench = np.array(wrench, float)
        home = np.array(home, float)
        self.data.qpos[:] = home
        self.controller = dashpot.Controller({
            "robot": {"urdf": str(path), "base": base, "tip": tip, "reflected_inertia": ROTORS,
                      "viscous_friction": 0, "coulomb_friction": 0},
            "control": {"period": PERIOD, "mode": "cartesian", "load": "base_wrench",
                        "null_weights": [4, 1, 1, 1, 1, 1, 1]},
            "gains": {"task": {"stiffness": [700, 400, 250, 60, 30, 12], "damping_ratio": 0.6},
                      "null_space": null_space or {"stiffness": [5] * 7, "damping_ratio": 0.6}},
            "limits": {"torque": 500, "torque_rate": 1e6, "gain_margin": 1, "velocity": 10,
                       "beyond_model": True},
            "analysis": {"share": 1, "sampled": {"interval": 0.2}},
        })
        self.time = 0
        self.torque = self.robot.gravity(home)
        self.controller.reset(self.torque)

    def tick(self, share=1.0):
        q, v = self.data.qpos.copy(), self.data.qvel.copy()
        self.time += round(1e9 * PERIOD)
        push = share * self.wrench
        torque, status = self.controller.update(self.time, q, v, external_wrench=push)
        assert status == 0, status
        tip = self.robot.pose(q)[:3, 3]
        applied = torque.copy()
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_applyFT(self.model, self.data, push[:3], push[3:], tip, self.body, applied)
        self.data.qfrc_applied[:] = applied
        mujoco.mj_step(self.model, self.data)


@pytest.mark.parametrize("name", ARMS)
def test_modes_under_a_steady_wrench_are_those_of_the_motion(root, name):
    loop = Loop(root, name, [12, -10, 14, 0.4, 0.3, -0.5])
    for k in range(44000):  # 11 s
        loop.tick(min(1, k / 4000))
    expect_modes_of_motion(loop, name)


@pytest.mark.parametrize("projector", ["kinematic", "weighted", "none", "dynamic"])
def test_modes_after_a_switch_of_the_projector_are_those_of_the_motion(root, projector):
    loop = Loop(root, "panda", [0] * 6, stiffness=[40] * 7, damping=[1] * 7)
    if projector == "dynamic":
        loop.controller.set_gains(null_projector="none")
    for k in range(8000):  # 2 s
        if k == 4000:
            before = loop.controller.modes().natural_frequency
            loop.controller.set_gains(null_projector=projector)
        loop.tick()
    assert abs(loop.controller.modes().natural_frequency / before - 1).max() > 0.01
    expect_modes_of_motion(loop, projector)


def expect_modes_of_motion(loop, name):
    """Expects the modes of the sampled loop in small motions of an arm at rest."""
    assert abs(loop.data.qvel).max() < 1e-10
    settled = 1e-9 * loop.time
    stride, samples, random = 40, 20, np.random.default_rng(1)
    rest = np.concatenate([loop.data.qpos, loop.data.qvel])
    before, after = [], []
    for _ in range(10):
        loop.data.qpos[:] = rest[:7] + 1e-7 * random.standard_normal(7)
        loop.data.qvel[:] = 1e-6 * random.standard_normal(7)
        last = None
        for k in range(stride * samples + 1):
            if k % stride == 0:
                x = np.concatenate([loop.data.qpos, loop.data.qvel]) - rest
                if last is not None:
                    before.append(last)
                    after.append(x)
                last = x
            loop.tick()
    for _ in range(1000):  # another thread finds what the torque's hold makes of the modes
        loop.tick()
        modes = loop.controller.sampled_modes()
        if modes is not None and modes.time > settled:
            break
        time.sleep(0.01)
    step = np.linalg.lstsq(np.array(before), np.array(after), rcond=None)[0].T
    seen = np.log(np.linalg.eigvals(step).astype(complex)) / (stride * PERIOD)
    for omega, zeta in zip(modes.natural_frequency, modes.damping_ratio):
        if zeta >= 1:
            continue
        nearest = seen[np.argmin(abs(seen - omega * (-zeta + 1j * np.sqrt(1 - zeta**2))))]
        print(f"{name}: {omega:.4f} rad/s, ratio {zeta:.5f}; MuJoCo {abs(nearest):.4f}, "
              f"{-nearest.real / abs(nearest):.5f}")
        assert abs(nearest) == pytest.approx(omega, rel=3e-4)
        assert -nearest.real / abs(nearest) == pytest.approx(zeta, abs=3e-4)
