"""Throughput and data of more workers for dashpot.audit and dashpot.design_region.

After ./run python:  build/python/numpy-2/bin/python benchmarks/workers.py [POSTURES]

Prints the bytes of a task and of its result for each posture, the throughput of two workers beside
two independent runs with one worker each, and the time of a region design.
"""

import concurrent.futures
import multiprocessing
import pathlib
import pickle
import sys
import time

import numpy as np

import dashpot
from dashpot import _workers

ROOT = pathlib.Path(__file__).resolve().parent.parent
HOME = np.array([0, -0.785, 0, -2.356, 0, 1.571, 0.785])
STIFFNESS = [200] * 3 + [20] * 3
GAINS = dict(task_stiffness=STIFFNESS, damping_factor=2.0)
NEAR = dict(lower=HOME - 0.4, upper=HOME + 0.4)
CONTEXT = multiprocessing.get_context("spawn")


def panda():
    return dashpot.Robot.from_urdf(ROOT / "sim/models/panda.urdf", "panda_link0", "panda_hand_tcp")


class Counting(concurrent.futures.ThreadPoolExecutor):
    """Counts the data that processes would receive and send back."""

    sent = returned = chunks = seconds = 0

    def submit(self, function, *arguments):
        start = time.perf_counter()
        Counting.sent += len(pickle.dumps((function, arguments)))
        Counting.seconds += time.perf_counter() - start
        Counting.chunks += 1
        future = super().submit(function, *arguments)
        returned = pickle.dumps(future.result())
        start = time.perf_counter()
        pickle.loads(returned)
        Counting.seconds += time.perf_counter() - start
        Counting.returned += len(returned)
        return future


def print_sizes(name, postures, call):
    Counting.sent = Counting.returned = Counting.chunks = Counting.seconds = 0
    with Counting(1) as executor:
        call(executor)
    total = Counting.chunks * _workers._CHUNK
    print(f"{name}: {Counting.chunks} chunks of {postures} postures; each chunk "
          f"{Counting.sent / Counting.chunks:.0f} B sent, "
          f"{Counting.returned / Counting.chunks:.0f} B returned, "
          f"{Counting.seconds / Counting.chunks * 1e6:.0f} us of the caller; each posture judged "
          f"{Counting.sent / total:.1f} B and {Counting.returned / total:.1f} B")


def audit(robot, samples, executor):
    start = time.perf_counter()
    dashpot.audit(robot, **GAINS, samples=samples, executor=executor)
    return time.perf_counter() - start


def run_alone(gate, samples, times):
    """One of two independent runs: its own worker, started and warm before both begin."""
    robot = panda()
    with concurrent.futures.ProcessPoolExecutor(1, CONTEXT) as executor:
        audit(robot, 256, executor)
        gate.wait()
        times.put(audit(robot, samples, executor))


def side_by_side(samples):
    """Returns postures a second of two independent runs of one worker."""
    gate, times = CONTEXT.Barrier(2), CONTEXT.Queue()
    runs = [CONTEXT.Process(target=run_alone, args=(gate, samples, times)) for _ in range(2)]
    for run in runs:
        run.start()
    rate = sum(samples / times.get() for _ in runs)
    for run in runs:
        run.join()
    return rate


def main():
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    robot = panda()
    postures = robot.lower + (robot.upper - robot.lower) * np.random.default_rng(1).random((2560, 7))
    print_sizes("audit of a sequence", 2560,
                lambda executor: dashpot.audit(robot, **GAINS, samples=2560, executor=executor))
    print_sizes("audit of given postures", 2560,
                lambda executor: dashpot.audit(robot, **GAINS, postures=postures, executor=executor))
    print_sizes("region of a sequence", 2560,
                lambda executor: dashpot.design_region(robot, task_stiffness=STIFFNESS, samples=2560,
                                                       **NEAR, executor=executor))
    rates = []
    with concurrent.futures.ProcessPoolExecutor(2, CONTEXT) as executor:
        audit(robot, 1024, executor)
        for _ in range(3):  # in turns, because other programs take their share of the processors
            rates.append((samples / audit(robot, samples, executor), side_by_side(samples // 2)))
    for two, alone in rates:
        print(f"{samples} postures: two workers {two:.0f} a second; two runs of one worker, side by "
              f"side, {alone:.0f}: {two / alone:.2f}")
    print(f"median {np.median([two / alone for two, alone in rates]):.2f}")
    start = time.perf_counter()
    found = dashpot.design_region(robot, task_stiffness=STIFFNESS, samples=10_000, **NEAR)
    print(f"region of 10000 postures: {time.perf_counter() - start:.1f} s, level {found.level:.4f}")


if __name__ == "__main__":
    main()
