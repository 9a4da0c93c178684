"""Systems given by matrices, against numpy's and scipy's eigenvalues, and finite differences."""

import json
import pickle
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import scipy.linalg

import dashpot

SEEDS = range(8)


def random_matrix(seed, n, shift):
    print("seed", seed)
    factor = np.random.default_rng(seed).standard_normal((n, n))
    return factor @ factor.T + shift * np.eye(n)


def random_system(seed, n=5):
    return (random_matrix(seed, n, 1), 0.3 * random_matrix(seed + 100, n, 0.5),
            40 * random_matrix(seed + 200, n, 1))


def companion_eigenvalues(M, C, K):
    n = len(M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]])
    B = np.block([[np.eye(n), np.zeros((n, n))], [np.zeros((n, n)), M]])
    return scipy.linalg.eigvals(A, B)


def by_value(values):
    return sorted(values, key=lambda z: (round(z.real, 7), z.imag))


@pytest.mark.parametrize("seed", SEEDS)
def test_eigenvalues_are_those_of_scipy(seed):
    M, C, K = random_system(seed)
    found = dashpot.modes(M, C, K)
    expected = companion_eigenvalues(M, C, K)
    np.testing.assert_allclose(by_value(found.eigenvalues.ravel()), by_value(expected), rtol=1e-9)
    assert found.status == "ok" and len(found) == 5
    assert np.all(np.diff(found.natural_frequency) <= 0)
    product, total = found.eigenvalues.prod(axis=1), found.eigenvalues.sum(axis=1)
    np.testing.assert_allclose(found.natural_frequency, np.sqrt(product.real), rtol=1e-12)
    np.testing.assert_allclose(found.damping_ratio,
                               -total.real / 2 / found.natural_frequency, rtol=1e-12)
    assert np.all(found.error_bound < 1e-9)


def test_each_eigenvalue_has_a_bound_of_its_own():
    found = dashpot.modes(np.eye(2), np.array([[1e6, 1], [1, 2e6]]), np.diag([1.0, 4]))
    assert set(found.kind) == {"overdamped"}
    np.testing.assert_array_equal(found.eigenvalue_bounds.max(axis=1), found.error_bound)
    slow = np.abs(found.eigenvalues[:, 0])
    assert np.all(found.eigenvalue_bounds[:, 0] < 1e-6 * slow)
    assert np.all(found.eigenvalue_bounds[:, 0] < 1e-3 * found.error_bound)


@pytest.mark.parametrize("seed", SEEDS)
def test_shapes_solve_the_equation(seed):
    M, C, K = random_system(seed)
    found = dashpot.modes(M, C, K)
    assert found.shapes.shape == (5, 5)
    for value, u in zip(found.eigenvalues[:, 0], found.shapes):
        residual = (value**2 * M + value * C + K) @ u
        assert np.linalg.norm(residual) < 1e-10 * np.linalg.norm(K) * np.linalg.norm(u)
        assert (u.conj() @ M @ u).real == pytest.approx(1)


def test_zero_modes_store_no_energy():
    K = np.array([[1.0, -1, 0], [-1, 2, -1], [0, -1, 1]])
    found = dashpot.modes(np.diag([1.0, 2, 3]), None, K)
    assert found.zero_modes.shape == (1, 3) and len(found) == 2
    np.testing.assert_allclose(K @ found.zero_modes[0], 0, atol=1e-15)
    assert set(found.kind) == {"undamped"}


