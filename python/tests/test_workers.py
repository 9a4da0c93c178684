"""Executors of clusters, region designs on workers, and workers that die."""

import concurrent.futures
import multiprocessing
import os
import pickle
import shutil
import subprocess
import sys

import numpy as np
import pytest

import dashpot
from conftest import HOME

GAINS = dict(task_stiffness=[200, 200, 200, 20, 20, 20], damping_factor=2.0)
NEAR = dict(lower=np.array(HOME) - 0.4, upper=np.array(HOME) + 0.4)
REGION = dict(task_stiffness=[200, 200, 200, 20, 20, 20], damping_ratio=0.7, samples=600, seed=2,
              structure="diagonal", **NEAR)


@pytest.fixture(scope="module")
def region(panda):
    return dashpot.design_region(panda, **REGION)


def spawned(count):
    return concurrent.futures.ProcessPoolExecutor(count, multiprocessing.get_context("spawn"))


def same(one, other):
    for field, value in vars(one).items():
        np.testing.assert_array_equal(getattr(other, field), value)


def same_workspace(one, other):
    assert one.samples == other.samples
    for name in ("smallest_ratio", "fastest_pole", "gain_margin"):
        same(getattr(one, name), getattr(other, name))


def test_regions_are_the_same_with_any_executor(panda, region):
    with concurrent.futures.ThreadPoolExecutor(1) as one, spawned(2) as processes:
        for executor in (one, processes):
            same(region, dashpot.design_region(panda, **REGION, executor=executor))
    assert region.violation <= 1e-6 and 0.2 < region.level <= 1
    # The audit of the same postures finds this level, by other means.
    check = dashpot.audit(panda, task_stiffness=REGION["task_stiffness"], samples=600, seed=2,
                          task_damping=region.damping, **NEAR).workspace.smallest_ratio
    assert check.worst == pytest.approx(0.7 * region.level, rel=1e-7)


def test_regions_of_given_postures_keep_their_structure(panda):
    postures = np.random.default_rng(1).uniform(NEAR["lower"], NEAR["upper"], (60, 7))
    gains = dict(task_stiffness=REGION["task_stiffness"])
    full = dashpot.design_region(panda, **gains, postures=postures)
    diagonal = dashpot.design_region(panda, **gains, postures=postures, structure="diagonal")
    assert np.count_nonzero(diagonal.damping) == 6 and diagonal.level < full.level
    reached = [dashpot.audit(panda, q, **gains, task_damping=full.damping).posture.smallest_ratio
               for q in postures]
    assert min(reached) == pytest.approx(0.7 * full.level, rel=1e-7)
    worst = [i for i, q in enumerate(postures) if np.array_equal(q, full.worst_q)]
    assert reached[worst[0]] == pytest.approx(min(reached), rel=1e-7)  # several may bind


def test_regions_are_lowered_to_what_every_loop_bears(panda):
    postures = np.random.default_rng(2).uniform(NEAR["lower"], NEAR["upper"], (40, 7))
    gains, loop = dict(task_stiffness=REGION["task_stiffness"]), dict(period=0.002, delay=1)

    def margins(design):
        return [dashpot.audit(panda, q, **gains, **loop,
                              task_damping=design.damping).posture.gain_margin for q in postures]

    free = dashpot.design_region(panda, **gains, postures=postures)
    assert free.share == 1 and np.isinf(free.gain_margin) and free.margin_q.size == 0
    wanted = 1.5 * min(margins(free))
    asked = dict(**gains, **loop, postures=postures, gain_margin=wanted)
    lowered = dashpot.design_region(panda, **asked)
    assert 0.4 < lowered.share < 0.9
    np.testing.assert_allclose(lowered.damping, lowered.share * free.damping, rtol=1e-12)
    found = margins(lowered)
    assert min(found) == pytest.approx(wanted, rel=1e-4) == lowered.gain_margin
    np.testing.assert_array_equal(lowered.margin_q, postures[np.argmin(found)])
    with spawned(2) as processes:
        same(lowered, dashpot.design_region(panda, **asked, executor=processes))
    with pytest.raises(dashpot.Error, match="gain_margin: no share of the damping keeps 2 at every"):
        dashpot.design_region(panda, **gains, postures=postures, period=0.1)


