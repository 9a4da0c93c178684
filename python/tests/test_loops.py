"""One loop: a run and Python report the same gain margin of the same arm. numpy computes the same
margins from Pinocchio's mass matrix, Jacobian and gradient of gravity."""

import json
import subprocess

import numpy as np
import pytest

import dashpot
from conftest import HOME

try:
    import pinocchio as pin
    from scipy import linalg
except ImportError:
    pin = linalg = None

SLOWEST = 1  # rad/s: slower motions do not count in a margin
STEP = 1.25  # from one factor to the next that is tried
ARMS = {"panda": ("panda_link0", "panda_hand_tcp"), "iiwa14": ("iiwa_link_0", "iiwa_link_ee_kuka"),
        "ur5": ("base_link", "ee_link"), "fr3": ("fr3_link0", "fr3_hand_tcp"),
        "gen3": ("base_link", "end_effector_link"), "xarm7": ("link_base", "link_eef")}


def test_run_and_audit_say_the_same(program, root, tmp_path):
    # The page: tests/web/tune_server_test.py. Random loops in C++: tests/threads/one_loop_test.cpp.
    urdf = dict(zip(("urdf", "base", "tip"), (str(root / "sim/models/panda.urdf"), *ARMS["panda"])))
    arm = {"viscous_friction": [0.3] * 7, "reflected_inertia": [0.2] * 7}
    loop = {"delay": 1, "cutoff": 80}
    path = tmp_path / "loop.yaml"
    path.write_text(json.dumps({
        "robot": urdf | arm | {"payload": {"mass": 0.8}},
        "gains": {"joint": {"stiffness": [50] * 7, "damping": [4] * 7}},
        "control": {"period": 2e-3, "mode": "joint"}, "analysis": {"sampled": loop},
        "limits": {"gain_margin": 1}, "simulation": {"drives": loop},
        "scenario": {"duration": 0.02, "start": {"position": HOME}}}))
    robot = dashpot.Robot.from_urdf(*urdf.values(), **arm, payload_mass=0.8)
    expected = dashpot.audit(robot, HOME, joint_stiffness=[50] * 7, joint_damping=[4] * 7,
                             period=2e-3, **loop).posture
    done = subprocess.run([program, "run", path, "--fast", "--ring-down", "--json"],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    ran = json.loads(done.stdout)["ring_down"]
    assert ran["gain_margin"] == pytest.approx(expected.gain_margin, rel=1e-5)
    assert ran["assumes"] == expected.assumes


def pinocchio_arm(path, base, tip, payload):
    """The chain from `base` to `tip` with all else that hangs on it, rigid at zero."""
    whole = pin.buildModelFromUrdf(str(path))
    frame = whole.getFrameId(tip)
    chain, joint = [], whole.frames[frame].parentJoint
    while joint:
        chain.append(joint)
        joint = whole.parents[joint]
    whole.appendBodyToJoint(whole.frames[frame].parentJoint,
                            pin.Inertia(payload, np.zeros(3), np.zeros((3, 3))),
                            whole.frames[frame].placement)
    locked = [i for i in range(1, whole.njoints) if i not in chain]
    return pin.buildReducedModel(whole, locked, pin.neutral(whole))


def matrices(model, base, tip, q):
    """M, J in the axes of `base`, and dg/dq."""
    data = model.createData()
    q = pin.integrate(model, pin.neutral(model), q)  # where joints turn without limits
    pin.framesForwardKinematics(model, data, q)
    base_axes = data.oMf[model.getFrameId(base)].rotation
    J = pin.computeFrameJacobian(model, data, q, model.getFrameId(tip), pin.LOCAL_WORLD_ALIGNED)
    J = np.vstack([base_axes.T @ J[:3], base_axes.T @ J[3:]])
    M = np.triu(pin.crba(model, data, q))
    G = pin.computeGeneralizedGravityDerivatives(model, data, q)
    return M + np.triu(M, 1).T, J, G


def largest(M, D, G, K, C, period, delay, factor):
    """The largest |z|, of what is not slow, of the loop with `factor` times K and C."""
    n = len(M)
    rate = np.zeros((3 * n, 3 * n))
    rate[:n, n:2 * n] = np.eye(n)
    rate[n:2 * n] = np.linalg.solve(M, np.hstack([-G, -D, np.eye(n)]))
    tick = linalg.expm(period * rate)[:2 * n]
    command = np.hstack([G - factor * K, -factor * C])
    size = (2 + delay) * n
    A = np.zeros((size, size))
    A[:2 * n, :2 * n] = tick[:, :2 * n]
    if delay == 0:
        A[:2 * n, :2 * n] += tick[:, 2 * n:] @ command
    else:
        A[:2 * n, 2 * n:3 * n] = tick[:, 2 * n:]
        A[2 * n:size - n, 3 * n:] = np.eye(size - 3 * n)
        A[size - n:, :2 * n] = command
    z = np.linalg.eigvals(A)
    z = z[np.abs(z) > 1e-12]
    return np.abs(z[np.abs(np.log(z)) / period >= SLOWEST]).max()


def margin(loop):
    """The first boundary above 1, or where the loop is unstable below 1."""
    def stable(factor):
        return largest(*loop, factor) < 1

    low = high = 1.0
    if stable(1):
        while stable(high):
            low, high = high, STEP * high
            if high > 1e6:
                return np.inf
    else:
        while not stable(low):
            low, high = 0.8 * low, low
            if low < 1e-3:
                return 0.0
    while high - low > 1e-10 * high:
        middle = (low + high) / 2
        low, high = (middle, high) if stable(middle) else (low, middle)
    return (low + high) / 2


def random_case(rng, number):
    """Name of the arm, keywords of the robot, keywords of the audit."""
    name = list(ARMS)[number % len(ARMS)]
    n = 6 if name == "ur5" else 7
    robot = {"viscous_friction": rng.uniform(0.02, 0.5, n) * (number % 3 > 0),
             "payload_mass": rng.uniform(0.2, 2) * (number % 4 == 1)}
    if number % 2 == 0:
        robot["reflected_inertia"] = rng.uniform(0.05, 0.4, n)
    loop = {"q": rng.uniform(-1.5, 1.5, n), "period": 1e-3 * rng.integers(1, 5), "delay": int(rng.integers(0, 5))}
    if number % 5 < 2:
        loop |= {"joint_stiffness": np.exp(rng.uniform(2, 5, n)), "joint_damping": np.exp(rng.uniform(-2, 2, n))}
    else:
        units = np.repeat([1, 0.05], 3)
        loop |= {"task_stiffness": units * np.exp(rng.uniform(4, 7, 6)),
                 "task_damping": units * np.exp(rng.uniform(1, 4, 6)),
                 "null_stiffness": rng.uniform(1, 10, n) * (number % 2), "null_damping": rng.uniform(0.1, 2, n)}
    return name, robot, loop


@pytest.mark.skipif(pin is None, reason="needs pinocchio and scipy")
def test_margins_equal_those_of_numpy_on_pinocchio(root):
    seed = 5502
    print("seed", seed)
    rng = np.random.default_rng(seed)
    late = 0
    for number in range(40):
        name, robot, loop = random_case(rng, number)
        path = root / f"sim/models/{name}.urdf"
        base, tip = ARMS[name]
        model = pinocchio_arm(path, base, tip, robot["payload_mass"])
        M, J, G = matrices(model, base, tip, loop["q"])
        M += np.diag(robot.get("reflected_inertia", np.zeros(len(M))))
        if "joint_stiffness" in loop:
            K, C = np.diag(loop["joint_stiffness"]), np.diag(loop["joint_damping"])
        else:
            MJ = np.linalg.solve(M, J.T)
            N = np.eye(len(M)) - MJ @ np.linalg.solve(J @ MJ, J)
            K = J.T @ np.diag(loop["task_stiffness"]) @ J + N.T @ np.diag(loop["null_stiffness"]) @ N
            C = J.T @ np.diag(loop["task_damping"]) @ J + N.T @ np.diag(loop["null_damping"]) @ N
        D = np.diag(robot["viscous_friction"])
        expected = margin((M, D, G, K, C, loop["period"], loop["delay"]))
        arm = dashpot.Robot.from_urdf(path, base, tip, **robot)
        found = dashpot.audit(arm, **loop, outside_limits=True).posture
        ideal = dashpot.audit(arm, **loop, ideal_gravity=True, outside_limits=True).posture
        assert found.gain_margin == pytest.approx(expected, rel=1e-6), (number, name)
        assert "gravity ideal" in ideal.assumes and "gravity ideal" not in found.assumes
        late += abs(ideal.gain_margin - expected) > 1e-3 * expected
    assert late > 3
