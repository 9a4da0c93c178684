"""Arms with elastic gears, beside MuJoCo, which shares no code with the controller or the simulator.

A joint with an elastic gear is two joints of MuJoCo about one axis: theta, with the inertia and the
friction of the motor, and q - theta, with the gear's spring and damper. Skipped without MuJoCo.
"""

import csv
import json
import subprocess

import numpy as np
import pytest

import dashpot

mujoco = pytest.importorskip("mujoco")

from test_mujoco import ARMS  # noqa: E402

PERIOD = 1e-3


class Arm:
    """MuJoCo's arm of n joints behind gears, which it moves through ticks of held torques."""

    def __init__(self, root, name, stiffness, damping, rotors, friction=0.0, step=1e-5):
        spec = mujoco.MjSpec.from_file(str(root / f"sim/models/{name}.urdf"))
        for motor in [joint for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_HINGE]:
            motor.parent.add_joint(name=f"{motor.name} gear", type=motor.type, axis=motor.axis,
                                   pos=motor.pos)
            motor.armature = 0.1  # any, so that the motor has an inertia of its own
        self.model = model = spec.compile()
        model.opt.timestep = step
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
        self.n = n = model.nv // 2
        self.motor, self.gear = np.arange(0, 2 * n, 2), np.arange(1, 2 * n, 2)
        model.dof_frictionloss[:] = 0
        model.dof_armature[:] = model.dof_damping[:] = model.jnt_stiffness[:] = 0
        model.dof_armature[self.motor] = rotors
        model.dof_damping[self.motor] = friction
        model.dof_damping[self.gear] = damping
        model.jnt_stiffness[self.gear] = stiffness
        model.qpos_spring[:] = 0
        self.stiffness = stiffness
        self.data = mujoco.MjData(model)

    def weight(self):
        """Returns the torques that hold the links where they are."""
        self.data.qvel[:] = 0
        mujoco.mj_forward(self.model, self.data)
        return self.data.qfrc_bias[self.motor].copy()

    def rest(self, q, sensor):
        """Brings the arm to rest where the sensors show q, with its weight on the gears."""
        bent = np.zeros(self.n)
        for _ in range(30):
            self.data.qpos[self.motor] = q if sensor == "motor" else q + bent
            self.data.qpos[self.gear] = -bent
            bent = self.weight() / self.stiffness
        self.data.qpos[self.motor] = q if sensor == "motor" else q + bent
        self.data.qpos[self.gear] = -bent

    def shown(self, sensor):
        q, v = self.data.qpos[self.motor].copy(), self.data.qvel[self.motor].copy()
        if sensor == "link":
            q += self.data.qpos[self.gear]
            v += self.data.qvel[self.gear]
        return q, v

    def tick(self, torque):
        self.data.qfrc_applied[:] = 0
        self.data.qfrc_applied[self.motor] = torque
        for _ in range(round(PERIOD / self.model.opt.timestep)):
            mujoco.mj_step(self.model, self.data)


@pytest.mark.parametrize("sensor", ["motor", "link"])
@pytest.mark.parametrize("name", ["panda", "iiwa14", "gen3", "xarm7"])
def test_the_simulated_arm_moves_as_mujocos(root, program, tmp_path, name, sensor):
    """The torques of a run of the program, a move of 5 cm, move MuJoCo's arm in the same way."""
    base, tip, home = ARMS[name]
    stiffness = np.array([2e4, 2e4, 1e4, 1e4, 1e4, 5e3, 5e3])
    damping, rotors, friction = 1e-3 * stiffness, 0.1, 0.3
    scene = {
        "robot": {"urdf": str(root / f"sim/models/{name}.urdf"), "base": base, "tip": tip,
                  "reflected_inertia": rotors, "viscous_friction": friction, "coulomb_friction": 0},
        "control": {"mode": "cartesian"},
        "simulation": {"robot": {"gear_stiffness": stiffness.tolist(),
                                 "gear_damping": damping.tolist(), "position_sensor": sensor}},
        "scenario": {"duration": 0.6, "start": {"position": home}, "steps": [
            {"at": 0.05, "tip_displacement": [0.05, 0.02, -0.03, 0, 0, 0.1]}]},
    }
    (tmp_path / "scene.yaml").write_text(json.dumps(scene))
    table = tmp_path / "motion.csv"
    subprocess.run([program, "run", tmp_path / "scene.yaml", "--fast", "--csv", table], check=True,
                   capture_output=True)
    with open(table) as file:
        rows = [{name.split(" [")[0]: cell for name, cell in row.items()}
                for row in csv.DictReader(file)]
    arm = Arm(root, name, stiffness, damping, rotors, friction)
    arm.rest(np.array(home, float), sensor)
    moved, off, off_rate = 0, 0, 0
    for row in rows:
        q, v = arm.shown(sensor)
        told = {key: np.array([float(row[f"{key}{i}"]) for i in range(1, arm.n + 1)])
                for key in ("q", "qd", "torque")}
        moved = max(moved, abs(q - home).max())
        off = max(off, abs(q - told["q"]).max())
        off_rate = max(off_rate, abs(v - told["qd"]).max())
        arm.tick(told["torque"])
    print(f"{name}, {sensor}: moved by {moved:.3f} rad, off by {off:.1e} rad, {off_rate:.1e} rad/s")
    assert moved > 0.03
    assert off < 1e-11
    assert off_rate < 1e-8


@pytest.mark.parametrize("sensor, stopping_time", [("motor", 0.2), ("link", 1.2)])
@pytest.mark.parametrize("name", ["panda", "iiwa14"])
def test_the_brake_stops_mujocos_arm(root, name, sensor, stopping_time):
    """A gap of 20 ms while joint 1 turns at 1.3 rad/s; gears of 1 % damping, no friction."""
    base, tip, home = ARMS[name]
    stiffness, rotors = np.array([1e4] * 4 + [5e3] * 3), 0.1
    damping = 0.02 * np.sqrt(stiffness * rotors)
    arm = Arm(root, name, stiffness, damping, rotors, step=1e-4)
    arm.rest(np.array(home, float), sensor)
    controller = dashpot.Controller({
        "robot": {"urdf": str(root / f"sim/models/{name}.urdf"), "base": base, "tip": tip,
                  "reflected_inertia": rotors, "viscous_friction": 0, "coulomb_friction": 0,
                  "gear_stiffness": stiffness.tolist(), "gear_damping": damping.tolist(),
                  "position_sensor": sensor},
        "control": {"period": PERIOD}, "analysis": {"where": "off"},
        "limits": {"gain_margin": 1, "stopping_time": stopping_time, "beyond_model": True},
    })
    controller.reset(arm.weight())
    arm.data.qvel[arm.motor[0]] = 1.3
    fastest = []  # joint of the links in each tick
    for tick in range(6000):
        late = 20_000_000 if tick else 0
        torque, _ = controller.update(tick * 1_000_000 + late, *arm.shown(sensor))
        arm.tick(torque)
        fastest.append(abs(arm.data.qvel[arm.motor] + arm.data.qvel[arm.gear]).max())
    print(f"{name}, {sensor}: {fastest[1000]:.3f} rad/s after 1 s, {max(fastest[-300:]):.1e} in the end")
    assert max(fastest[-300:]) < 0.1
