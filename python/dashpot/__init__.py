"""Vibration modes of impedance-controlled robot arms, with proved bounds, and the controller.

Units are SI. The base link is B, the tip or tool frame is T. Twists and wrenches have the linear
part first, at T's origin, in B's axes. Results are read-only and can be pickled.
Input that Dashpot refuses raises dashpot.Error, a ValueError with the program's message.
"""

from importlib.metadata import version as _version

from ._arch import load_core as _load_core

__build__ = _load_core()  # for which processors the code in use was compiled

from ._analysis import (  # isort: skip
    DampingDesign, Miss, Response, SampledModes, design_damping, modes, receptance, response, sampled_modes)
from ._audit import Audit, Contact, DampingSuggestion, Distribution, PostureAudit, WorkspaceAudit, audit, contact
from ._controller import Controller, Setpoint, Snapshot, Status, TrackedModes, TrackedSampledModes
from ._core import Error
from ._identification import Identification, MeasuredModes, identify
from ._log import Log, LoggedMode, read_log
from ._region import RegionDesign, design_region
from ._results import Modes
from ._robot import ClosedLoop, Robot, closed_loop, published_drives

__version__ = _version("dashpot")
__all__ = ["Audit", "ClosedLoop", "Contact", "Controller", "DampingDesign", "DampingSuggestion",
           "Distribution", "Error", "Identification", "Log", "LoggedMode",
           "MeasuredModes", "Miss", "Modes",
           "PostureAudit", "RegionDesign", "Response", "Robot", "SampledModes",
           "Setpoint", "Snapshot", "Status", "TrackedModes", "TrackedSampledModes",
           "WorkspaceAudit", "audit", "closed_loop", "contact", "design_damping", "design_region", "identify",
           "modes", "published_drives", "read_log", "receptance", "response", "sampled_modes"]
