"""Chooses the fastest module _core for this processor."""

from __future__ import annotations

import importlib.util
import os
import pathlib
import platform
import sys

_FAST = "x86-64-v3"
# Features that x86-64-v3 means beyond x86-64-v2, as Linux calls them.
_FEATURES = {"avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe", "xsave"}


def _flags() -> set[str]:
    """Returns the processor's features. The kernel lists AVX only if it keeps the registers of AVX."""
    try:
        with open("/proc/cpuinfo", encoding="ascii", errors="replace") as file:
            for line in file:
                if line.startswith("flags"):
                    return set(line.partition(":")[2].split())
    except OSError:
        pass
    return set()


def load_core() -> str:
    """Imports dashpot._core and returns for which processors it was compiled: x86-64-v3 if the
    package has that build and the processor has the features. The environment variable
    DASHPOT_ARCH selects a build instead; ImportError if it is missing, or if this processor cannot
    run it."""
    folder = pathlib.Path(__file__).parent / _FAST
    builds = sorted(folder.glob("_core.*"))
    wanted = os.environ.get("DASHPOT_ARCH", "")
    able = platform.machine() in ("x86_64", "AMD64") and _FEATURES <= _flags()
    if wanted == _FAST and builds and not able:
        raise ImportError(f"DASHPOT_ARCH: this processor cannot run {_FAST}")
    if builds and wanted in ("", _FAST) and able:
        name = f"{__package__}._core"
        spec = importlib.util.spec_from_file_location(name, builds[0])
        assert spec is not None and spec.loader is not None
        core = importlib.util.module_from_spec(spec)
        sys.modules[name] = core
        spec.loader.exec_module(core)
        setattr(sys.modules[str(__package__)], "_core", core)  # noqa: B010  # a module has no such attribute
    from . import _core
    if wanted not in ("", _core.__build__):
        raise ImportError(f"DASHPOT_ARCH: this package has no build for '{wanted}'")
    return _core.__build__
