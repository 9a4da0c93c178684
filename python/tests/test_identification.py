"""Modes from recorded motion, against the modes that made it."""

import pickle

import numpy as np
import pytest

import dashpot


def decay(rng, phase=0.0):
    t = 0.002 * np.arange(1200)
    y = np.full((1200, 2), [0.3, -1.0])
    for w, z, shape in ((9, 0.12, [0.02, 0.01]), (14, 0.55, [0.01, -0.02])):
        wave = np.exp(-z * w * t) * np.cos(w * np.sqrt(1 - z * z) * t + phase)
        y += wave[:, np.newaxis] * shape
    return t, y + 1e-5 * rng.standard_normal(y.shape)


def check(found):
    modes = found.modes
    assert len(modes) == 2
    assert np.all(np.abs(modes.natural_frequency - [9, 14]) < 4 * modes.natural_frequency_std)
    assert np.all(np.abs(modes.damping_ratio - [0.12, 0.55]) < 4 * modes.damping_ratio_std)
    assert np.all(modes.natural_frequency_std < 0.02)
    assert np.allclose(modes.shapes[0], np.array([2, 1]) / np.sqrt(5), atol=0.01)


def test_finds_the_friction_of_one_joint():
    t = np.arange(0, 6, 0.01)  # undamped: each half turn takes 2 x 0.02 from the amplitude
    half = 9 * t // np.pi
    y = (0.98 - 0.04 * half) * np.cos(9 * t) + 0.02 * (-1) ** half
    y += 1e-4 * np.random.default_rng(1).normal(size=len(t))
    found = dashpot.identify(t, y, find=False)
    assert found.modes.natural_frequency == pytest.approx([9], abs=0.01)
    assert abs(found.modes.damping_ratio[0]) < 0.001
    assert found.friction == pytest.approx(0.02, rel=0.03)
    assert found.friction_std < 0.001


def test_finds_the_modes_of_a_decay():
    t, y = decay(np.random.default_rng(1))
    found = dashpot.identify(t, y, find=False)
    check(found)
    assert found.explained > 0.9999
    assert found.noise == pytest.approx([1e-5, 1e-5], rel=0.1)
    again = pickle.loads(pickle.dumps(found))
    assert np.array_equal(again.modes.natural_frequency, found.modes.natural_frequency)
    assert not again.modes.shapes.flags.writeable
    assert "rad/s" in repr(found.modes)
    with pytest.warns(UserWarning, match="t has steps of 2 s: is it in ms?"):
        dashpot.identify(1000 * t, y, find=False)
    with pytest.raises(dashpot.Error, match="samples x channels; give its transpose"):
        dashpot.identify(t, y.T)


def test_takes_several_records_with_missing_samples():
    rng = np.random.default_rng(2)
    records = [decay(rng), decay(rng, 1.0)]
    for _, y in records:
        y[rng.random(y.shape) < 0.02] = np.nan
    check(dashpot.identify([t for t, _ in records], [y for _, y in records], find=False))


def test_finds_decays_in_a_record():
    rng = np.random.default_rng(3)
    _, y = decay(rng)
    still = np.full((500, 2), y[0]) + 1e-5 * rng.standard_normal((500, 2))
    found = dashpot.identify(0.002 * np.arange(1700), np.vstack([still, y]))
    check(found)
    (record, begin, end), = found.parts
    assert record == 0 and 0.99 < begin < 1.3 and end > 2
    assert found.verdict == "decay"
    with pytest.raises(dashpot.Error, match="nothing moves beyond the noise"):
        dashpot.identify(0.002 * np.arange(500), still)
    t = 0.01 * np.arange(3000)
    with pytest.raises(dashpot.Error, match="limit cycle: it repeats itself at [45]"):
        dashpot.identify(t, np.sin(5 * t) + 0.02 * np.sin(15 * t) + 1e-5 * rng.standard_normal(3000))


