"""Arms with elastic gears, beside MuJoCo, which shares no code with the controller or the simulator.

A joint with an elastic gear is two joints of MuJoCo about one axis: theta, with the inertia and the
friction of the motor, and q - theta, with the gear's spring and damper. Skipped without MuJoCo.
"""

import csv
import json
import subprocess
import time

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

    def tick(self, torque, period=PERIOD):
        self.data.qfrc_applied[:] = 0
        self.data.qfrc_applied[self.motor] = torque
        for _ in range(round(period / self.model.opt.timestep)):
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


def tick_map(arm, sensor, q):
    """Returns A, B, C of x' = A x + B torque, shown = C x: of MuJoCo's arm about its rest, from
    tick to tick, by central differences. Rates are in units of 1000 / s."""
    n, rate = arm.n, 1000
    arm.rest(q, sensor)
    torque = arm.weight()
    rest, scale = arm.data.qpos.copy(), np.repeat([1, rate], 2 * n)

    def moved(x, extra):
        arm.data.qpos[:], arm.data.qvel[:] = rest + x[:2 * n], x[2 * n:]
        arm.tick(torque + extra)
        return np.concatenate([arm.data.qpos - rest, arm.data.qvel]) / scale

    none, still = np.zeros(n), np.zeros(4 * n)
    A = np.array([moved(1e-5 * s * e, none) - moved(-1e-5 * s * e, none)
                  for s, e in zip(scale, np.eye(4 * n))]).T / 2e-5
    B = np.array([moved(still, 1e-2 * e) - moved(still, -1e-2 * e) for e in np.eye(n)]).T / 2e-2
    C = np.zeros((2 * n, 4 * n))
    for i in range(n):
        C[i, 2 * i] = C[n + i, 2 * n + 2 * i] = 1
        if sensor == "link":
            C[i, 2 * i + 1] = C[n + i, 2 * n + 2 * i + 1] = 1
    return A, B, C * scale


def closed(A, B, C, law, delay, cutoff):
    """The map of the loop whose torques law @ shown act `delay` ticks later behind a low-pass."""
    n, m = B.shape[1], len(A)
    gain = 1 - np.exp(-2 * np.pi * cutoff * PERIOD) if cutoff else 1
    size = m + n * (delay + 1)  # the torques on their way, then the last one that acted
    acting, command = np.zeros((n, size)), np.zeros((n, size))
    command[:, :m] = law @ C
    acting += gain * (command if delay == 0 else np.eye(n, size, m))
    acting[:, m + n * delay:] += (1 - gain) * np.eye(n)
    map_ = np.zeros((size, size))
    map_[:m, :m] = A
    map_[:m] += B @ acting
    for k in range(delay):
        rows = slice(m + n * k, m + n * (k + 1))
        map_[rows] = command if k == delay - 1 else np.eye(n, size, m + n * (k + 1))
    map_[m + n * delay:] = acting
    return map_


def motions(map_):
    """Returns the discrete eigenvalues, without the zeros of torques that are forgotten at once."""
    z = np.linalg.eigvals(map_).astype(complex)
    return z[abs(z) > 1e-12]


def law_of(controller, q, weight):
    """Returns d torque / d (position, velocity) where the springs rest, by central differences."""
    n, clock = len(q), [0]

    def tick(at, rate):
        clock[0] += round(1e9 * PERIOD)
        torque, status = controller.update(clock[0], at, rate)
        assert status == 0, status
        return torque.copy()

    still = np.zeros(n)
    controller.reset(weight)
    for _ in range(1000):
        tick(q, still)
    columns = []
    for j in range(2 * n):
        step = 1e-6 * np.eye(n)[j % n]
        ends = []
        for sign in (1, -1):
            tick(q, still)
            ends.append(tick(q + sign * step, still) if j < n else tick(q, sign * step))
        columns.append((ends[0] - ends[1]) / 2e-6)
    settled = 1e-9 * clock[0]
    for _ in range(1000):  # another thread finds what the torque's hold makes of the modes
        tick(q, still)
        modes = controller.sampled_modes()
        if modes is not None and modes.time > settled:
            return np.array(columns).T, modes
        time.sleep(0.01)
    raise AssertionError("no modes of the sampled loop")


