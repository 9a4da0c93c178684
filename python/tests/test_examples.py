"""Each example runs and prints what it is there for."""

import importlib.util
import re
import subprocess
import sys

import pytest

from conftest import ROOT

PANDA, CONFIG = ROOT / "sim/models/panda.urdf", ROOT / "controller/examples/panda.yaml"


def run(name, *arguments):
    done = subprocess.run([sys.executable, "-B", ROOT / "python/examples" / name, *arguments],
                          capture_output=True, text=True, timeout=1200)
    assert done.returncode == 0, done.stderr
    assert "nanobind" not in done.stderr
    return done.stdout


def needs(package):
    return pytest.mark.skipif(importlib.util.find_spec(package) is None,
                              reason=f"{package} is not installed")


def test_audit_gains():
    text = run("audit_gains.py", PANDA, "panda_link0", "panda_hand_tcp")
    worst = float(re.search(r"([\d.]+) \(worst\)\nand", text).group(1))
    assert 0 < worst < 0.26  # at the stretched posture of README.md the slowest mode has 0.26


def test_release():
    """The ratios are the same as in `./run demo`: two dampings ring, the third settles."""
    text = run("release.py", PANDA)
    settled = re.findall(r"to within 2 % of 20 mm in (.*),", text)
    assert settled[0] == "more than 5 s"
    assert float(settled[1].split()[0]) > 2 * float(settled[2].split()[0])
    assert text.count(" 0.7  ") == 6


@needs("nbclient")
@needs("ipykernel")
def test_first_hour(tmp_path):
    """The notebook runs from the package alone, in an empty folder."""
    import nbclient
    import nbformat

    notebook = nbformat.read(ROOT / "python/examples/first_hour.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": tmp_path}}).execute()
    text = "".join(output.get("text", "") for cell in notebook.cells
                   for output in cell.get("outputs", []))
    critical, designed = (float(one) for one in re.findall(r"swings ([\d.]+) mm beyond", text))
    assert designed < 0.5 * critical
    assert text.count("rad/s") == 2


@needs("mujoco")
def test_mujoco_loop():
    text = run("mujoco_loop.py", CONFIG, PANDA)
    assert float(re.search(r"push ([\d.]+) mrad", text).group(1)) > 10
    assert float(re.search(r"later ([\d.]+) mrad", text).group(1)) < 1


@needs("pydrake")
def test_drake_system():
    text = run("drake_system.py", CONFIG, PANDA)
    assert float(re.search(r"later ([\d.]+) mrad", text).group(1)) < 1
