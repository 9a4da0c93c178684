"""Chunks of postures for the workers of an executor."""

from __future__ import annotations

import concurrent.futures
import contextlib
import functools
import os
import pickle
from collections.abc import Iterator
from typing import Any, Callable

from . import _core
from ._results import Array
from ._robot import Robot

_CHUNK = 256  # postures


class Task:
    """An audit that other threads and processes take chunks of.

    Each chunk brings the task along as the same bytes, and a process makes its robot only once.
    """

    def __init__(self, robot: Robot, gains: str, at_tip: bool,
                 options: dict[str, Any]) -> None:
        self._arguments = (robot, gains, at_tip, options)
        self.core = _core.Audit(robot._core, _core.Gains(robot._core, gains), at_tip, options)

    @functools.cached_property
    def _bytes(self) -> bytes:
        return pickle.dumps(self._arguments)

    def __reduce__(self) -> tuple[Any, ...]:
        return _task_of, (self._bytes,)

    def sample(self, seed: int, first: int, count: int) -> Array:
        return self.core.sample(seed, first, count)

    def numbers(self, postures: Array) -> Array:
        return self.core.numbers(postures)

    def judge(self, question: Any, seed: int, first: int, count: int, postures: Array | None) -> Any:
        return self.core.judge(question, seed, first, count, postures)


@functools.lru_cache(maxsize=4)
def _task_of(arguments: bytes) -> Task:
    return Task(*pickle.loads(arguments))


def workers(executor: concurrent.futures.Executor | None
            ) -> contextlib.AbstractContextManager[concurrent.futures.Executor]:
    """Returns the executor, which is left as it is, or one of threads, which ends with the context."""
    if executor is None:
        return concurrent.futures.ThreadPoolExecutor(os.cpu_count())
    return contextlib.nullcontext(executor)


def chunks_of(samples: int) -> Iterator[tuple[int, int]]:
    """Returns the first number and the size of each chunk."""
    for first in range(0, samples, _CHUNK):
        yield first, min(_CHUNK, samples - first)


def collect(executor: concurrent.futures.Executor,
            chunks: list[tuple[Callable[..., Any], tuple[Any, ...]]], samples: int) -> list[Any]:
    """Returns the results of the functions, in their order.

    Raises BrokenExecutor, with the number of finished postures, if workers die.
    """
    futures: list[Any] = []
    try:
        futures += [executor.submit(function, *arguments) for function, arguments in chunks]
        return [future.result() for future in futures]
    except concurrent.futures.BrokenExecutor as error:
        done = sum(future.done() and not future.cancelled() and future.exception() is None
                   for future in futures)
        postures = sum(count for (_, count), future in zip(chunks_of(samples), futures)
                       if future.done() and not future.cancelled() and future.exception() is None)
        raise concurrent.futures.BrokenExecutor(
            f"a worker died: {postures} of {samples} postures were done, in {done} of {len(chunks)} "
            f"chunks, and {samples - postures} remain; nothing of it is kept ({error})") from error
    except BaseException:
        for future in futures:
            future.cancel()
        raise
