"""Logs as arrays."""

from __future__ import annotations

import dataclasses
import os
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._bags import is_bag, read_bag
from ._core import Error
from ._results import Array, ComplexArray, IntArray, Result, TextArray


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class LoggedMode(Result):
    """One mode of a loop along a log, a row for each of the k messages that have it."""

    time: Array
    """k, s since the first message of modes."""
    tick: IntArray
    """k, the tick that the mode belongs to."""
    natural_frequency: Array
    """k, rad/s."""
    damping_ratio: Array
    """k, no unit."""
    damped_frequency: Array
    """k, rad/s; zero where the eigenvalues are real."""
    eigenvalues: ComplexArray
    """k x 2, 1/s."""
    kind: TextArray
    """k of underdamped, critical, overdamped, undamped, unstable, soft."""
    error_bound: Array
    """k, proved bound of either eigenvalue, 1/s; infinite: not proved."""
    natural_frequency_bound: Array
    """k, proved bound of the natural frequency, rad/s."""
    damping_ratio_bound: Array
    """k, proved bound of the damping ratio."""
    joint_position: Array
    """k x n, the configurations, rad (m)."""
    shapes: ComplexArray
    """k x n, eigenvector of the first eigenvalue."""


class Log(dict[str, dict[str, npt.NDArray[Any]]]):
    """The channels (topics) of a log, each a dict of field to array."""

    def __repr__(self) -> str:
        return "\n".join(["Log", *(f"  {name}: {len(next(iter(fields.values()), ()))} messages of "
                                   f"{len(fields)} fields" for name, fields in self.items())])

    @property
    def modes(self) -> dict[int, LoggedMode]:
        """Returns the modes on DASHPOT_MODES by label, which a mode keeps from message to message;
        empty if the log has none."""
        fields = self.get("DASHPOT_MODES")
        if not fields or "label" not in fields:
            return {}
        there = np.arange(fields["label"].shape[1]) < fields["num_modes"][:, np.newaxis]
        labels = np.where(there, fields["label"], -1)
        return {int(label): _logged_mode(fields, *np.nonzero(labels == label))
                for label in np.unique(labels[there])}


_KINDS = np.array(_core.mode_kinds())


def _logged_mode(fields: dict[str, npt.NDArray[Any]], rows: IntArray, columns: IntArray) -> LoggedMode:
    """Returns the mode that stands in these columns of these messages."""
    def numbers(name: str) -> Any:
        return fields[name][rows, columns]

    time = 1e-6 * (fields["utime"] - fields["utime"][0])
    return LoggedMode(
        time=time[rows], tick=fields["tick"][rows], natural_frequency=numbers("natural_frequency"),
        damping_ratio=numbers("damping_ratio"), damped_frequency=numbers("damped_frequency"),
        eigenvalues=numbers("eigenvalue_real") + 1j * numbers("eigenvalue_imag"),
        kind=_KINDS[numbers("kind").astype(int)], error_bound=numbers("eigenvalue_bound"),
        natural_frequency_bound=numbers("natural_frequency_bound"),
        damping_ratio_bound=numbers("damping_ratio_bound"),
        joint_position=fields["joint_position"][rows],
        shapes=numbers("shape_real") + 1j * numbers("shape_imag"))


def read_log(path: str | os.PathLike[str], *, topics: Sequence[str] | None = None,
             types: Sequence[str] | None = None) -> Log:
    """Returns an LCM log, a rosbag or an MCAP file as a dict of channel (topic) to its messages, a
    dict of field to array, and its `modes` by label. `topics` selects topics by name; `types` adds
    topics by message type, such as "sensor_msgs/msg/JointState" or "JointState" (not in LCM logs).

    Fields have the names of the messages, parts of fields after a point (pose.position.x), and the
    first index of each array counts the messages. If messages have different sizes, missing entries
    are NaN, or -1 in arrays of integers of LCM. The field log_utime is when the log got the
    message, us since 1970-01-01 UTC; LCM channels of other programs have no other field. `time` is
    the stamp of a ROS header, s. A JointState has `position`, `velocity` and `effort`, messages x
    joints, with a column for each joint in `name` on the topic, NaN where a message does not have
    it.

    Rosbags are read through the package rosbags, MCAP files through mcap, both from PyPI; messages
    in an MCAP file may be JSON, as dashpot export writes them, or messages of ROS 2.

    Raises Error for a file that cannot be read. Warns of a damaged log, of unreadable messages, and
    of foreign messages on Dashpot's channels; such messages are left out.
    """
    file = os.fspath(path)
    if is_bag(file):
        return Log(read_bag(file, topics, types))
    channels, malformed, damage = _core.read_log(file)
    if not channels:
        raise Error(f"{file}: has no messages{f' ({damage})' if damage else ''}; LCM logs, rosbags "
                    "and MCAP files are read")
    if damage:
        warnings.warn(f"{file}: {damage}", stacklevel=2)
    for channel, count in malformed.items():
        warnings.warn(f"{file}: {channel}: {count} malformed messages", stacklevel=2)
    return Log((name, fields) for name, fields in channels.items()
               if topics is None or name in topics)
