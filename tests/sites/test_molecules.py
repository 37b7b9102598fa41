"""Rigid molecules in a periodic box: forces through points, lists that are made anew, images."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidInput
from liemech.rooms.sites.runs import lists
from liemech.rooms.sites.terms.point_terms import PointTerm

SPC = lm.models.SPC()


def liquid(side: int, cutoff: float, term: Any = SPC) -> tuple[Any, np.ndarray, np.ndarray]:
    """Molecules on a lattice that fills its box, turned at random, warm."""
    rng, n = np.random.default_rng(side), side**3
    axis, g = 3.104 * np.arange(side), np.zeros((n, 4, 4))
    g[:, :3, :3], g[:, 3, 3] = lm.SO3().random(rng, n), 1.0
    g[:, :3, 3] = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    mu = rng.normal(size=(n, 6)) * np.sqrt(250.0 * np.array(term.moments))
    near = lm.neighbours.within(cutoff, box=[3.104 * side] * 3)
    bodies = lm.LiePoissonSystem(lm.SE3() ** n, lm.PerSite(term.kinetic_energy))
    return lm.MechanicalSystem(bodies, lm.Terms(term.over(near))), mu, g


def forces(system: Any, g: np.ndarray) -> np.ndarray:
    """Those of native code, through lists: a kick from rest."""
    start = system.state(mu=np.zeros((len(g), 6)), g=g)
    run = lm.integrate(system, lm.KickDrift(), start, h=1e-9, steps=1)
    return np.asarray(run.mu)[-1] / 1e-9


@pytest.mark.slow
def test_forces_through_lists_are_slopes_of_the_energy() -> None:
    system, mu, g = liquid(6, 5.0)
    found, group = forces(system, g), lm.SE3()
    scale = np.abs(found).max()
    for i in (0, 17, 215):
        for e in np.eye(6):
            ends = []
            for sign in (1.0, -1.0):
                moved = g.copy()
                moved[i] = group.compose_exp(g[i], 1e-4 * sign * e)
                ends.append(float(system.energy(0.0 * mu, moved)))
            assert abs((ends[1] - ends[0]) / 2e-4 - found[i] @ e) < 2e-6 * scale


@pytest.mark.slow
def test_a_box_of_twice_the_cutoff_and_molecules_in_other_images() -> None:
    system, _, g = liquid(6, 9.312)
    other = np.asarray(system.force(g))
    assert np.abs(forces(system, g) - other).max() < 1e-13 * np.abs(other).max()
    with pytest.raises(InvalidInput, match="half the box"):
        liquid(6, 9.3121)
    system, mu, g = liquid(6, 5.0)
    far = g.copy()
    far[:, :3, 3] += 18.624 * np.random.default_rng(3).integers(-5, 6, size=(216, 3))
    runs = [lm.integrate(system, lm.KickDrift(order=4), system.state(mu=mu, g=x), h=0.002, steps=20) for x in (g, far)]
    ours, theirs = (np.asarray(run.mu)[-1] for run in runs)
    assert np.abs(ours - theirs).max() < 1e-11 * np.abs(ours).max()


@pytest.mark.slow
def test_lists_made_anew_within_a_run_keep_the_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    system, mu, g = liquid(6, 5.0)
    made = []
    near = lists.Lists.at

    def counted(self: Any, there: np.ndarray) -> Any:
        before = self.places
        found = near(self, there)
        made.append(self.places is not before)
        return found

    monkeypatch.setattr(lists.Lists, "at", counted)
    for method in (lm.KickDrift(order=4), lm.LieVerlet()):
        plan = lm.Plan(system, method, h=0.002, progress=False)
        start, made[:] = system.state(mu=mu, g=g), []
        whole = plan.run(start, steps=60)
        assert sum(made) > 3
        for cuts in ((23, 14, 23), (1, 58, 1)):
            part = plan.run(start, steps=cuts[0])
            for steps in cuts[1:]:
                part = plan.resume(part, steps=steps)
            assert np.array_equal(np.asarray(part.mu)[-1], np.asarray(whole.mu)[-1])
            assert np.array_equal(np.asarray(part.g)[-1], np.asarray(whole.g)[-1])
        monkeypatch.setattr(lists, "SKIN", 0.3)
        wider = lm.Plan(system, method, h=0.002, progress=False).run(start, steps=60)
        monkeypatch.setattr(lists, "SKIN", 0.15)
        assert np.array_equal(np.asarray(wider.mu)[-1], np.asarray(whole.mu)[-1])


@pytest.mark.slow
def test_native_sums_are_those_of_plain_python_and_of_workers() -> None:
    system, mu, g = liquid(5, 4.0)
    start = system.state(mu=mu, g=g)
    given: list[dict[str, Any]] = [{}, {"compiled": False}, {"workers": 2}]
    runs = [lm.integrate(system, lm.KickDrift(), start, h=0.002, steps=2, **x) for x in given]
    for run in runs[1:]:
        assert np.array_equal(np.asarray(run.mu)[-1], np.asarray(runs[0].mu)[-1])


@pytest.mark.slow
@pytest.mark.parametrize("length", [1e-15, 1.0, 1e15])
def test_other_units_are_the_same_motion(length: float) -> None:
    """Lengths in other units, and energies in theirs squared: times and masses stay."""
    energy = length**2
    term = lm.models.SPC(
        A=SPC.A * length * energy ** (1.0 / 6.0),
        B=SPC.B * length * energy ** (1.0 / 12.0),
        length=length,
        coulomb=SPC.coulomb * length * energy,
    )
    ends = []
    for one, unit in ((SPC, 1.0), (term, length)):
        _, mu, g = liquid(2, 3.0)
        g = g.copy()
        g[:, :3, 3] *= unit
        mu = mu * np.array([unit**2] * 3 + [unit] * 3)
        bodies = lm.LiePoissonSystem(lm.SE3() ** 8, lm.PerSite(one.kinetic_energy))
        near = lm.neighbours.within(5.0 * unit, box=[12.0 * unit] * 3)
        system = lm.MechanicalSystem(bodies, lm.Terms(one.over(near)))
        start = system.state(mu=mu, g=g)
        run = lm.integrate(system, lm.KickDrift(order=4), start, h=0.001, steps=50)
        ends.append(np.asarray(run.mu)[-1] / np.array([unit**2] * 3 + [unit] * 3))
    assert np.abs(ends[1] - ends[0]).max() < 1e-10 * np.abs(ends[0]).max()


def test_points_are_found_once_and_give_what_pairs_give() -> None:
    """The sum of what pairs give, each with its own torque, is that of sums of pushes on atoms."""
    g = liquid(3, 4.6)[2]
    assert isinstance(SPC, PointTerm)
    bodies = lm.LiePoissonSystem(lm.SE3() ** 27, lm.PerSite(SPC.kinetic_energy))
    whole = lm.MechanicalSystem(bodies, lm.Terms(SPC.over(lm.neighbours.all_pairs())))
    found, sums, group = forces(whole, g), np.zeros((27, 6)), lm.SE3()
    site = [type("Site", (), {"g": lm.mat(*x.tolist())}) for x in g]
    for i in range(27):
        for j in range(i + 1, 27):
            for k, f in zip((i, j), SPC.forces(group, site[i], site[j]), strict=True):
                sums[k] += list(f)
    assert np.abs(found - sums).max() < 1e-13 * np.abs(sums).max()


@lm.record
class Square(lm.Term):
    """The square of a distance."""

    def energy(self, a: Any, b: Any) -> Any:
        return lm.dot(a.g - b.g, a.g - b.g)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_a_box_has_as_many_lengths_as_its_space(dim: int) -> None:
    """Two points across the border of a box, 0.2 apart along each axis; one number is a cube of space."""
    masses = lm.LiePoissonSystem(lm.VectorSpace(dim) ** 2, lm.PerSite(lm.KineticEnergy([1.0] * dim)))
    places = np.array([[0.1] * dim, [1.9] * dim])
    boxes = [[2.0] * dim] + [2.0] * (dim == 3)
    for box in boxes:
        near = lm.neighbours.within(1.0, box=box)
        energy = lm.MechanicalSystem(masses, lm.Terms(Square().over(near))).energy(0.0 * places, places)
        assert energy == pytest.approx(0.04 * dim, rel=1e-12)
