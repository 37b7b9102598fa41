"""Runs as tables and data sets with names on their axes, and in HDF5 files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import liemech as lm
from liemech import errors

BODY = lm.RigidBody([1.0, 1.5, 2.0])
START = BODY.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
MANY = BODY.state(mu=np.random.default_rng(2).normal(size=(3, 3)), g=np.broadcast_to(np.eye(3), (3, 3, 3)))
PLAN = lm.Plan(BODY, lm.RKMK(order=2), h=0.1, compiled=False)


@pytest.mark.slow
def test_a_data_set_of_xarray():
    pytest.importorskip("xarray")
    run = PLAN.run(START, steps=20)
    data = run.to_xarray()
    assert data.g.dims == ("t", "g_0", "g_1") and np.array_equal(data.g, run.g)
    assert np.array_equal(data.mu.sel(t=1.0, method="nearest"), run.mu[10])
    many = PLAN.run(MANY, steps=20).to_xarray()
    assert many.mu.dims == ("t", "body", "mu_0") and dict(many.sizes) == {
        "t": 21,
        "body": 3,
        "mu_0": 3,
        "g_0": 3,
        "g_1": 3,
    }
    energies = PLAN.replace(record="energy").run(MANY, steps=20).to_xarray()
    assert energies.energy.dims == ("t", "body") and list(energies.data_vars) == ["energy"]


@pytest.mark.slow
def test_a_frame_of_pandas():
    pytest.importorskip("pandas")
    run = PLAN.run(START, steps=20)
    frame = run.to_pandas()
    assert [*frame.columns[:5]] == ["mu[0]", "mu[1]", "mu[2]", "g[0,0]", "g[0,1]"] and frame.index.name == "t"
    assert np.array_equal(frame["g[2,1]"], run.g[:, 2, 1])
    many = PLAN.run(MANY, steps=20)
    frame = many.to_pandas()
    assert frame.index.names == ["t", "body"] and np.array_equal(frame.xs(2, level="body")["mu[1]"], many.mu[:, 2, 1])


@pytest.mark.slow
def test_fictive_times_go_along():
    pytest.importorskip("xarray")
    pytest.importorskip("pandas")
    kepler, method = (lm.Kepler(), lm.ReversibleController(lm.StormerVerlet(), sigma=lm.time_scales.EqualArc()))
    one = lm.integrate(kepler, method, kepler.state(q=[0.5, 0.0], p=[0.0, 1.7]), h=0.01, steps=5, compiled=False)
    assert np.array_equal(one.to_xarray().tau, one.tau) and np.array_equal(one.to_pandas()["tau"], one.tau)
    starts = kepler.state(q=[[0.5, 0.0], [0.6, 0.0]], p=[[0.0, 1.7]] * 2)
    two = lm.integrate(kepler, method, starts, h=0.01, steps=5, compiled=False)
    assert two.to_xarray().t.dims == ("tau", "body") and np.array_equal(two.to_pandas()["t"], two.t.ravel())


def test_hdf5_files(tmp_path: Path):
    h5py = pytest.importorskip("h5py")
    for start in (START, MANY):
        run = PLAN.run(start, steps=20)
        run.save(tmp_path / "run.h5")
        again = lm.Trajectory.load(tmp_path / "run.h5")
        assert again.system == BODY and again.stopped == {}
        assert again.system == BODY and np.array_equal(again.mu, run.mu) and np.array_equal(again.t, run.t)
        assert np.array_equal(PLAN.resume(again, steps=5).mu, PLAN.resume(run, steps=5).mu)
        with h5py.File(tmp_path / "run.h5") as file:
            assert np.array_equal(file["state.mu"], run.mu)


def test_a_damaged_hdf5_file_is_no_run(tmp_path: Path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "run.h5"
    PLAN.run(START, steps=20).save(path)
    with h5py.File(path, "r+") as file:
        file["state.mu"][7, 1] += 1e-15
    with pytest.raises(errors.InvalidInput, match="damaged"):
        lm.Trajectory.load(path)
    PLAN.run(START, steps=20).save(path)
    data = path.read_bytes()
    for length in (4, 600, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:length])
        with pytest.raises(errors.InvalidInput, match="damaged"):
            lm.Trajectory.load(path)
