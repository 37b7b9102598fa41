"""The ending of a name says what is written; what Ctrl-C leaves is told as it is."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.simulation.checkpoint import Checkpoint

BODY = lm.RigidBody([1.0, 1.5, 2.0])
START = BODY.state(mu=[0.5, 0.1, 0.75], g=np.eye(3))
PLAN = lm.Plan(BODY, lm.RKMK(order=4), h=0.05, compiled=False)


def rows_of(path: Path) -> tuple[list[str], np.ndarray]:
    with path.open(newline="") as file:
        head, *rows = csv.reader(file)
    return head, np.array(rows, dtype=float)


def test_csv_has_the_samples_by_name(tmp_path: Path) -> None:
    run = PLAN.run(START, steps=3)
    run.save(tmp_path / "run.csv")
    head, rows = rows_of(tmp_path / "run.csv")
    assert head == ["t", *(f"mu[{i}]" for i in range(3)), *(f"g[{i},{j}]" for i in range(3) for j in range(3))]
    assert np.array_equal(rows, np.column_stack([run.t, run.mu, run.g.reshape(4, 9)]))


def test_csv_of_an_ensemble_has_a_row_for_each_body(tmp_path: Path) -> None:
    run = PLAN.run(BODY.state(mu=[[0.5, 0.1, 0.75], [1.0, 0.0, 0.0]]), steps=3)
    run.save(tmp_path / "run.CSV")
    head, rows = rows_of(tmp_path / "run.CSV")
    assert head == ["t", "body", "mu[0]", "mu[1]", "mu[2]"]
    assert np.array_equal(rows[:, 0], np.repeat(run.t, 2))
    assert np.array_equal(rows[:, 1], [0, 1] * 4)
    assert np.array_equal(rows[:, 2:], run.mu.reshape(8, 3))


@pytest.mark.parametrize("name", ["run.mat", "run.txt", "run.json", "run.npz.bak"])
def test_other_endings_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"take one of \.npz, \.h5, \.hdf5, \.csv"):
        PLAN.run(START, steps=1).save(tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["run.csv", "run.mat"])
def test_a_checkpoint_is_a_file_that_is_read_again(tmp_path: Path, name: str) -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"take one of \.npz, \.h5, \.hdf5$"):
        PLAN.run(START, steps=1, checkpoint=tmp_path / name)


@pytest.mark.parametrize("compiled", [False, True])
def test_ctrl_c_tells_the_step_of_the_last_sample_and_leaves_it_in_the_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compiled: bool
) -> None:
    """Ctrl-C after a piece of the run is made, and before it is counted."""
    seen = []

    def interrupted(self: Any, steps: int = 0) -> bool:
        seen.append(steps)
        if len(seen) == 4:
            raise KeyboardInterrupt
        self.taken += steps
        return len(seen) == 1

    monkeypatch.setattr(Checkpoint, "due", interrupted)
    plan = PLAN.replace(compiled=compiled, every=20)
    with pytest.raises(lm.errors.IntegrationInterrupted) as caught:
        plan.run(START, steps=10**6, checkpoint=tmp_path / "run.npz", checkpoint_every="100 steps")
    run = caught.value.trajectory
    step = round(float(run.t[-1]) / 0.05)
    assert f"after {step} of 1000000 steps, t = {run.t[-1]:g}; {len(run)} samples" in str(caught.value)
    left = lm.Trajectory.load(tmp_path / "run.npz")
    assert np.array_equal(left.t, run.t)
    assert np.array_equal(left.mu, run.mu)


@pytest.mark.slow
def test_ctrl_c_at_any_moment(tmp_path: Path) -> None:
    import os
    import signal
    import threading

    for delay in (0.4, 0.45, 0.5, 0.55, 0.6, 0.65):
        plan = lm.Plan(BODY, lm.RKMK(order=4), h=0.05, every=200, compiled=True, progress=False)
        plan.run(START, steps=1000)
        threading.Timer(delay, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        with pytest.raises(lm.errors.IntegrationInterrupted) as caught:
            plan.run(START, steps=400_000_000, checkpoint=tmp_path / "run.npz", checkpoint_every="100_000 steps")
        run = caught.value.trajectory
        step = round(float(run.t[-1]) / 0.05)
        assert f"after {step} of" in str(caught.value)
        assert run.steps == step
        assert lm.Trajectory.load(tmp_path / "run.npz").t[-1] == run.t[-1]


def test_pictures_of_water_have_picoseconds() -> None:
    from liemech.plots.style import time_label

    water = lm.models.SPC()
    molecules = lm.LiePoissonSystem(lm.SE3() ** 2, lm.PerSite(water.kinetic_energy))
    drop = lm.MechanicalSystem(molecules, lm.Terms(water.over(lm.neighbours.all_pairs())))
    poses = np.stack([np.eye(4)] * 2)
    poses[1, :3, 3] = [0.0, 0.0, 2.9]
    run = lm.integrate(drop, lm.LieVerlet(), drop.state(mu=np.zeros((2, 6)), g=poses), h=1e-3, steps=1, compiled=False)
    assert time_label(run) == "time $t$ (ps)"
    assert time_label(PLAN.run(START, steps=1)) == "time $t$ (s)"
