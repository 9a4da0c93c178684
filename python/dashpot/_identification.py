"""Modes from recorded motion."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._core import Error
from ._results import Array, ComplexArray, Result, TextArray, stack, table, to_numbers


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class MeasuredModes(Result):
    """m modes that records show, by rising natural frequency, with standard deviations (std) of the
    estimates."""

    natural_frequency: Array
    """m, rad/s."""
    natural_frequency_std: Array
    """m, rad/s; infinite where it is not determined."""
    damping_ratio: Array
    """m."""
    damping_ratio_std: Array
    """m; infinite where it is not determined."""
    eigenvalues: ComplexArray
    """m x 2, 1/s."""
    shapes: ComplexArray
    """m x channels, unit length, largest entry real and positive."""
    stability: Array
    """m, share of the models of higher order that show the mode too, 0 to 1."""
    energy: Array
    """m, its share of the motion."""
    reason: TextArray
    """m, why it is rejected; empty if it is believed."""

    def __len__(self) -> int:
        return len(self.natural_frequency)

    def __repr__(self) -> str:
        if len(self) == 0:
            return "no modes"
        return table({"rad/s": list(map(float, self.natural_frequency)),
                      "std": [f"{value:.2g}" for value in self.natural_frequency_std],
                      "ratio": list(map(float, self.damping_ratio)),
                      "std ": [f"{value:.2g}" for value in self.damping_ratio_std]})


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Identification(Result):
    """What records say about an arm's modes."""

    modes: MeasuredModes
    rejected: MeasuredModes
    """Modes that are not believed, with reasons."""
    parts: list[tuple[int, float, float]]
    """The parts that were used: number of the record, beginning and end, s."""
    verdict: str
    """What the records show: "decay", "ambient" or "driven"."""
    noise: Array
    """Standard deviation of the residual of each channel."""
    whiteness: float
    """Factor on variances, above 1 if the residual is not white."""
    explained: float
    """Share of the squares of the motion that the model explains; with ambient=True of the
    correlations of one half of the records by the other half's model."""
    order: int
    """Eigenvalues of the model."""
    friction: float
    """Coulomb friction of one channel's decays, as the deflection whose spring it balances, in the
    channel's unit; 0: the model has none."""
    friction_std: float
    """Its standard deviation."""


def _measured(found: dict[str, Any], channels: int) -> MeasuredModes:
    shapes = stack(found.pop("shapes"), (channels,), complex)
    return MeasuredModes(shapes=shapes, reason=np.array(found.pop("reason"), dtype=np.str_),
                         **found)


def _columns(name: str, what: str, given: Any, records: int, many: bool) -> list[Array]:
    arrays = list(given) if many else [given]
    if len(arrays) != records:
        raise Error(f"identify: {records} arrays of times, {len(arrays)} of {what}")
    columns = []
    for each in arrays:
        array = np.asarray(each, dtype=float)
        if array.ndim == 1:
            array = array[:, np.newaxis]
        if array.ndim != 2:
            raise Error(f"{name}: has {array.ndim} dimensions, expected samples x {what}")
        columns.append(np.ascontiguousarray(array.T))
    return columns


def _check_rows(name: str, what: str, values: Sequence[Array], times: Sequence[Array]) -> None:
    """Raises Error for records that have their samples side by side."""
    for value, time in zip(values, times):
        if value.shape[1] != len(time) and value.shape[0] == len(time):
            raise Error(f"{name}: has {len(time)} columns and {value.shape[1]} rows, expected "
                        f"{len(time)} samples x {what}; give its transpose")


def _topic(joints: Mapping[str, Any]) -> tuple[Array, Array]:
    """Times and positions of a topic of JointState, of the joints and messages that have both."""
    for field in ("time", "position"):
        if field not in joints:
            raise Error(f"identify: the topic has no {field}, which a topic of JointState has")
    position = np.asarray(joints["position"], float)
    seen = np.isfinite(position)
    position = position[:, seen.mean(axis=0) > 0.5]  # without joints that others publish
    complete = np.isfinite(position).all(axis=1)
    time = np.asarray(joints["time"], float)[complete]
    return time - (time[0] if time.size else 0), position[complete]


def identify(t: npt.ArrayLike | Sequence[npt.ArrayLike] | Mapping[str, Any],
             y: npt.ArrayLike | Sequence[npt.ArrayLike] | None = None, *,
             input: npt.ArrayLike | Sequence[npt.ArrayLike] | None = None, find: bool = True,
             ambient: bool = False, max_order: int = 0) -> Identification:
    """Returns the modes that records of motion show: free decays, motion under measured inputs, or
    ambient motion.

    `t` has the times (N, s, rising, not necessarily even) and `y` the channels (N x channels, or N
    for one channel) of a record; NaN is a missing sample. Instead of both, `t` may be a
    topic of JointState as read_log returns it, whose positions are the channels. Lists of such
    arrays are several records at one posture. The motion decides whether a record has free decays,
    after a push, a release or a step, which are searched for, or is ambient; records of another kind
    than the first are left out. With find=False each record is one free decay. `input` (N x inputs,
    or N for one input; no missing samples; a list of such arrays for several records) is what moved
    the arm from outside from each sample to the next, such as a chirp or pulses. It explains the
    whole records (least squares in the frequency domain with one denominator, Guillaume et al. 2003,
    refined to the maximum of the likelihood); constant inputs are left out. With ambient=True many
    small, irregular, unmeasured forces shake the arm for a minute or more (covariance-driven
    stochastic subspace identification, Peeters and De Roeck 1999). `max_order` bounds the order of
    the models tried (0: 2 for each channel, at least 12; for ambient motion 4 for each channel and 4
    more, at most 40; with inputs 2 for each channel and 16 more, at most 32).

    Raises Error for arrays of the wrong size, times that do not rise, fewer than 20 samples, records
    without free motion, limit cycles, inputs that are all constant, and too short ambient motion.
    """
    if isinstance(t, Mapping):
        if y is not None:
            raise Error("identify: a topic has its own channels, but y is given as well")
        t, y = _topic(t)
    elif y is None:
        raise Error("identify: y is missing")
    many = isinstance(t, (list, tuple)) and len(t) > 0 and np.ndim(t[0]) > 0
    times: list[Any] = list(t) if many else [t]  # type: ignore[arg-type]
    instants = [to_numbers("t", time, 1) for time in times]
    slowest = max((float(np.median(np.diff(time))) for time in instants if time.size > 1), default=0)
    if slowest >= 0.5:
        warnings.warn(f"t has steps of {slowest:.3g} s: is it in ms, us or ns?", stacklevel=2)
    values = _columns("y", "channels", y, len(times), many)
    _check_rows("y", "channels", values, instants)
    if input is None:
        inputs = [np.empty((0, 0))] * len(times)
    elif ambient:
        raise Error("identify: ambient motion has no measured input")
    else:
        inputs = _columns("input", "inputs", input, len(times), many)
        _check_rows("input", "inputs", inputs, instants)
    found = _core.identify(instants, values, inputs, find, ambient, max_order)
    channels = values[0].shape[0]
    return Identification(modes=_measured(found.pop("modes"), channels),
                          rejected=_measured(found.pop("rejected"), channels), **found)
