"""RKMK: the method itself to 13 digits, its orders, and what it keeps and does not keep."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scenes import RKMK4, asymmetric_body, errors_at, poisson_defect, seed_body, slope

import liemech as lm
from liemech.tableaus.tableau import ButcherTableau

REFERENCE = json.loads((Path(__file__).parent / "reference" / "integrator_steps_so3.json").read_text())
HEUN3 = ButcherTableau("Heun 3", 3, ((), (1 / 3,), (0, 2 / 3)), (1 / 4, 0, 3 / 4), (0, 1 / 3, 2 / 3))
COUNTS = {1: (800, 1600, 3200), 2: (80, 160, 320, 640), 3: (40, 80, 160, 320), 4: (20, 40, 80, 160)}


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_steps_of_the_method_itself(compiled: bool) -> None:
    body, start = seed_body()
    run = lm.integrate(body, RKMK4, start, h=0.5, steps=200, compiled=compiled)
    for at in REFERENCE["methods"]["RKMK4"]["trajectory"]:
        assert np.abs(run.mu[at["n"]] - at["mu"]).max() < 1e-13
        assert np.abs(run.g[at["n"]] - at["g"]).max() < 1e-13
        assert run.energy[at["n"]] == pytest.approx(at["energy"], abs=1e-13)


def test_error_after_two_hundred_steps() -> None:
    """4.4e-2 in the momentum, -1.7e-3 in the energy: the article's own step is that coarse."""
    body, start = seed_body()
    run = lm.integrate(body, RKMK4, start, h=0.5, steps=200)
    assert np.abs(run.mu[-1] - body.exact(start, 100.0).mu).max() == pytest.approx(4.4e-2, abs=5e-4)
    assert run.energy[-1] - 3 / 8 == pytest.approx(-1.7e-3, abs=5e-5)


# ---------------------------------------------------------------- order


METHODS = [
    *(lm.RKMK(order=p) for p in (1, 2, 3, 4)),
    *(lm.RKMK(order=p, truncation="closed") for p in (2, 3, 4)),
    lm.RKMK(order=4, truncation=5),
    lm.RKMK(tableau=HEUN3),
    *(lm.RKMK(order=p, retraction=lm.Cayley()) for p in (1, 2, 3, 4)),
]


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_order_of_momentum_and_attitude(method: lm.RKMK) -> None:
    body, start = asymmetric_body()
    counts = COUNTS[method.order]
    for error in errors_at(body, method, start, 2.0, counts):
        assert error.min() > 1e-12
        assert slope([1 / n for n in counts], error) == pytest.approx(method.order, abs=0.1)


def test_order_backwards_in_time() -> None:
    body, start = asymmetric_body()
    for error in errors_at(body, RKMK4, start, -2.0, COUNTS[4]):
        assert slope([1 / n for n in COUNTS[4]], error) == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("order", [3, 4])
def test_one_term_less_lowers_the_order_and_is_refused(order: int) -> None:
    with pytest.raises(lm.errors.InvalidInput, match=f"truncation >= {order - 2}"):
        lm.RKMK(order=order, truncation=order - 3)
    method = lm.RKMK(order=order)
    object.__setattr__(method, "truncation", order - 3)  # what is refused, done all the same
    body, start = asymmetric_body()
    counts = COUNTS[order - 1]
    for error in errors_at(body, method, start, 2.0, counts):
        assert slope([1 / n for n in counts], error) == pytest.approx(order - 1, abs=0.1)


def test_a_linear_hamiltonian_is_followed_exactly() -> None:
    """H = w . mu has the constant velocity w: the motion is g = exp(t w), at any step and any order."""

    @lm.record
    class Linear(lm.Hamiltonian):
        """w . mu."""

        w: lm.Vec

        def energy(self, mu: lm.Vec) -> float:
            return lm.dot(self.w, mu)

        def gradient(self, mu: lm.Vec) -> lm.Vec:
            return self.w

    w, mu = np.array([0.3, -0.7, 0.5]), np.array([1.0, 2.0, -0.5])
    system = lm.LiePoissonSystem(lm.SO3(), Linear(w))
    for order in (1, 2, 3, 4):
        run = lm.integrate(system, lm.RKMK(order=order), system.state(mu, np.eye(3)), h=0.7, steps=10)
        wanted = lm.SO3().exp(run.t[:, None] * w)
        assert np.abs(run.g - wanted).max() < 1e-14
        assert np.abs(run.mu - np.swapaxes(wanted, 1, 2) @ mu).max() < 1e-14


# ---------------------------------------------------------------- what is kept


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_orbit_group_and_spatial_momentum_are_kept_to_rounding(method: lm.RKMK) -> None:
    body, start = asymmetric_body()
    run = lm.integrate(body, method, start, h=0.3, steps=200)
    size = np.linalg.norm(run.mu[0])
    assert np.abs(np.linalg.norm(run.mu, axis=1) - size).max() < 3e-15 * size * 5
    assert np.abs(run.spatial_momentum - run.spatial_momentum[0]).max() < 1e-14 * size
    assert np.abs(np.swapaxes(run.g, 1, 2) @ run.g - np.eye(3)).max() < 1e-14


def test_the_bracket_is_not_kept() -> None:
    """One step misses it by h^5, as every method of order 4 may: far above what differences can see."""
    body, start = asymmetric_body()
    h = [0.5, 0.25, 0.125]
    defects = [poisson_defect(body, RKMK4, np.array(start.mu), step) for step in h]
    assert defects[0] > 1e-5
    assert slope(h, defects) == pytest.approx(5.0, abs=0.3)
    seed, start = seed_body()
    assert poisson_defect(seed, RKMK4, np.array(start.mu), 0.5) > 1e-5


def test_the_energy_drifts() -> None:
    """A body that loses 0.4 per cent in 200 steps and ever more afterwards, with |mu| exact all the time."""
    body, start = seed_body()
    run = lm.integrate(body, RKMK4, start, h=0.5, steps=10_000, every=100)
    error = run.energy - run.energy[0]
    assert (np.diff(error) < 0).all()
    assert error[-1] < 10 * error[2] < 0
    assert np.abs(run.casimirs - 1.0).max() < 1e-13


# ---------------------------------------------------------------- the face


def test_repr_builds_the_same_method() -> None:
    by_cayley = lm.RKMK(order=3, retraction=lm.Cayley())
    for method in (lm.RKMK(), lm.RKMK(order=2), lm.RKMK(truncation=4), lm.RKMK(truncation="closed"), by_cayley):
        assert eval(repr(method), {"RKMK": lm.RKMK, "Cayley": lm.Cayley}) == method
    assert lm.RKMK().order == 4
    assert lm.RKMK(order=3).name == "RKMK3"
    assert lm.RKMK(retraction=lm.Cayley()).truncation == "closed"
    assert not lm.RKMK.symplectic
    assert not lm.RKMK.symmetric