def test_modes_are_those_of_the_program(program, tmp_path):
    M, C, K = random_system(3)
    J = np.random.default_rng(4).standard_normal((2, 5))
    file = tmp_path / "system.json"
    file.write_text(json.dumps({"mass": M.tolist(), "damping": C.tolist(), "stiffness": K.tolist(),
                                "jacobian": J.tolist(), "task_stiffness": [[9, 1], [1, 8]],
                                "task_damping": [[2, 0], [0, 3]]}))
    printed = json.loads(subprocess.check_output([program, "analyze", file, "--json"]))
    found = dashpot.modes(M, C, K, jacobian=J, task_stiffness=[[9, 1], [1, 8]],
                          task_damping=[[2, 0], [0, 3]])
    for i, mode in enumerate(printed["modes"]):
        assert mode["kind"] == found.kind[i]
        for name in ("natural_frequency", "damping_ratio", "damped_frequency", "error_bound",
                     "natural_frequency_bound", "damping_ratio_bound", "backward_error"):
            assert mode[name] == pytest.approx(getattr(found, name)[i], rel=1e-9), name
        np.testing.assert_allclose(mode["eigenvalue_bounds"], found.eigenvalue_bounds[i], rtol=1e-9)
        np.testing.assert_allclose([complex(*pair) for pair in mode["shape"]], found.shapes[i],
                                   rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("given, message", [
    (dict(M=np.eye(2), K=np.eye(3)), "stiffness: is 3 x 3, expected 2 x 2"),
    (dict(M=[[1, 0], [0, np.nan]], K=np.eye(2)), r"mass: entry \(2,2\) is not a finite number"),
    (dict(M=np.eye(2), K=[[1, 2], [3, 4]]),
     r"stiffness: is not symmetric: entry \(1,2\) is 2, entry \(2,1\) is 3"),
    (dict(M=-np.eye(2), K=np.eye(2)), "mass: is not positive definite"),
    (dict(M=np.eye(2), K="soft"), "stiffness: could not convert"),
    (dict(M=np.eye(2), K=[[1, 2], [3]]), "stiffness: "),
    (dict(M=3.0), "mass: a matrix is wanted"),
    (dict(M=np.eye(2) * 1j, K=np.eye(2)), "mass: real numbers are wanted"),
])
def test_bad_input_gives_the_programs_messages(given, message):
    with pytest.raises(dashpot.Error, match=message):
        dashpot.modes(**given)
    assert issubclass(dashpot.Error, ValueError)


def test_results_cannot_be_changed_and_survive_pickling():
    found = dashpot.modes(*random_system(1))
    again = pickle.loads(pickle.dumps(found))
    for one in (found, again):
        with pytest.raises(ValueError):
            one.natural_frequency[0] = 1
        with pytest.raises(AttributeError):
            one.status = "changed"
    for name, value in vars(found).items():
        np.testing.assert_array_equal(getattr(again, name), value, err_msg=name)
    assert "overdamped" in repr(dashpot.modes([[1]], [[9]], [[1]]))
    assert len(repr(found).splitlines()) == 2 + len(found)


def test_the_arguments_are_left_alone_whatever_their_layout():
    M, C, K = random_system(2)
    big = np.zeros((10, 10), order="F")
    big[::2, ::2] = K
    kept = big.copy()
    found = dashpot.modes(np.asfortranarray(M), C.astype(">f8"), big[::2, ::2])
    np.testing.assert_array_equal(big, kept)
    np.testing.assert_array_equal(found.eigenvalues, dashpot.modes(M, C, K).eigenvalues)
    assert dashpot.modes([[2]], [[0]], [[8]]).natural_frequency[0] == pytest.approx(2)


def test_responses_are_those_of_the_matrix_exponential():
    M, C, K = random_system(5)
    q, qd, force = np.random.default_rng(6).standard_normal((3, 5))
    impulse = M @ qd
    times = np.array([0, 0.1, 0.5, 2])
    free = dashpot.response(M, C, K, times, initial_position=q, initial_velocity=qd)
    struck = dashpot.response(M, C, K, times, initial_position=q, impulse=impulse)
    pushed = dashpot.response(M, C, K, times, force=force)
    A = np.block([[np.zeros((5, 5)), np.eye(5)],
                  [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    rest = np.linalg.solve(K, force)
    for i, t in enumerate(times):
        flow = scipy.linalg.expm(A * t)
        expected = flow @ np.concatenate([q, qd])
        np.testing.assert_allclose(free.position[i], expected[:5], atol=1e-10)
        np.testing.assert_allclose(free.velocity[i], expected[5:], atol=1e-9)
        np.testing.assert_allclose(struck.position[i], expected[:5], atol=1e-10)
        step = rest + flow[:5, :5] @ -rest
        np.testing.assert_allclose(pushed.position[i], step, atol=1e-10)
    H = dashpot.receptance(M, C, K, 3.0)
    np.testing.assert_allclose(H @ (K + 3j * C - 9 * M), np.eye(5), atol=1e-10)
    assert np.array_equal(dashpot.receptance(M, C, K, [3.0, 5.0])[0], H)
    with pytest.raises(dashpot.Error):
        dashpot.response(M, C, K, times, force=[1, 2])


def test_shares_are_those_of_undamped_modes_where_damping_is_proportional():
    M, _, K = random_system(5)
    q, qd = np.random.default_rng(9).standard_normal((2, 5))
    squares, V = scipy.linalg.eigh(K, M)
    energy = (squares * (V.T @ M @ q)**2 + (V.T @ M @ qd)**2)[::-1]
    found = dashpot.response(M, 0.01 * M, K, [], initial_position=q, initial_velocity=qd)
    np.testing.assert_allclose(found.energy_share, energy / energy.sum(), atol=1e-10)
    assert abs(found.cross_share) < 1e-10 and found.zero_mode_share == 0
    row = np.ones((1, 5))
    at = dashpot.response(M, 0 * M, K, [], initial_position=q, points=row).amplitude
    np.testing.assert_allclose(at[:, 0], abs(row @ V * (V.T @ M @ q))[0, ::-1], atol=1e-10)
    with pytest.raises(dashpot.Error):
        dashpot.response(M, None, K, [], initial_position=q, points=np.ones((1, 4)))


def test_sampled_modes_are_those_of_the_map_from_tick_to_tick():
    m, c, k, period = 2.0, 3.0, 50.0, 0.01
    found = dashpot.sampled_modes([[m]], [[c]], [[k]], period=period)
    hold = np.array([[1, period], [0, 1]])
    gain = np.array([[period**2 / 2 / m], [period / m]])
    expected = np.linalg.eigvals(hold - gain @ np.array([[k, c]]))
    np.testing.assert_allclose(by_value(found.discrete_eigenvalues[0]), by_value(expected))
    assert found.spectral_radius == pytest.approx(max(abs(expected)))
    grown = found.gain_margin
    edge = np.linalg.eigvals(hold - grown * gain @ np.array([[k, c]]))
    assert max(abs(edge)) == pytest.approx(1, abs=1e-5)
    with pytest.raises(dashpot.Error, match="period"):
        dashpot.sampled_modes([[m]], [[c]], [[k]], period=0)


def test_an_integral_makes_a_slow_mode():
    m, c, k, period, time = 2.0, 40.0, 800.0, 0.002, 0.5
    found = dashpot.sampled_modes([[m]], [[c]], [[k]], period=period, integral_time=time)
    step = np.array([[1, period, 0], [0, 1, 0], [period * k / time, 0, 1]])
    gain = np.array([[period**2 / 2 / m], [period / m], [0]])
    expected = np.linalg.eigvals(step - gain @ np.array([[k, c, 1]]))
    assert found.memory == pytest.approx([max(expected.real)])
    design = dashpot.design_damping([[m]], jacobian=[[1]], task_stiffness=[[k]], period=period,
                                    integral_time=time)
    assert len(design.sampled.memory) == 1 and np.log(design.sampled.memory[0].real) < 0
    for wrong in (dict(integral_time=-1), dict(integral_time=np.nan)):
        with pytest.raises(dashpot.Error, match="integral_time"):
            dashpot.sampled_modes([[m]], [[c]], [[k]], period=period, **wrong)
    with pytest.raises(dashpot.Error, match="task_stiffness"):
        dashpot.design_damping([[m]], jacobian=[[1]], task_stiffness=np.eye(2), period=period,
                               integral_time=time)


def test_designed_damping_gives_the_ratio():
    M, _, K = random_system(9)
    J = np.random.default_rng(10).standard_normal((3, 5))
    full = dashpot.design_damping(M, jacobian=J, task_stiffness=np.diag([5.0, 6, 7]),
                                  damping_ratio=0.6)
    assert full.damping.shape == (3, 3) and not full.misses
    C = J.T @ full.damping @ J
    moving = [z for z in companion_eigenvalues(M, C, J.T @ np.diag([5.0, 6, 7]) @ J) if abs(z) > 1e-4]
    np.testing.assert_allclose(-np.real(moving) / np.abs(moving), 0.6, rtol=1e-6)
    diagonal = dashpot.design_damping(M, K, damping_ratio=0.6, structure="diagonal")
    assert np.count_nonzero(diagonal.damping - np.diag(np.diag(diagonal.damping))) == 0
    assert all(miss.reason == "structure" for miss in diagonal.misses)
    fast = dashpot.design_damping(M, K, damping_ratio=0.9, period=0.01, delay=1)
    assert fast.sampled is not None and fast.sampled.gain_margin >= 2 * (1 - 1e-6) and fast.kept
    with pytest.raises(dashpot.Error, match="structure"):
        dashpot.design_damping(M, K, structure="triangular")


def test_two_threads_at_once_find_what_one_finds():
    systems = [random_system(seed, 12) for seed in range(6)]
    alone = [dashpot.modes(*system).eigenvalues for system in systems]
    wrong = []

    def work():
        for _ in range(10):
            for system, expected in zip(systems, alone):
                if not np.array_equal(dashpot.modes(*system).eigenvalues, expected):
                    wrong.append(system)

    threads = [threading.Thread(target=work) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_long_calls_leave_the_interpreter_to_others():
    """A thread that wakes now and then gets in during a call that takes long."""
    system = random_system(11, 60)
    woken, done = [0], threading.Event()

    def wake():
        while not done.is_set():
            time.sleep(1e-4)
            woken[0] += 1

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1000)  # otherwise the interpreter would let it in by itself
    thread = threading.Thread(target=wake)
    try:
        thread.start()
        before = woken[0]
        dashpot.modes(*system)
        after = woken[0]
    finally:
        done.set()
        sys.setswitchinterval(interval)
        thread.join()
    assert after > before
