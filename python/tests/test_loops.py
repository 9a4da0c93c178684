"""One loop: all commands and Python report the same modes and gain margins of the same arm. numpy
computes the same margins from Pinocchio's mass matrix, Jacobian and gradient of gravity."""

import http.client
import json
import signal
import subprocess

import numpy as np
import pytest

import dashpot

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


def words(values):
    return ",".join(repr(float(value)) for value in values)


def said(program, *options):
    """The program's JSON; None if it refuses."""
    done = subprocess.run([program, *map(str, options), "--json"], capture_output=True, text=True)
    assert done.returncode in (0, 1, 2), done.stderr
    return json.loads(done.stdout) if done.returncode == 0 else None


def said_by_page(program, config, q):
    """The answer of `dashpot tune` to the design that it has of a configuration."""
    server = subprocess.Popen([program, "tune", config, "--port", "0", "--q", words(q)],
                              stdout=subprocess.PIPE, text=True)
    try:
        host = server.stdout.readline().split("/")[2]

        def ask(method, path, body=None, **headers):
            connection = http.client.HTTPConnection(host, timeout=1200)
            connection.request(method, path, body, headers)
            return json.loads(connection.getresponse().read())

        setup = ask("GET", "/setup")
        body = json.dumps({"q": list(q), "place": "tip/0", "design": setup["designs"][0]})
        return ask("POST", "/design", body, **{"Content-Type": "application/json",
                                               "X-Dashpot-Token": setup["token"]})
    finally:
        server.send_signal(signal.SIGINT)
        server.wait()
        server.stdout.close()


def any_case(rng, number, root):
    """Configuration and posture of any arm, with drives, gears, payload, friction or without."""
    name = list(ARMS)[number % len(ARMS)]
    n = 6 if name == "ur5" else 7
    path, (base, tip) = str(root / f"sim/models/{name}.urdf"), ARMS[name]
    robot = {"urdf": path, "base": base, "tip": tip,
             "viscous_friction": (rng.uniform(0.02, 0.5, n) * (number % 3 > 0)).tolist()}
    if number % 4 < 3:
        robot["reflected_inertia"] = rng.uniform(0.05, 0.4, n).tolist()
    if number % 8 == 1:
        robot |= {"gear_stiffness": rng.uniform(5e3, 2e4, n).tolist(),
                  "gear_damping": rng.uniform(5, 20, n).tolist()}
    if number % 5 < 2:
        robot["payload"] = {"mass": rng.uniform(0.2, 2)}
    units = np.repeat([1, 0.05], 3)
    gains = {"joint": {"stiffness": np.exp(rng.uniform(2, 5, n)).tolist(),
                       "damping": np.exp(rng.uniform(-2, 2, n)).tolist()},
             "task": {"stiffness": (units * np.exp(rng.uniform(4, 7, 6))).tolist(),
                      "damping": (units * np.exp(rng.uniform(1, 4, 6))).tolist(),
                      "frame": "tool" if number % 10 == 3 else "base"},
             "null_space": {"stiffness": (rng.uniform(1, 10, n) * (number % 2)).tolist(),
                            "damping": rng.uniform(0.1, 2, n).tolist()}}
    config = {"robot": robot, "gains": gains,
              "control": {"period": 1e-3 * int(rng.integers(1, 5)),
                          "mode": "joint" if number % 3 == 0 else "cartesian"},
              "limits": {"gain_margin": 1},
              "analysis": {"sampled": {"delay": int(rng.integers(0, 5)),
                                       "cutoff": rng.uniform(30, 100) * (number % 7 == 0)}},
              "integral": {"time": rng.uniform(1, 3)} if number % 9 == 0 else {}}
    arm = dashpot.Robot.from_urdf(path, base, tip)
    lower, upper = np.maximum(arm.lower, -3), np.minimum(arm.upper, 3)
    reach = np.minimum(1.2, 0.4 * (upper - lower))
    return config, (lower + upper) / 2 + reach * rng.uniform(-1, 1, n)


def keywords_of(config):
    """The keywords of from_urdf and of audit for a configuration."""
    robot = {key: value for key, value in config["robot"].items()
             if key not in ("urdf", "base", "tip", "payload")}
    robot["payload_mass"] = config["robot"].get("payload", {}).get("mass", 0)
    gains, joint = config["gains"], config["control"]["mode"] == "joint"
    if joint:
        given = {f"joint_{key}": gains["joint"][key] for key in ("stiffness", "damping")}
    else:
        given = {f"{part.split('_')[0]}_{key}": gains[part][key] for part in ("task", "null_space")
                 for key in ("stiffness", "damping")} | {"frame": gains["task"]["frame"]}
    loop = {"period": config["control"]["period"], "integral_time": config["integral"].get("time", 0),
            **config["analysis"]["sampled"]}
    return robot, given, loop


