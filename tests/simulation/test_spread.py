"""Ensembles spread by executors: the bits of a run in one piece, in order, whatever is lost on the way."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from concurrent import futures

import numpy as np
import pytest

import liemech as lm
from liemech import errors
from liemech.rooms.at_work import spread

BODY = lm.RigidBody([1.0, 1.5, 2.0])
RNG = np.random.default_rng(4)
STARTS = BODY.state(mu=RNG.normal(size=(37, 3)), g=np.broadcast_to(np.eye(3), (37, 3, 3)))
PLAN = lm.Plan(BODY, lm.RKMK(order=2), h=0.1, every=5, compiled=False)


class Losing(futures.Executor):
    """Does what it is told at once, and loses some of it: `lost` says for each job how it ends."""

    def __init__(self, *lost):
        self.lost = [*lost]

    def submit(self, function, /, *args, **options):
        future = futures.Future()
        kind = self.lost.pop(0) if self.lost else None
        if kind is futures.BrokenExecutor and not self.lost:
            raise kind("broken")
        if kind is not None:
            future.set_exception(kind("lost"))
        else:
            future.set_result(function(*args, **options))
        return future


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch):
    monkeypatch.setattr(spread, "CHUNK", 1)


@pytest.mark.slow
def test_the_bits_of_a_run_in_one_piece():
    with futures.ThreadPoolExecutor(2) as executor:
        for plan, how in (
            (PLAN, {"steps": 6}),
            (PLAN.replace(record=("energy",)), {"steps": 6}),
            (PLAN, {"t_end": 0.6, "t_eval": [0.0, 0.33, 0.6]}),
            (lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-6, compiled=False), {"t_end": 0.1}),
        ):
            whole, run = plan.run(STARTS, **how), plan.run(STARTS, executor=executor, **how)
            assert run.bodies == 37 and np.array_equal(run.t, whole.t) and run.steps == whole.steps
            for name, values in whole.states.items():
                assert np.array_equal(values, run.states[name])
    first = PLAN.run(STARTS, steps=7, executor=Losing())
    assert np.array_equal(PLAN.resume(first, steps=8).mu, PLAN.resume(PLAN.run(STARTS, steps=7), steps=8).mu)
    assert np.array_equal(first.carry.state.mu, first.mu[-1])


def test_bodies_with_parameters_and_times_of_their_own():
    bodies = [lm.RigidBody([1.0, 1.5, 1.8 + 0.01 * i]) for i in range(37)]
    plan = PLAN.replace(system=bodies)
    assert np.array_equal(plan.run(STARTS, steps=10).mu, plan.run(STARTS, steps=10, executor=Losing()).mu)
    kepler, method = (lm.Kepler(), lm.ReversibleController(lm.StormerVerlet(), sigma=lm.time_scales.EqualArc()))
    starts = kepler.state(q=[[0.5 + 0.01 * i, 0.0] for i in range(20)], p=[[0.0, 1.7]] * 20)
    how = dict(h=0.01, steps=5, compiled=False)
    whole, run = (
        lm.integrate(kepler, method, starts, **how),
        lm.integrate(kepler, method, starts, executor=Losing(), **how),
    )
    assert np.array_equal(whole.t, run.t) and np.array_equal(whole.q, run.q) and np.array_equal(whole.z, run.z)


def test_lost_chunks_are_handed_out_again():
    whole = PLAN.run(STARTS, steps=6)
    run = PLAN.run(STARTS, steps=6, executor=Losing(ConnectionError, None, OSError, ConnectionError))
    assert np.array_equal(run.mu, whole.mu)
    with pytest.warns(RuntimeWarning, match="lost chunk 0 of 3; it is computed here"):
        run = PLAN.run(STARTS, steps=6, executor=Losing(futures.BrokenExecutor))
    assert np.array_equal(run.mu, whole.mu)
    with pytest.raises(ConnectionError):
        PLAN.run(STARTS, steps=6, executor=Losing(*[ConnectionError] * 20))


@lm.record
class Fence(lm.Force):
    """A force that some bodies meet, and the mistake of a formula for others."""

    def covector(self, t, xi, g):
        if xi[0] > 1.5:
            raise ValueError("too fast")
        return lm.vec(0.0, 0.0, 0.0)


def test_bodies_that_stop_and_mistakes():
    system = lm.MechanicalSystem(BODY, lm.NoPotential(), load=Fence())
    starts = system.state(mu=STARTS.mu, g=STARTS.g)
    plan = lm.Plan(system, lm.RKMK(order=2), h=0.1, compiled=False)
    with pytest.warns(RuntimeWarning, match="bodies stopped early"):
        whole = plan.run(starts, steps=6)
    with pytest.warns(RuntimeWarning, match="bodies stopped early"):
        run = plan.run(starts, steps=6, executor=Losing())
    assert whole.stopped.steps == run.stopped.steps and len(run.stopped) > 0 and np.array_equal(whole.mu, run.mu)
    body = max(run.stopped)
    assert str(run.stopped[body].error) == str(whole.stopped[body].error)
    with pytest.raises(AttributeError):
        PLAN.replace(record=[("x", lambda t, state: state.nothing)]).run(STARTS, steps=2, executor=Losing())


def test_what_cannot_be_spread_is_refused():
    with pytest.raises(errors.InvalidInput, match="executor is for ensembles"):
        PLAN.run(BODY.state([1.0, 0.0, 0.0]), steps=2, executor=Losing())
    with pytest.raises(errors.InvalidType, match="executor is one of concurrent"):
        PLAN.run(STARTS, steps=2, executor=4)
    with pytest.raises(errors.InvalidInput, match="checkpoint"):
        PLAN.run(STARTS, steps=2, executor=Losing(), checkpoint="run.npz")


@pytest.mark.parametrize(
    "name, given", [("events", [lambda t, state: state.mu[0]]), ("record", ["mu", ("x", lambda t, s: t)])]
)
def test_what_other_processes_cannot_get_is_named(name, given):
    said = f"executor: {name} cannot be sent .* top of a module"
    with futures.ProcessPoolExecutor(1) as pool, pytest.raises(errors.InvalidInput, match=said):
        PLAN.replace(**{name: given}).run(STARTS, steps=2, executor=pool)


def killed_on_the_way(pids, delay):
    """Kill a process after a while."""

    def kill():
        time.sleep(delay)
        os.kill(next(iter(pids())), signal.SIGKILL)

    thread = threading.Thread(target=kill)
    thread.start()
    return thread


@pytest.mark.slow
def test_processes_of_which_one_is_killed():
    starts = BODY.state(mu=RNG.normal(size=(64, 3)))
    whole = PLAN.run(starts, steps=1000)
    with futures.ProcessPoolExecutor(2) as pool:
        assert np.array_equal(PLAN.run(starts, steps=1000, executor=pool).mu, whole.mu)
        thread = killed_on_the_way(lambda: pool._processes, 0.3)
        with pytest.warns(RuntimeWarning, match="it is computed here"):
            run = PLAN.run(starts, steps=1000, executor=pool)
        thread.join()
    assert np.array_equal(run.mu, whole.mu)


@pytest.mark.slow
def test_a_cluster_of_dask_of_which_a_worker_is_killed():
    distributed = pytest.importorskip("distributed", reason='needs dask: pip install "liemech[cluster]"')
    starts = BODY.state(mu=RNG.normal(size=(48, 3)))
    whole = PLAN.run(starts, steps=150)
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        executor = client.get_executor(pure=False)
        assert executor.submit(os.getpid).result() != os.getpid()
        before = client.run(os.getpid)
        thread = killed_on_the_way(before.values, 0.1)
        run = PLAN.run(starts, steps=150, executor=executor)
        thread.join()
        assert np.array_equal(run.mu, whole.mu)
        client.wait_for_workers(2, timeout=120)
        # one was killed, and replaced
        assert set(client.run(os.getpid).values()) != set(before.values())


KEPLER = lm.Kepler()
ORBITS = KEPLER.state(
    q=np.stack([RNG.uniform(0.6, 1.0, 37), np.zeros(37)], axis=1),
    p=np.stack([np.zeros(37), RNG.uniform(1.0, 1.2, 37)], axis=1),
)
SLOWER = lm.ReversibleController(lm.StormerVerlet(), sigma=lm.time_scales.DistancePower(1.5))


def axis(t, state):
    return state.q[1]


@pytest.mark.parametrize(
    ("plan", "starts", "how"),
    [
        (PLAN.replace(every=1), STARTS, {"t_end": 0.6}),
        (PLAN.replace(record=("energy",)), STARTS, {"t_end": 1.0, "t_eval": [0.33, 1.0]}),
        (lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-6), STARTS, {"t_end": 0.1}),
        (lm.Plan(KEPLER, lm.StormerVerlet(), h=0.1, events=axis), ORBITS, {"t_end": 4.0}),
        (lm.Plan(KEPLER, SLOWER, h=0.1), ORBITS, {"steps": 3}),
        (lm.Plan(KEPLER, SLOWER, h=0.1), ORBITS, {"t_end": 0.5}),
    ],
)
def test_an_interrupt_keeps_the_chunks_that_are_done(plan, starts, how):
    # The first of three chunks is done.  The others wait, and all go on from where they stand.
    whole = plan.run(starts, **how)
    with pytest.raises(errors.IntegrationInterrupted, match=r"1 of 3 chunks") as stop:
        plan.run(starts, executor=Losing(None, KeyboardInterrupt, KeyboardInterrupt), **how)
    part = stop.value.trajectory
    assert part.bodies == 37 and len(part.carry.members) == 37
    for name, values in part.states.items():
        assert np.array_equal(values[-1, :16], whole.states[name][-1, :16]), name
        assert np.array_equal(values[-1, 16:], whole.states[name][0, 16:]) or "t_eval" in how
    if "t_end" in how:
        rest = plan.resume(part, t_end=how["t_end"])
        for name, values in rest.states.items():
            assert np.array_equal(values[-1], whole.states[name][-1]), name


ALONE = """
import os, signal, threading, time
from concurrent import futures
import numpy as np
import liemech as lm
from liemech import errors
from liemech.rooms.at_work import spread

