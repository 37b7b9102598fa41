"""Models beside 25-digit motions in coordinates of their own (docs/derivations/constrained_models.py)."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest
from constrained_scenes import plain, reference
from scenes import slow

import liemech as lm
from liemech.formulas import record, vec

KNOWN = reference("constrained_models")
G = KNOWN["gravity"]


@record
class Bead(lm.SeparableConstrainedSystem):
    """A bead on the parabola y = a x^2."""

    degrees: ClassVar[int] = 2
    a: float

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * lm.dot(p, p)

    def potential(self, q: lm.Vec) -> float:
        return G * q[1]

    def constraint(self, q: lm.Vec) -> lm.Vec:
        return vec(q[1] - self.a * q[0] ** 2)


def scene(name: str) -> tuple[Any, Any, dict[str, Any]]:
    """A system, its start, and where it will be."""
    known: Any = KNOWN[name] if name in KNOWN else KNOWN["linkages"][int(name[-1]) - 1]
    if name == "planar chain":
        chain: Any = lm.models.ChainPendulum(known["masses"], known["lengths"], G, dimension=2)
        along = [f(x) for x in known["angles"] for f in (np.sin, lambda x: -np.cos(x))]
        return chain, chain.consistent(chain.hanging(vec(*along)), np.zeros(6)), known
    if name == "spatial chain":
        chain = lm.models.ChainPendulum([1.0, 1.0], [1.0, 1.0], G)
        return chain, chain.state(known["q0"], known["v0"]), known
    if name == "bead":
        x = known["x0"]
        return Bead(known["a"]), Bead(known["a"]).state([x, known["a"] * x * x], [0.0, 0.0]), known
    if name == "ellipsoid":
        surface: Any = lm.models.ParticleOnEllipsoid(known["axes"])
        return surface, surface.state(known["q0"], known["v0"]), known
    loops = int(known["loops"])
    linkage: Any = lm.models.FourBarLinkage(loops)
    q = vec(*[x for j in range(loops + 1) for x in (float(j), 1.0)])
    return linkage, linkage.state(q, linkage.momentum(q, vec(*[1.0, 0.0] * (loops + 1)))), known


STEPS = {"planar chain": 40, "spatial chain": 40, "bead": 40, "ellipsoid": 20, "linkage 1": 6, "linkage 2": 6}


@pytest.mark.parametrize("name", [slow(name) if name in ("spatial chain", "linkage 2") else name for name in STEPS])
def test_models_are_where_they_should_be(name: str) -> None:
    """The reduced equation comes there to 9 digits, RATTLE to those of order 2 at two steps, the error falling as h^2."""
    system, start, known = scene(name)
    wanted, t = np.array(known["q"]), known["t"]
    n = STEPS[name]
    exact = plain(system, lm.RKMK(order=8), start, t / n, n).q[-1][: len(wanted)]
    assert np.abs(exact - wanted).max() < 3e-9
    errors = [
        np.abs(plain(system, lm.RATTLE(), start, t / n, n).q[-1][: len(wanted)] - wanted).max() for n in (n, 2 * n)
    ]
    assert errors[1] < 1e-2
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.25)


def test_the_energy_of_a_free_particle_is_kinetic() -> None:
    system = lm.models.ParticleOnEllipsoid(axes=[1.0, 1.5, 2.0], mass=1.7)
    q, p = np.array([0.6, -0.9, 1.058]), np.array([0.3, 0.2, -0.4])
    assert system.energy(q, p) == pytest.approx(p @ p / 3.4, rel=1e-15)
    assert not np.any(np.array(system.force(q, p))) and np.allclose(system.velocity(q, p), p / 1.7, rtol=1e-15)
