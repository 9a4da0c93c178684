"""LCM logs as arrays."""

from __future__ import annotations

import os
import warnings
from typing import Any

import numpy.typing as npt

from . import _core


def read_log(path: str | os.PathLike[str]) -> dict[str, dict[str, npt.NDArray[Any]]]:
    """Returns an LCM log as a dict of channel to its messages, a dict of field to array.

    Fields have the names of lcmtypes/*.lcm, and the first index of each array counts the messages.
    Where messages have different sizes, what is missing is NaN, or -1 in arrays of integers. The
    field log_utime is when the log got the message, us since 1970-01-01 UTC; channels of other
    programs have no other field.

    Raises Error for a file that cannot be read. Warns of a damaged log, and of messages that are
    none of Dashpot's on its channels; both are left out.
    """
    channels, malformed, damage = _core.read_log(os.fspath(path))
    if damage:
        warnings.warn(f"{os.fspath(path)}: {damage}", stacklevel=2)
    for channel, count in malformed.items():
        warnings.warn(f"{os.fspath(path)}: {channel}: {count} malformed messages", stacklevel=2)
    return channels
