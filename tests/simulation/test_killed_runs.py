"""Runs of each kind that are killed at a random moment: their files load, and go on bit for bit."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm

PROGRAM = """
import sys
import liemech as lm
from liemech.simulation import checkpoint

checkpoint.SHARE = 1e9  # it does nothing but write
body = lm.RigidBody([1.0, 1.5, 2.0])
start = body.state(mu=[0.5, 0.1, 0.8])
kepler = lm.Kepler()
clock = lm.ReversibleController(lm.StormerVerlet(), sigma=lm.time_scales.DistancePower(1.5))

def equator(t, state):
    return state.mu[0]

kinds = {
    "adaptive": (body, lm.RKMK(order=5), start, dict(rtol=1e-8, events=equator), dict(t_end=1e5)),
    "events": (body, lm.RKMK(order=4), start, dict(h=0.05, every=10, events=equator), dict(steps=10**6)),
    "fictive": (kepler, clock, kepler.state(q=[0.6, 0.0], p=[0.0, 1.4]), dict(h=0.02), dict(t_end=1e6)),
    "ensemble": (body, lm.RKMK(order=5), body.state(mu=[[0.5, 0.1, 0.8]] * 9), dict(rtol=1e-8), dict(t_end=2e3)),
    "energies": (body, lm.RKMK(order=4), start, dict(h=0.05, every=10, record="energy"), dict(steps=10**8)),
}
system, method, start, given, how = kinds[sys.argv[1]]
plan = lm.Plan(system, method, progress=False, **given)
if len(sys.argv) > 2:
    plan.run(start, checkpoint=sys.argv[2], checkpoint_every="70 steps", **how)
"""


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["adaptive", "events", "fictive", "ensemble", "energies"])
def test_a_killed_run_of_each_kind_goes_on(kind: str, tmp_path: Path, monkeypatch: Any) -> None:
    path, rng, made = tmp_path / "run.npz", np.random.default_rng(5), {}  # type: Any, Any, dict[str, Any]
    monkeypatch.setattr(sys, "argv", ["program", kind])
    exec(PROGRAM, made)
    plan, start, how = made["plan"], made["start"], made["how"]
    for _ in range(4):
        path.unlink(missing_ok=True)
        process = subprocess.Popen([sys.executable, "-c", PROGRAM, kind, str(path)], stderr=subprocess.DEVNULL)
        while not path.exists() and process.poll() is None:
            time.sleep(0.01)
        time.sleep(float(rng.uniform(0.0, 0.4)))
        process.send_signal(signal.SIGKILL)
        process.wait()
        part = lm.Trajectory.load(path)
        if "steps" in how:
            assert part.carry.step % 70 == 0
            joined = part.then(plan.resume(part, steps=70))
            whole = plan.run(start, steps=part.carry.step + 70)
        else:  # in the ensemble each body from where it stands
            end = float(np.max(part.carry.t)) + 5.0
            rest = plan.resume(part, t_end=end)
            joined, whole = part.then(rest), plan.run(start, t_end=end)
            if kind == "ensemble":
                joined, whole = rest, plan.run(start, t_end=end, t_eval=[end])
        for name, values in whole.states.items():
            assert np.array_equal(joined.states[name][-1], values[-1])
        assert np.all(joined.t[-1] == whole.t[-1])
