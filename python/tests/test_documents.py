"""The transcripts of docs/python.md print what they say."""

import doctest
import os

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
