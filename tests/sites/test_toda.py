"""Toda's lattice by sites: the bits of the one written out, and the spectrum of Lax' matrix."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigvalsh_tridiagonal

import liemech as lm
from liemech.compiler import kernel

native = pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")


def lattice(n: int, periodic: bool, size: float = 1.0) -> tuple[Any, Any]:
    system, rng = lm.models.TodaLattice(n, periodic), np.random.default_rng(0)
    return system, system.state_of(size * rng.normal(size=n), size * rng.normal(size=n))


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize(
    "method", [lm.Splitting(order=4), lm.RKMK(order=4), lm.Composition(lm.Splitting(order=2), order=4)], ids=repr
)
def test_as_written_out(method: Any, periodic: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for small, compiled in ((48, False), (0, False), (0, None)):
        monkeypatch.setattr(lm.System, "small", small)
        system, start = lattice(12, periodic)
        run = lm.integrate(system, method, start, h=0.05, steps=5, compiled=compiled)
        found.append(run.y)
        assert run.energy == pytest.approx(np.asarray(system.energy(run.y)), rel=1e-14)
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0], found[2])


@pytest.mark.slow
@native
def test_a_long_lattice_keeps_its_spectrum(tmp_path: Path) -> None:
    n = 500
    system, start = lattice(n, False, 0.1)
    errors = []
    for h, steps in ((0.1, 100), (0.05, 200)):
        run = lm.integrate(system, lm.Splitting(order=4), start, h=h, steps=steps, every=50)
        assert run.compiled
        assert run.y.shape[1] == 2 * n - 1
        before, after = (eigvalsh_tridiagonal(y[n - 1 :], y[: n - 1]) for y in run.y[[0, -1]])
        errors.append(np.abs(after - before).max())
    assert errors[0] < 1e-6
    assert 12.0 < errors[0] / errors[1] < 20.0  # order 4
    assert {kept.name for kept in run.drift().kept} == {"energy", "Casimir 1"}
    plan = lm.Plan(system, lm.Splitting(order=4), h=0.05, every=50)
    first = plan.run(start, steps=60)
    first.save(tmp_path / "run.npz")
    for there in (first, lm.Trajectory.load(tmp_path / "run.npz")):
        assert np.array_equal(plan.resume(there, steps=140).y[-1], run.y[-1])


@native
def test_a_lattice_of_another_length_compiles_nothing() -> None:
    runs = []
    for n in (40, 90):
        system, start = lattice(n, True, 0.1)
        assert system.site_form is not None
        runs.append(lm.integrate(system, lm.Splitting(order=2), start, h=0.1, steps=4))
    assert all(run.compiled for run in runs)
    assert runs[1].drift()["Casimir 2"].largest < 1e-13


def test_ensembles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lm.System, "small", 0)
    system, start = lattice(5, False)
    many = system.state(np.stack([np.array(start.y)] * 2))
    way: dict[str, Any] = {"h": 0.1, "steps": 3, "compiled": False}
    runs = [lm.integrate(system, lm.Splitting(order=2), s, **way).y for s in (start, many)]
    assert np.array_equal(runs[1][:, 1], runs[0])
