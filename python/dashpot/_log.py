"""Logs as arrays."""

from __future__ import annotations

import os
import warnings
from typing import Any, Sequence

import numpy.typing as npt

from . import _core
from ._bags import is_bag, read_bag


def read_log(path: str | os.PathLike[str], *, topics: Sequence[str] | None = None,
             types: Sequence[str] | None = None) -> dict[str, dict[str, npt.NDArray[Any]]]:
    """Returns an LCM log, a rosbag or an MCAP file as a dict of channel (topic) to its messages, a
    dict of field to array. `topics` are names of those wanted; `types` are message types, such as
    "sensor_msgs/msg/JointState" or "JointState", whose topics are wanted besides (not in LCM logs).

    Fields have the names of the messages, parts of fields after a point (pose.position.x), and the
    first index of each array counts the messages. Where messages have different sizes, what is
    missing is NaN, or -1 in arrays of integers of LCM. The field log_utime is when the log got the
    message, us since 1970-01-01 UTC; LCM channels of other programs have no other field. `time` is
    the stamp of a ROS header, s. A JointState has `position`, `velocity` and `effort`, messages x
    joints, with a column for each joint in `name` on the topic, NaN where a message does not have
    it.

    Rosbags are read through the package rosbags, MCAP files through mcap, both from PyPI; messages
    in an MCAP file may be JSON, as dashpot export writes them, or those of ROS 2.

    Raises Error for a file that cannot be read. Warns of a damaged log, and of messages that cannot
    be read or are none of Dashpot's on its channels; both are left out.
    """
    file = os.fspath(path)
    if is_bag(file):
        return read_bag(file, topics, types)
    channels, malformed, damage = _core.read_log(file)
    if damage:
        warnings.warn(f"{file}: {damage}", stacklevel=2)
    for channel, count in malformed.items():
        warnings.warn(f"{file}: {channel}: {count} malformed messages", stacklevel=2)
    if topics is not None:
        return {name: fields for name, fields in channels.items() if name in topics}
    return channels