def shaken(rng, seconds):
    """Two oscillators under white forces, 100 Hz."""
    steps = 100 * seconds
    y = np.zeros((steps, 2))
    for w, z, shape in ((9, 0.12, [1, 0.5]), (14, 0.3, [1.5, -3])):
        A = np.array([[0, 1], [-w * w, -2 * z * w]])
        values, vectors = np.linalg.eig(A)
        over = (vectors * np.exp(0.01 * values) @ np.linalg.inv(vectors)).real
        x, wave = np.zeros(2), np.empty(steps)
        pushes = rng.standard_normal((steps, 2)) * [0, 0.3]
        for k in range(steps):
            x = over @ x + pushes[k]
            wave[k] = x[0]
        y += wave[:, np.newaxis] * shape
    return 0.01 * np.arange(steps), y + 1e-5 * rng.standard_normal(y.shape)


def test_finds_the_modes_of_ambient_motion():
    rng = np.random.default_rng(4)
    t, y = shaken(rng, 300)
    found = dashpot.identify(t, y)
    assert found.verdict == "ambient"
    modes = found.modes
    assert len(modes) == 2
    assert np.all(np.abs(modes.natural_frequency - [9, 14]) < 4 * modes.natural_frequency_std)
    assert np.all(np.abs(modes.damping_ratio - [0.12, 0.3]) < 4 * modes.damping_ratio_std)
    assert np.all(modes.natural_frequency_std < [0.3, 0.8])
    assert found.parts == [(0, 0.0, pytest.approx(299.99))]
    with pytest.raises(dashpot.Error, match="takes a longer record"):
        dashpot.identify(t[:300], y[:300], ambient=True)


def chirped(rng, start):
    """Two oscillators that move already when a chirp meets them, 500 Hz, and an input that rests."""
    t = 0.002 * np.arange(3000)
    u = np.sin(2 * np.pi * t * (0.3 + 0.64 * t))
    y = np.zeros((3000, 2))
    for w, z, gain, shape in ((9, 0.12, 0.005, [2, 1]), (24, 0.8, 0.02, [1, -2])):
        A = np.array([[0, 1], [-w * w, -2 * z * w]])
        values, vectors = np.linalg.eig(A)
        over = (vectors * np.exp(0.002 * values) @ np.linalg.inv(vectors)).real
        x = np.array([start, 0.0])
        for k in range(3000):
            y[k] += x[0] * np.array(shape)
            x = over @ (x - [gain * u[k], 0]) + [gain * u[k], 0]
    return t, y + 1e-5 * rng.standard_normal(y.shape), np.column_stack([0 * u, 30 * u])


def test_finds_the_modes_of_motion_under_a_measured_input():
    rng = np.random.default_rng(5)
    records = [chirped(rng, 0.01), chirped(rng, -0.02)]
    t, y, u = ([record[i] for record in records] for i in range(3))
    for found in (dashpot.identify(t, y, input=u), dashpot.identify(t[0], y[0], input=u[0][:, 1])):
        modes = found.modes
        assert len(modes) == 2 and found.verdict == "driven"
        assert np.all(np.abs(modes.natural_frequency - [9, 24]) < 4 * modes.natural_frequency_std)
        assert np.all(np.abs(modes.damping_ratio - [0.12, 0.8]) < 4 * modes.damping_ratio_std)
        assert np.all(modes.natural_frequency_std < [0.02, 0.05])
        assert np.allclose(modes.shapes[0], np.array([2, 1]) / np.sqrt(5), atol=0.01)
    for bad, message in ((u[0][:, 0], "no input moves"), (u[0][:7], "inputs x samples"),
                         (np.full(3000, np.nan), "not finite"), (np.zeros((2, 2, 2)), "3 dim")):
        with pytest.raises(dashpot.Error, match=message):
            dashpot.identify(t[0], y[0], input=bad)
    with pytest.raises(dashpot.Error, match="2 arrays of times, 1 of inputs"):
        dashpot.identify(t, y, input=u[:1])
    with pytest.raises(dashpot.Error, match="no measured input"):
        dashpot.identify(t[0], y[0], input=u[0], ambient=True)


@pytest.mark.parametrize("t, y, message", [
    ([0, 1], [0, 1], "2 samples"),
    (np.zeros(30), np.zeros(30), "time does not rise"),
    (np.arange(30), np.zeros((30, 1, 1)), "3 dimensions"),
    ([np.arange(30)], [], "1 arrays of times"),
    (np.arange(30), np.full(30, np.inf), "infinite"),
    (np.arange(40), np.zeros(30), "as many channels"),
])
def test_refuses(t, y, message):
    with pytest.raises(dashpot.Error, match=message):
        dashpot.identify(t, y, find=False)
