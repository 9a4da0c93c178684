"""Logs of `dashpot run`, against what the program itself says of them."""

import csv
import subprocess

import numpy as np
import pytest

import dashpot
from conftest import ROOT


@pytest.fixture(scope="module")
def released(program, tmp_path_factory):
    directory = tmp_path_factory.mktemp("log")
    subprocess.check_call([program, "run", ROOT / "sim/scenes/panda_release_c2.yaml", "--fast",
                           "--duration", "1", "--log", directory / "log.lcm", "--csv",
                           directory / "log.csv"], stdout=subprocess.DEVNULL)
    return directory


def test_a_log_says_what_the_program_measured(released):
    log = dashpot.read_log(released / "log.lcm")
    states = log["DASHPOT_STATE"]
    assert f"  DASHPOT_STATE: {len(states['tick'])} messages of {len(states)} fields" in repr(log)
    rows = list(csv.DictReader(open(released / "log.csv")))
    assert states["tick"].shape == (len(rows),)
    assert states["joint_position"].shape == (len(rows), 7)
    assert states["verdicts"].shape == (len(rows), 16)
    assert np.all(np.diff(states["tick"]) == 1) and np.all(np.diff(states["log_utime"]) >= 0)
    for i in range(7):
        name = f"q{i + 1} [rad]"
        np.testing.assert_allclose(states["joint_position"][:, i], [float(row[name]) for row in rows],
                                   rtol=1e-6, atol=1e-9)


def test_modes_in_a_log_are_those_of_the_posture(released, panda):
    modes = dashpot.read_log(released / "log.lcm")["DASHPOT_MODES"]
    found = dashpot.closed_loop(panda, modes["joint_position"][-1],
                                task_stiffness=[2000, 600, 2000, 100, 100, 100],
                                task_damping=[22.5, 23.5, 45, 2, 12, 1])
    assert modes["eigenvalue_real"].shape == (len(modes["tick"]), modes["num_modes"].max(), 2)
    count = modes["num_modes"][-1]
    np.testing.assert_allclose(modes["natural_frequency"][-1, :6],
                               found.modes.natural_frequency[:6], rtol=0.05)
    assert np.isnan(modes["natural_frequency"][-1, count:]).all()


def test_modes_by_label_are_those_of_each_message(released):
    log = dashpot.read_log(released / "log.lcm")
    fields, modes = log["DASHPOT_MODES"], log.modes
    assert list(modes) == sorted(set(fields["label"][fields["label"] >= 0].tolist()))
    rows = 0
    for label, mode in modes.items():
        assert np.all(np.diff(mode.tick) > 0) and np.all(np.diff(mode.time) > 0)
        assert mode.shapes.shape == mode.joint_position.shape == (len(mode.tick), 7)
        for i in range(0, len(mode.tick), 37):
            row = fields["tick"].tolist().index(mode.tick[i])
            column = fields["label"][row].tolist().index(label)
            assert mode.natural_frequency[i] == fields["natural_frequency"][row, column]
            assert mode.eigenvalues[i, 1].imag == fields["eigenvalue_imag"][row, column, 1]
            np.testing.assert_allclose(abs(mode.eigenvalues[i].prod()), mode.natural_frequency[i] ** 2)
            assert mode.kind[i] == ("underdamped" if mode.damping_ratio[i] < 1 else "overdamped")
            assert mode.shapes[i, 3].real == fields["shape_real"][row, column, 3]
        rows += len(mode.tick)
    assert rows == fields["num_modes"].sum()
    assert dashpot.read_log(released / "log.lcm", topics=["DASHPOT_STATE"]).modes == {}


def test_damage_is_left_out_and_said(released, tmp_path):
    whole = (released / "log.lcm").read_bytes()
    count = len(dashpot.read_log(released / "log.lcm")["DASHPOT_STATE"]["tick"])
    cut = tmp_path / "cut.lcm"
    cut.write_bytes(whole[:len(whole) // 2 + 10])
    with pytest.warns(UserWarning, match="cut.lcm: .*cut off"):
        half = dashpot.read_log(cut)["DASHPOT_STATE"]
    assert 0.4 * count < len(half["tick"]) < 0.6 * count
    empty = tmp_path / "empty.lcm"
    for text in ("", "robot: {}\n"):
        empty.write_text(text)
        with pytest.raises(dashpot.Error, match="has no messages"):
            dashpot.read_log(empty)
    with pytest.raises(dashpot.Error, match="no-such.lcm: .*No such file"):
        dashpot.read_log("no-such.lcm")
