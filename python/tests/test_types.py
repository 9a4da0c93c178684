"""What type checkers see of the package."""

import ast
import importlib.util
import pathlib
import re
import subprocess
import sys

import pytest

import dashpot

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
    for wanted in ("numpy.dtype\\[numpy.float", "numpy.str_", "Status"):  # of old numpy: floating
        assert re.search(wanted, done.stdout), done.stdout
    package = subprocess.run([sys.executable, "-m", "mypy", "--strict", "-p", "dashpot"],
                             cwd=tmp_path, capture_output=True, text=True)
    assert package.returncode == 0, package.stdout


def signatures(of_stub):
    """Returns the names of the arguments of each function in the stub, or of what is loaded."""
    core = dashpot._core
    tree = ast.parse((pathlib.Path(dashpot.__file__).parent / "_core.pyi").read_text())
    found = {}

    def take(name, node, loaded):
        names = [argument.arg for argument in (*node.args.posonlyargs, *node.args.args)]
        if not of_stub:
            text = loaded.__nb_signature__[0][0]
            while "[" in text:  # what is in brackets is not all Python
                text = re.sub(r"\[[^\[\]]*\]", "", text)
            loaded = ast.parse(text + ": ...").body[0].args
            names = [argument.arg for argument in (*loaded.posonlyargs, *loaded.args)]
        found[name] = len(names) if node.args.posonlyargs else names  # those have none in C++

    for node in tree.body:
        loaded = getattr(core, getattr(node, "name", ""), None)
        if isinstance(node, ast.FunctionDef):
            take(node.name, node, loaded)
        for part in node.body if isinstance(node, ast.ClassDef) else ():
            if isinstance(part, ast.FunctionDef) and part.name != "__init__" and \
                    not any(getattr(d, "id", "") == "property" for d in part.decorator_list):
                take(f"{node.name}.{part.name}", part, getattr(loaded, part.name))
    return found


def test_the_stub_is_of_what_is_loaded():
    assert signatures(True) == signatures(False)
    tree = ast.parse((pathlib.Path(dashpot.__file__).parent / "_core.pyi").read_text())
    listed = {node.name for node in tree.body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    assert listed == {name for name in dir(dashpot._core) if not name.startswith("__")}
