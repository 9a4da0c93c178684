"""What the tests share: the top of the tree, the program, a Panda."""

import os
import pathlib

import pytest

import dashpot

ROOT = pathlib.Path(__file__).resolve().parents[2]
HOME = (0, -0.785, 0, -2.356, 0, 1.571, 0.785)


@pytest.fixture(scope="session")
def root():
    return ROOT


@pytest.fixture(scope="session")
def program():
    """The program dashpot, which prints the same numbers; skips if it was not built."""
    path = pathlib.Path(os.environ.get("DASHPOT_PROGRAM", ROOT / "build/release/dashpot"))
    if not path.exists():
        pytest.skip("the program was not built (./run build)")
    return path


@pytest.fixture(scope="session")
def plugin():
    path = ROOT / "build/release/libdashpot_plugin.so"
    if not path.exists():
        pytest.skip("the plugin was not built (./run build)")
    return path


@pytest.fixture(scope="session")
def panda():
    return dashpot.Robot.from_urdf(ROOT / "sim/models/panda.urdf", "panda_link0", "panda_hand_tcp")


@pytest.fixture
def config():
    """The least that makes a controller."""
    return {"robot": {"urdf": str(ROOT / "sim/models/panda.urdf"), "base": "panda_link0",
                      "tip": "panda_hand_tcp"}}
