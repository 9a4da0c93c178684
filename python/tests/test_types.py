"""What type checkers see of the package."""

import importlib.util
import subprocess
import sys

import pytest

PROGRAM = """
import dashpot
robot = dashpot.Robot.from_urdf("a.urdf", "a", "b")
reveal_type(robot.mass([0.0]))
reveal_type(dashpot.modes([[1]], [[0]], [[1]]).kind)
reveal_type(dashpot.Controller("a.yaml").update(0.0, [0], [0])[1])
dashpot.modes()
"""


@pytest.mark.skipif(importlib.util.find_spec("mypy") is None, reason="mypy is not installed")
def test_types_are_known(tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM)
    done = subprocess.run([sys.executable, "-m", "mypy", "--strict", "program.py"], cwd=tmp_path,
                          capture_output=True, text=True)
    assert done.stdout.count("error:") == 1 and 'Missing positional argument "M"' in done.stdout
    for wanted in ("float64", "str_", "Status"):
        assert wanted in done.stdout, done.stdout
    package = subprocess.run([sys.executable, "-m", "mypy", "--strict", "-p", "dashpot"],
                             cwd=tmp_path, capture_output=True, text=True)
    assert package.returncode == 0, package.stdout
