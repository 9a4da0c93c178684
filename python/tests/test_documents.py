"""docs/python.md and docs/command-line.md: transcripts print what they say, and nothing is left out."""

import doctest
import os
import re
import subprocess

import pytest

import dashpot
from conftest import ROOT


def document(name):
    return (ROOT / "docs" / name).read_text(encoding="utf-8")


def test_transcripts():
    before = os.getcwd()
    os.chdir(ROOT)
    try:
        failed, tried = doctest.testfile(str(ROOT / "docs/python.md"), module_relative=False,
                                         optionflags=doctest.ELLIPSIS)
    finally:
        os.chdir(before)
    assert tried > 8 and failed == 0


def members(thing):
    """Returns the names of a class that are not its own business."""
    return [name for name in {*vars(thing), *thing.__annotations__} if not name.startswith("_")]


def test_python_is_described():
    text = document("python.md")
    wanted = list(dashpot.__all__) + members(dashpot.Robot) + members(dashpot.Controller)
    for result in (dashpot.Modes, dashpot.Audit, dashpot.PostureAudit, dashpot.RegionDesign):
        wanted += members(result)
    assert len(wanted) > 80
    assert not [name for name in wanted if not re.search(rf"\b{name}\b", text)]


def help_of(program, *command):
    return subprocess.run([program, *command, "--help"], check=True, text=True,
                          stdout=subprocess.PIPE).stdout


@pytest.fixture(scope="module")
def subcommands(program):
    lines = help_of(program).split("Subcommands:")[1].split("\n\n")[0]
    return re.findall(r"^  (\S+?),? ", lines, re.MULTILINE)


def test_subcommands_are_listed(subcommands):
    rows = document("command-line.md").split("| subcommand |")[1].split("\n\n")[0]
    assert len(subcommands) > 10
    assert not [name for name in subcommands if f"| [`{name}`]" not in rows]


def test_options_are_described(program, subcommands):
    text = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md"))
    missing = []
    for name in subcommands:
        options = help_of(program, name).split("Options:")[1].split("\n\n")[0]
        missing += [f"{name} {option}" for option in re.findall(r"--[a-z-]+", options)
                    if not re.search(rf"{option}(?![a-z-])", text)]
    assert not missing
