"""The motion of every part of every shipped energy is that of its energy, and its slopes are those of its energy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.formulas import vec

RNG = np.random.default_rng(8)


@lm.record
class Well(lm.Hamiltonian):
    """A potential of places."""

    def energy(self, mu: lm.Vec) -> float:
        return 0.3 * mu[0] * mu[0] + 0.2 * mu[1] * mu[2] + mu[2]


SYSTEMS: dict[str, Any] = {
    "two species": lm.models.LotkaVolterra(),
    "species with weights": lm.models.LotkaVolterra(
        [[0.0, 0.5, -0.3], [-0.5, 0.0, 0.8], [0.3, -0.8, 0.0]], [1.0, 2.0, 0.7], [0.4, 1.0, 1.5]
    ),
    "a lattice of species": lm.models.LotkaVolterra.volterra_lattice(4),
    "open chain": lm.models.TodaLattice(4),
    "ring": lm.models.TodaLattice(4, True),
    "light": lm.models.MaxwellBloch(),
    "a charge": lm.models.ChargedParticle(lm.models.AxialField(0.3), Well()),
    "a free charge": lm.models.ChargedParticle(lm.models.UniformField([0.3, -0.4, 1.2])),
    "in a tokamak": lm.models.ChargedParticle(lm.models.TokamakField(), Well()),
    "a top": lm.models.PoissonTop([1.2, 1.5, 0.7], 2.0, [0.3, -0.2, 0.5]),
    "planets": lm.models.PlanetarySystem([1.0, 0.3, 0.2, 0.4], 1.7),
}


def slope(f: Callable[[float], Any], t: float, e: float) -> Any:
    """The derivative of a function, to the fourth order of e."""
    return (8.0 * (f(t + e) - f(t - e)) - (f(t + 2 * e) - f(t - 2 * e))) / (12.0 * e)


@pytest.mark.parametrize("name", SYSTEMS)
def test_flows_are_motions(name: str) -> None:
    system = SYSTEMS[name]
    y, t, e = RNG.uniform(0.5, 1.2, system.structure.dim), 0.3, 1e-4
    found = []
    for part in system.parts:

        def energies(s: float, part: Any = part) -> np.ndarray:
            return np.array([part.energy(vec(*(y + s * x))) for x in np.eye(len(y))])

        slopes = slope(energies, 0.0, e)
        assert np.allclose(part.gradient(vec(*y)), slopes, rtol=1e-8, atol=1e-9)

        def at(t: float, part: Any = part) -> np.ndarray:
            return np.array(part.flow(system.structure, vec(*y), t))

        rate = slope(at, t, e)
        there = vec(*at(t))
        wanted = np.array(system.structure.sharp(there, part.gradient(there)))
        assert np.allclose(rate, wanted, rtol=1e-8, atol=1e-9)
        assert np.allclose(at(0.0), y, rtol=1e-15)
        found.append(slopes)
    assert len(found) > 1
    whole = np.array(system.gradient(vec(*y)))
    assert np.allclose(sum(found), whole, rtol=1e-8, atol=1e-9)
    assert np.allclose(system.velocity(vec(*y)), np.array(system.structure.matrix(vec(*y))) @ whole, rtol=1e-12)
    rank = np.linalg.matrix_rank(np.array(system.structure.matrix(vec(*y))), tol=1e-10)
    assert system.structure.rank in (rank, None)
