"""The base of all results: read-only, with a text, and fit for pickling."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ._core import Error

Array = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]
TextArray = npt.NDArray[np.str_]


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Result:
    """Base of all results: a frozen dataclass whose arrays are read-only, before and after pickling."""

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()

    def __repr__(self) -> str:
        lines = [f"{field.name}: {_short(getattr(self, field.name))}"
                 for field in dataclasses.fields(self)]
        return "\n".join([type(self).__name__, *lines]).replace("\n", "\n  ")


def _short(value: object) -> str:
    """Returns a value in one line; arrays with more than one dimension by their shape."""
    if isinstance(value, np.ndarray) and (value.ndim > 1 or value.size > 16):
        return " x ".join(map(str, value.shape)) + f" array of {value.dtype}"
    if isinstance(value, np.ndarray):
        return np.array2string(value, precision=6, max_line_width=10**6)
    if isinstance(value, Modes):
        return f"{len(value)} modes"
    if isinstance(value, Result):
        return repr(value)
    return " ".join(repr(value).split())


def table(columns: dict[str, Sequence[object]]) -> str:
    """Returns columns of numbers and texts under their names, numbered from 1."""
    def text(value: object) -> str:
        return f"{value:.6g}" if isinstance(value, float) else str(value)

    texts = [[name, *map(text, values)] for name, values in columns.items()]
    texts.insert(0, ["mode", *(str(i + 1) for i in range(len(texts[0]) - 1))])
    widths = [max(map(len, column)) for column in texts]
    return "\n".join("  " + "  ".join(cell.rjust(width) for cell, width in zip(row, widths))
                     for row in zip(*texts))


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Modes(Result):
    """The m vibration modes of M q'' + C q' + K q = 0 with n coordinates, as `dashpot analyze` lists
    them: by falling natural frequency. The true number is proved to lie within each bound.
    """

    natural_frequency: Array
    """m, sqrt(l1 l2) of the two eigenvalues l1 and l2 of a mode, rad/s; NaN if l1 l2 is negative."""
    damping_ratio: Array
    """m, -(l1 + l2) / (2 natural_frequency); above 1 if overdamped."""
    damped_frequency: Array
    """m, imaginary part of l1, rad/s; zero if real."""
    eigenvalues: ComplexArray
    """m x 2, 1/s: a complex pair, positive imaginary part first, or two real ones, slower first."""
    kind: TextArray
    """m of underdamped, critical, overdamped, undamped, unstable, soft."""
    error_bound: Array
    """m, proved bound of |computed - true| of either eigenvalue, 1/s; infinite: not proved."""
    eigenvalue_bounds: Array
    """m x 2, proved bound of each of `eigenvalues`, 1/s; error_bound is the larger one."""
    natural_frequency_bound: Array
    """m, proved bound of the natural frequency, rad/s."""
    damping_ratio_bound: Array
    """m, proved bound of the damping ratio."""
    backward_error: Array
    """m, normwise backward error of the worse eigenpair (Tisseur 2000)."""
    condition: Array
    """m, condition number of the worse eigenvalue; infinite at critical damping."""
    shapes: ComplexArray
    """m x n, eigenvector u of l1 in each row, u^H M u = 1."""
    zero_modes: Array
    """r x n, an M-orthonormal basis, in its rows, of the motions that no spring resists."""
    zero_mode_rates: Array
    """r, eigenvalues of the zero modes' velocities, 1/s; zero if nothing damps them."""
    coupling: float
    """How strongly damping couples zero modes and vibrations: 0 to 1."""
    status: str
    """"ok", or what could not be proved."""

    def __len__(self) -> int:
        return len(self.natural_frequency)

    def __repr__(self) -> str:
        head = f"Modes: {len(self)}, zero modes: {len(self.zero_modes)}, status: {self.status}\n"
        return head + table({"rad/s": self.natural_frequency.tolist(),
                             "ratio": self.damping_ratio.tolist(),
                             "1/s within": self.error_bound.tolist(), "kind": self.kind.tolist()})


def stack(items: Sequence[Any], shape: tuple[int, ...], dtype: type = float) -> npt.NDArray[Any]:
    """Returns equally sized arrays as one array, also for an empty list."""
    return np.array(items, dtype=dtype).reshape((len(items), *shape))


def make_modes(found: dict[str, Any]) -> Modes:
    """Returns the Modes of a result of C++."""
    n = found["zero_modes"].shape[1]
    return Modes(**{**found, "shapes": stack(found["shapes"], (n,), complex),
                    "kind": np.array(found["kind"], dtype=np.str_)})


def to_numbers(name: str, given: npt.ArrayLike, dimensions: int) -> Array:
    """Returns `given` as an own array of floats; raises Error if it cannot be one."""
    try:
        raw = np.asarray(given)
        if raw.dtype.kind == "c":
            raise ValueError("real numbers are wanted")
        numbers = np.array(raw, dtype=np.float64)
    except (TypeError, ValueError) as problem:
        raise Error(f"{name}: {problem}") from None
    if numbers.ndim != dimensions:
        what = ("a number", "a list of numbers", "a matrix")[dimensions]
        raise Error(f"{name}: {what} is wanted, not an array of {numbers.ndim} dimensions")
    return numbers


def to_matrix(name: str, given: npt.ArrayLike | None) -> Array | None:
    """Returns a matrix of floats, or None."""
    return None if given is None else to_numbers(name, given, 2)


def to_vector(name: str, given: npt.ArrayLike | None) -> Array | None:
    """Returns a vector of floats, or None."""
    return None if given is None else to_numbers(name, given, 1)


def to_gain(name: str, given: npt.ArrayLike | None) -> Array | None:
    """Returns a matrix of floats, given as one or as its diagonal, or None."""
    if given is None:
        return None
    if np.ndim(given) == 1:
        return np.diag(to_numbers(name, given, 1))
    return to_numbers(name, given, 2)
