"""Models of which nothing is said: unit masses and lengths, standard gravity, published numbers."""

from __future__ import annotations

import dataclasses
import inspect
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.joints.linkage import Linkage, chain
from liemech.models.charged_particle import GuidingCentreStructure, MagneticStructure
from liemech.models.lattices.maxwell_bloch import HalfSquare, MaxwellBlochStructure
from liemech.models.planets.n_body import EIGHT_PERIOD

STANDARD_GRAVITY, E1, E2, E3 = 9.80665, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
ORIGIN = (0.0, 0.0, 0.0)
ENDS = {"at_first": ORIGIN, "at_second": ORIGIN}
MODELS: dict[type, dict[str, Any]] = {
    lm.models.AndrewsMechanism: {"degrees": 7, "moment": 0.033, "stiffness": 4530.0, "rest": 0.07785},
    lm.models.AxialField: {"slope": 1.0},
    MagneticStructure: {"dim": 6, "rank": 6},
    GuidingCentreStructure: {"dim": 4, "rank": 4},
    lm.SphericalPendulum: {"degrees": 3, "mass": 1.0, "length": 1.0, "gravity": STANDARD_GRAVITY},
    lm.models.ChainPendulum: {"masses": (1.0, 1.0), "lengths": (1.0, 1.0), "gravity": STANDARD_GRAVITY, "dimension": 3},
    lm.models.FourBarLinkage: {"loops": 1, "mass": 1.0, "length": 1.0, "gravity": 9.81},
    lm.models.FermiPastaUlam: {"particles": 32, "alpha": 0.25, "beta": 0.0},
    lm.models.OrthonormalFrame: {"mass": 1.0},
    lm.models.UniformGravity: {"centre": ORIGIN},
    lm.models.HenonHeiles: {"degrees": 2, "coupling": 1.0},
    lm.joints.BallJoint: {"conditions": 3} | ENDS,
    lm.joints.RevoluteJoint: {"conditions": 5, "axis_first": E3, "axis_second": E3} | ENDS,
    lm.joints.UniversalJoint: {"conditions": 4, "axis_first": E1, "axis_second": E2} | ENDS,
    lm.joints.PrismaticJoint: {"conditions": 5, "axis": E3, "attitude": (E1, E2, E3)} | ENDS,
    lm.joints.RigidRod: {"conditions": 1, "length": 1.0} | ENDS,
    lm.joints.Strut: {"conditions": 0} | ENDS,
    lm.Kepler: {"degrees": 2, "attraction": 1.0},
    Linkage: {"gravity": STANDARD_GRAVITY},
    lm.models.LotkaVolterra: {"coupling": ((0.0, 1.0), (-1.0, 0.0)), "weights": (1.0, 1.0), "rates": (1.0, 2.0)},
    MaxwellBlochStructure: {"dim": 3, "rank": 2},
    HalfSquare: {"weight": 1.0},
    lm.models.NBody: {"gravity": 1.0, "dimension": 3},
    lm.models.OrthogonalBody: {"degrees": 9, "inertia": (1.0, 1.5, 2.0)},
    lm.models.ParticleOnEllipsoid: {"axes": (1.0, 1.5, 2.0), "mass": 1.0},
    lm.models.Pendulum: {"degrees": 1, "mass": 1.0, "length": 1.0, "gravity": STANDARD_GRAVITY},
    lm.models.DoublePendulum: {"degrees": 2, "masses": (1.0, 1.0), "lengths": (1.0, 1.0), "gravity": STANDARD_GRAVITY},
    lm.models.PlanetarySystem: {"gravity": 1.0},
    lm.joints.Blade: {"behind": 0.0},
    lm.joints.Rolling: {"radius": 1.0},
    lm.joints.Suslov: {"axis": E3},
    lm.models.FallingBody: {"gravity": STANDARD_GRAVITY},
}


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_what_a_model_is_when_nothing_is_said(model: type) -> None:
    found = {
        f.name: f.default
        for f in dataclasses.fields(model)
        if f.name in MODELS[model] and f.default is not dataclasses.MISSING
    }
    found |= {name: getattr(model, name) for name in MODELS[model].keys() - found.keys()}
    assert {name: np.array(x).tolist() for name, x in found.items()} == {
        name: np.array(x).tolist() for name, x in MODELS[model].items()
    }