def options_of(config, loop):
    """Arm and loop on the command line."""
    robot = config["robot"]
    options = ["--urdf", robot["urdf"], "--base", robot["base"], "--tip", robot["tip"]]
    for key in ("viscous_friction", "reflected_inertia", "gear_stiffness", "gear_damping"):
        if key in robot:
            options += [f"--{key.replace('_', '-')}", words(robot[key])]
    if "payload" in robot:
        options += ["--payload", repr(robot["payload"]["mass"])]
    for key, value in loop.items():
        if value:
            options += [f"--{key.replace('_', '-')}", repr(value)]
    return options


def same_modes(found, expected):
    """Eigenvalues, independent of the pairing of overdamped modes."""
    def sorted_of(values):
        values = np.asarray(values).reshape(-1)
        return values[np.lexsort((values.imag, np.round(abs(values), 9)))]

    found = [complex(*value) for mode in found for value in mode["eigenvalues"]]
    found, expected = sorted_of(found), sorted_of(expected)
    assert len(found) == len(expected)
    np.testing.assert_allclose(abs(found), abs(expected), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.real, expected.real, rtol=1e-6, atol=1e-6)


def same_margin(found, expected):
    if np.isinf(expected):
        assert found is None or found == 1e6
    else:
        assert found == pytest.approx(expected, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("part", range(4))  # any number of parts: each has other cases
def test_all_commands_say_the_same(program, root, tmp_path, part):
    seed = 5510 + part
    print("seed", seed)
    rng = np.random.default_rng(seed)
    designed = rung = 0
    for number in range(10 * part, 10 * part + 10):
        config, q = any_case(rng, number, root)
        robot, gains, loop = keywords_of(config)
        path = tmp_path / f"{number}.yaml"
        path.write_text(json.dumps(config))
        arm = dashpot.Robot.from_urdf(*(config["robot"][key] for key in ("urdf", "base", "tip")), **robot)
        expected = dashpot.audit(arm, q, **gains, **loop).posture
        printed = said(program, "audit", *options_of(config, loop), "--gains", path, "--mode",
                       config["control"]["mode"], "--q", words(q))["posture"]
        shown = said_by_page(program, path, q)
        for found in (printed, shown):
            same_modes(found["modes"], expected.modes.eigenvalues)
            same_margin(found["gain_margin"], expected.gain_margin)
            assert found["assumes"] == expected.assumes
        # The damping that `design` proposes has in an audit the margin that it reports.
        if "joint_stiffness" in gains:
            springs = ["--joint-stiffness", words(gains["joint_stiffness"])]
        else:
            springs = ["--task-stiffness", words(gains["task_stiffness"]), "--null-damping",
                       words(gains["null_damping"])]
        proposed = said(program, "design", *options_of(config, loop), *springs, "--q", words(q),
                        "--damping-ratio", "0.7", "--margin", "1.01")
        if proposed is not None:
            key = "joint" if "joint_stiffness" in gains else "task"
            other = {f"{key}_stiffness": gains[f"{key}_stiffness"],
                     f"{key}_damping": proposed.get("task_damping", proposed.get("damping"))}
            if key == "task":
                other["null_damping"] = gains["null_damping"]
            audited = dashpot.audit(arm, q, **other, **loop).posture
            same_margin(proposed["loop"]["gain_margin"], audited.gain_margin)
            same_modes(proposed["after"]["modes"], audited.modes.eigenvalues)
            assert proposed["assumes"] == expected.assumes
            designed += 1
        # `run` has the loop of its drives, where the controller takes the gains.
        if number % 5 or not expected.gain_margin > 1.2:
            continue
        sampled = config["analysis"]["sampled"]
        path.write_text(json.dumps(config | {
            "simulation": {"drives": dict(sampled)},
            "scenario": {"duration": 0.02, "start": {"position": q.tolist()}}}))
        ran = said(program, "run", path, "--fast", "--ring-down")
        if ran is not None:
            same_margin(ran["ring_down"]["gain_margin"], expected.gain_margin)
            assert ran["ring_down"]["assumes"] == expected.assumes
            rung += 1
    print("designs:", designed, "ring-downs:", rung)
    assert designed >= 4


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