@pytest.mark.parametrize("given, message", [
    (dict(task_stiffness=[1] * 6, samples=9, delay=1), "period: missing"),
    (dict(task_stiffness=[1] * 6, samples=9, period=1e-3, gain_margin=0.5), "the gain margin has to be at least 1"),
    (dict(), "give one of task_stiffness and joint_stiffness"),
    (dict(task_stiffness=[1] * 6), "a region without postures"),
    (dict(task_stiffness=[1] * 6, samples=9, structure="round"), "not one of full, block, diagonal"),
    (dict(task_stiffness=[1] * 6, samples=9, largest_ratio=0.5), "below the one wanted"),
    (dict(task_stiffness=[1] * 6, postures=[[0, 1]]), "postures: has 2 entries"),
])
def test_bad_regions_give_the_programs_messages(panda, given, message):
    with pytest.raises(dashpot.Error, match=message):
        dashpot.design_region(panda, **given)


class Deadly(concurrent.futures.Executor):
    """Two processes, one of which ends when it gets its third chunk."""

    def __init__(self):
        self.pool, self.count = spawned(2), 0

    def submit(self, function, *arguments):
        self.count += 1
        if self.count == 3:
            for done in self.before:
                done.result()
            return self.pool.submit(os._exit, 1)
        future = self.pool.submit(function, *arguments)
        self.before = [*getattr(self, "before", []), future]
        return future


def test_a_worker_that_dies_is_told(panda):
    deadly = Deadly()
    try:
        with pytest.raises(concurrent.futures.BrokenExecutor,
                           match=r"a worker died: \d+ of 2000 postures were done, .* \d+ remain"):
            dashpot.audit(panda, **GAINS, samples=2000, executor=deadly)
    finally:
        deadly.pool.shutdown()


def test_dask_finds_the_same(panda, region):
    distributed = pytest.importorskip("distributed")
    known = dashpot.audit(panda, **GAINS, samples=3000, seed=3).workspace
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None,
                                  host="127.0.0.1") as cluster, distributed.Client(cluster) as client:
        with client.get_executor() as executor:
            same_workspace(known, dashpot.audit(panda, **GAINS, samples=3000, seed=3,
                                                executor=executor).workspace)
            same(region, dashpot.design_region(panda, **REGION, executor=executor))


MPI = """
import pickle, sys
from mpi4py.futures import MPIPoolExecutor
import dashpot
if __name__ == "__main__":
    robot, gains, region = pickle.load(open(sys.argv[1], "rb"))
    with MPIPoolExecutor(2) as executor:
        found = (dashpot.audit(robot, **gains, samples=3000, seed=3, executor=executor).workspace,
                 dashpot.design_region(robot, **region, executor=executor))
    pickle.dump(found, open(sys.argv[2], "wb"))
"""


def test_mpi_finds_the_same(panda, region, tmp_path):
    pytest.importorskip("mpi4py")
    mpiexec = shutil.which("mpiexec", path=os.path.dirname(sys.executable)) or shutil.which("mpiexec")
    if mpiexec is None:
        pytest.skip("mpiexec is not installed")
    (tmp_path / "program.py").write_text(MPI)
    (tmp_path / "in").write_bytes(pickle.dumps((panda, GAINS, REGION)))
    done = subprocess.run([mpiexec, "-n", "3", sys.executable, "-m", "mpi4py.futures", "program.py",
                           "in", "out"], cwd=tmp_path, capture_output=True, text=True, timeout=1200,
                          env={**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1",
                               "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
                               "OMPI_MCA_rmaps_base_oversubscribe": "1"})
    assert done.returncode == 0, done.stderr
    workspace, design = pickle.loads((tmp_path / "out").read_bytes())
    same_workspace(workspace, dashpot.audit(panda, **GAINS, samples=3000, seed=3).workspace)
    same(region, design)