def test_chains_are_of_unit_rods() -> None:
    given = {name: p.default for name, p in inspect.signature(chain).parameters.items()}
    assert given["gravity"] == STANDARD_GRAVITY
    assert (given["mass"], given["length"], given["radius"]) == (1.0, 1.0, 0.05)


# ---------------------------------------------------------------- published numbers


def test_the_outer_planets_are_on_their_orbits() -> None:
    """Half axes in AU, eccentricities, inclinations to the ecliptic in degrees: mean elements of
    J2000; perturbations change those seen from the Sun by up to 2 % and 0.02.

    Source: Standish, Keplerian elements for approximate positions of the major planets, JPL.
    """
    system, start = lm.models.NBody.outer_solar_system(barycentric=False)
    masses = np.array(system.masses)
    q, v = np.reshape(start.q, (6, 3)), np.reshape(start.p, (6, 3)) / masses[:, None]
    assert not q[0].any() and not v[0].any() and masses[0] == pytest.approx(1.0 + 5.98e-6, abs=1e-8)
    elements = [(5.203, 0.048, 1.30), (9.54, 0.054, 2.49), (19.19, 0.047, 0.77)]
    elements += [(30.07, 0.0086, 1.77), (39.48, 0.249, 17.14)]
    for x, w, m, (axis, eccentricity, inclination) in zip(q[1:], v[1:], masses[1:], elements):
        k, r = system.gravity * (masses[0] + m), np.linalg.norm(x)
        assert 1.0 / (2.0 / r - w @ w / k) == pytest.approx(axis, rel=0.02)
        turning = np.cross(x, w)
        assert np.linalg.norm(np.cross(w, turning) / k - x / r) == pytest.approx(eccentricity, abs=0.02)
        pole = np.array([0.0, -np.sin(np.radians(23.44)), np.cos(np.radians(23.44))])
        cosine = pole @ turning / np.linalg.norm(turning)
        assert np.degrees(np.arccos(cosine)) == pytest.approx(inclination, abs=0.05)
    # the Sun over the planet: Jupiter, ..., Pluto
    ratios = 1.0 / masses[1:]
    assert ratios == pytest.approx([1047.35, 3501.6, 22869.0, 19314.0, 1.3e8], rel=1e-4)
    assert system.gravity == pytest.approx(0.01720209895**2, rel=1e-11)


def test_three_bodies_on_an_eight_are_each_where_the_next_one_was() -> None:
    """After a third of the period: the first is where the second was, and so on."""
    system, start = lm.models.NBody.figure_eight()
    period = EIGHT_PERIOD
    run = lm.integrate(system, lm.RKMK(order=8), start, h=period / 90, steps=30, every=30, compiled=False)
    for now, then in ((run.q[-1], run.q[0]), (run.p[-1], run.p[0])):
        assert np.abs(now.reshape(3, 2) - np.roll(then.reshape(3, 2), -1, axis=0)).max() < 2e-8
    assert tuple(system.masses) == (1.0, 1.0, 1.0) and system.gravity == 1.0
    assert np.abs(run.p.reshape(-1, 3, 2).sum(axis=1)).max() < 1e-14


def test_momenta_of_points_are_sums() -> None:
    rng = np.random.default_rng(5)
    for dimension in (2, 3):
        system = lm.models.NBody([1.0, 2.0, 0.5, 3.0], 1.0, dimension)
        q, p = rng.normal(size=(2, 4, dimension))
        mine = lm.vec(*q.ravel()), lm.vec(*p.ravel())
        assert np.allclose(system.momentum(mine[1]), p.sum(axis=0), rtol=1e-14)
        flat = np.pad(q, ((0, 0), (0, 3 - dimension))), np.pad(p, ((0, 0), (0, 3 - dimension)))
        wanted = np.cross(*flat).sum(axis=0)[0 if dimension == 3 else 2 :]
        assert np.allclose(system.angular_momentum(*mine), wanted, rtol=1e-13)
        kept = system.constants({"q": q.reshape(1, -1), "p": p.reshape(1, -1)})
        assert np.allclose(kept["momentum"], p.sum(axis=0), rtol=1e-14)