body = lm.RigidBody([1.0, 1.5, 2.0])
plan = lm.Plan(body, lm.RKMK(order=2), h=1e-3, every=10**6)

if __name__ == "__main__":
    spread.CHUNK = 1
    starts = body.state(mu=np.random.default_rng(0).normal(size=(128, 3)))
    with futures.ProcessPoolExecutor(2) as pool:
        plan.run(starts, steps=2000, executor=pool)
        threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()
        try:
            plan.run(starts, steps=10**10, executor=pool)
        except errors.IntegrationInterrupted as stop:
            print(stop.trajectory.bodies)
        for process in pool._processes.values():
            process.kill()
"""


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_chunks_for_which_nobody_waits_end(compiled, monkeypatch, tmp_path):
    """Those that run, and would for hours, and those that have not begun."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    plan = lm.Plan(PLAN.system, PLAN.method, h=1e-3, every=10**5, compiled=compiled)
    monkeypatch.setattr(spread, "CHUNK", 1)
    starts = PLAN.system.state(mu=np.ones((128, 3)))
    plan.run(starts, steps=1)
    with futures.ThreadPoolExecutor(2) as pool:
        wait = futures.wait

        def pressed(running, **how):
            time.sleep(0.3)
            raise KeyboardInterrupt

        monkeypatch.setattr(futures, "wait", pressed)
        with pytest.raises(errors.IntegrationInterrupted, match="0 of 8 chunks"):
            plan.run(starts, steps=10**11, executor=pool)
        monkeypatch.setattr(futures, "wait", wait)
    assert not [*tmp_path.iterdir()]


@pytest.mark.slow
def test_an_interrupt_does_not_wait_for_processes(tmp_path):
    # Ctrl-C comes to this process; the chunks of the others would take an hour.
    (tmp_path / "alone.py").write_text(ALONE)
    ran = subprocess.run([sys.executable, tmp_path / "alone.py"], capture_output=True, text=True, timeout=120)
    assert ran.stdout.split() == ["128"], ran.stderr
