"""docs/python.md: transcripts print what they say, and nothing is left out."""

import doctest
import os
import re

import dashpot
from conftest import ROOT


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
    text = (ROOT / "docs/python.md").read_text(encoding="utf-8")
    wanted = list(dashpot.__all__) + members(dashpot.Robot) + members(dashpot.Controller)
    for result in (dashpot.Modes, dashpot.Audit, dashpot.PostureAudit, dashpot.RegionDesign):
        wanted += members(result)
    assert len(wanted) > 80
    assert not [name for name in wanted if not re.search(rf"\b{name}\b", text)]
