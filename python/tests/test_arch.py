"""Which of the package's builds is loaded."""

import os
import platform
import subprocess
import sys

import pytest

import dashpot

BUILDS = ("x86-64-v2", "x86-64-v3")
PRINT = ("import dashpot, numpy; "
         "modes = dashpot.modes(numpy.eye(2), 0.1 * numpy.eye(2), numpy.diag([1.0, 4.0])); "
         "print(dashpot.__build__, dashpot._core.__build__, dashpot._core.__name__, "
         "dashpot._core.__file__.count(dashpot.__build__), modes.natural_frequency.sum())")


def load(**environment):
    return subprocess.run([sys.executable, "-c", PRINT], env={**os.environ, **environment},
                          capture_output=True, text=True)


def able():
    with open("/proc/cpuinfo", encoding="ascii") as file:
        return {"avx2", "fma", "bmi2"} <= set(file.read().split())


@pytest.mark.skipif(platform.machine() != "x86_64", reason="one build on this machine")
def test_the_build_is_that_of_the_processor_or_of_the_environment():
    best = BUILDS[1] if able() else BUILDS[0]
    environment = {"DASHPOT_ARCH": ""}
    assert load(**environment).stdout.split()[0] == best
    for build in BUILDS[:1 + able()]:
        found = load(DASHPOT_ARCH=build)
        assert found.returncode == 0, found.stderr
        in_folder = "1" if build == BUILDS[1] else "0"
        assert found.stdout.split() == [build, build, "dashpot._core", in_folder, "3.0"]


def test_a_build_that_there_is_not_is_an_import_error():
    found = load(DASHPOT_ARCH="x86-64-v9")
    assert found.returncode != 0
    assert "ImportError: DASHPOT_ARCH: this package has no build for 'x86-64-v9'" in found.stderr


def test_a_processor_without_the_registers_gets_the_plain_build(monkeypatch):
    arch = sys.modules["dashpot._arch"]
    monkeypatch.setattr(arch, "_flags", lambda: {"avx", "avx2"})
    monkeypatch.setenv("DASHPOT_ARCH", "x86-64-v3")
    with pytest.raises(ImportError, match="this processor cannot run x86-64-v3|has no build"):
        arch.load_core()
    assert dashpot.__build__ == dashpot._core.__build__
