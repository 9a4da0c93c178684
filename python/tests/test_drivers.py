"""The messages of `dashpot drive` against the ones that Drake installs."""
import importlib

import pytest

from conftest import ROOT

FINGERPRINTS = {"lcmt_iiwa_command": "ddc7c7738c815334", "lcmt_iiwa_status": "f16fb804284abca3",
                "lcmt_panda_command": "e68df777004d59d0", "lcmt_panda_status": "19571cdf4d82fae6"}
DEFINITIONS = ROOT / "lcmtypes"


@pytest.mark.parametrize("name", FINGERPRINTS)
def test_drake_has_the_same_members(name):
    try:
        message = getattr(importlib.import_module("drake"), name)
    except (ImportError, AttributeError):
        pytest.skip("Drake's messages are not installed")
    assert message._get_packed_fingerprint().hex() == FINGERPRINTS[name]
    text = (DEFINITIONS / f"{name}.lcm").read_text()
    assert all(f" {member}" in text for member in message.__slots__)