@pytest.mark.parametrize("sensor", ["motor", "link"])
@pytest.mark.parametrize("name", ["panda", "iiwa14", "gen3", "xarm7"])
def test_predicted_modes_and_margin_are_those_of_mujocos_arm(root, name, sensor):
    base, tip, home = ARMS[name]
    home = np.array(home, float)
    for seed in range(3):
        random = np.random.default_rng(seed)
        stiffness = np.exp(random.uniform(np.log(5e3), np.log(1e5), 7))
        rotors = np.exp(random.uniform(np.log(0.05), np.log(0.5), 7))
        damping = 0.04 * np.sqrt(stiffness * rotors)
        delay, cutoff = int(random.integers(0, 3)), float(random.choice([0, 150]))
        arm = Arm(root, name, stiffness, damping, rotors)
        # Behind motors the links are elsewhere than they are taken to be, by their weight.
        gravity = [0, 0, -9.81 if sensor == "link" else 0]
        arm.model.opt.gravity[:] = gravity
        controller = dashpot.Controller({
            "robot": {"urdf": str(root / f"sim/models/{name}.urdf"), "base": base, "tip": tip,
                      "reflected_inertia": rotors.tolist(), "viscous_friction": 0,
                      "coulomb_friction": 0, "gravity": gravity,
                      "gear_stiffness": stiffness.tolist(), "gear_damping": damping.tolist(),
                      "position_sensor": sensor},
            "control": {"period": PERIOD, "mode": "cartesian" if seed else "joint"},
            "limits": {"torque": 1e4, "torque_rate": 1e6, "gain_margin": 1, "stopping_time": 2,
                       "beyond_model": True},
            "watchdog": {"setpoint_hold": 0, "setpoint_damp": 0, "feedback": 0},
            "analysis": {"share": 1,
                         "sampled": {"interval": 0.05, "delay": delay, "cutoff": cutoff}},
        })
        A, B, C = tick_map(arm, sensor, home)
        law, modes = law_of(controller, home, arm.weight())
        seen = np.log(motions(closed(A, B, C, law, delay, cutoff))) / PERIOD
        off, off_ratio, compared = 0, 0, 0
        for omega, zeta in zip(modes.natural_frequency, modes.damping_ratio):
            if not zeta < 1 or omega * PERIOD > 2.5:
                continue
            nearest = seen[np.argmin(abs(seen - omega * (-zeta + 1j * np.sqrt(1 - zeta**2))))]
            off = max(off, abs(abs(nearest) / omega - 1))
            off_ratio = max(off_ratio, abs(-nearest.real / abs(nearest) - zeta))
            compared += 1
        # What the controller commands against gravity does not grow with its gains.
        held = np.zeros_like(law)
        robot = dashpot.Robot.from_urdf(root / f"sim/models/{name}.urdf", base, tip, gravity=gravity)
        for i, step in enumerate(1e-5 * np.eye(7)):
            held[:, i] = (robot.gravity(home + step) - robot.gravity(home - step)) / 2e-5

        margin, stable = modes.gain_margin, []
        for factor in (0.999 * margin, 1.001 * margin):
            z = motions(closed(A, B, C, held + factor * (law - held), delay, cutoff))
            stable.append(abs(z[abs(np.log(z)) > 1e-5]).max() < 1)
        print(f"{name}, {sensor}, delay {delay}, cutoff {cutoff}: {compared} modes, frequency off by "
              f"{off:.1e}, ratio by {off_ratio:.1e}, margin {margin:.4f}")
        assert compared > 6
        assert off < 1e-4
        assert off_ratio < 1e-3
        assert stable[0] != stable[1]


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
