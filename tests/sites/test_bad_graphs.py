"""Graphs, terms and parameters of sites that cannot be meant: each is named, with the edge."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import Spring
from terms_of_spins import Exchange, Zeeman

import liemech as lm
from liemech import neighbours as near
from liemech.errors import IncompatibleSystem, InvalidInput, InvalidType

SPIN = lm.SO3()


@lm.record
class Skew(lm.Term):
    J: float

    def energy(self, a: Any, b: Any) -> float:
        return -self.J * a.mu[0] * b.mu[1]


@lm.record
class Uneven(lm.Term):
    def energy(self, a: Any, b: Any) -> float:
        return a.q * lm.dot(a.mu, b.mu)


@lm.record
class Volume(lm.Term):
    def energy(self, a: Any, b: Any, c: Any) -> float:
        return lm.dot(a.mu, lm.cross(b.mu, c.mu))


@lm.record
class Pull(lm.Term):
    def energy(self, a: Any, b: Any) -> float:
        return -1.0 / lm.norm(a.g - b.g)


def spins(terms: Any, n: int = 4) -> Any:
    return lm.LiePoissonSystem(SPIN**n, terms)


def masses(terms: Any, n: int = 3) -> Any:
    kinetic = lm.PerSite(lm.KineticEnergy([1.0, 1.0, 1.0]))
    return lm.MechanicalSystem(lm.LiePoissonSystem(lm.VectorSpace(3) ** n, kinetic), terms)


def coupled(**options: Any) -> Any:
    return spins(lm.Terms(Exchange(1.0).over(near.ring(4)), **options))


EACH = lm.each
WRONG: dict[str, Any] = {
    r"edge 1, \(2, 2\), ties a site to itself": lambda: near.edges([(0, 1), (2, 2)]),
    r"edge 0, \(0, 5\), names a site .* 0 to 3": lambda: near.edges([(0, 5)], sites=4),
    r"edge 0, \(-1, 2\), names a site": lambda: near.edges([(-1, 2)]),
    r"edges 0, \(0, 1\), and 1, \(0, 1\), are the same": lambda: near.edges([(0, 1), (0, 1)]),
    r"edges 0, \(0, 1\), and 1, \(1, 0\)": lambda: near.edges([(0, 1), (1, 0)], ordered=False),
    r"\(0, 1\), and 1, \(1, 0\), are the same": lambda: spins(
        Exchange(1.0).over(near.edges([(0, 1), (1, 0)], sites=4))
    ),
    "whole numbers, those of sites; got float64": lambda: near.edges([[0.5, 1]]),
    "got float": lambda: near.edges([(0, np.nan)]),
    "there are not so many": lambda: near.edges([(0, 2**63)]),
    "got object": lambda: near.edges([(0, 10**30)]),
    "ragged": lambda: near.edges([[0, 1], [2]]),
    r"shape \(edges, 2\).*got \(2,\)": lambda: near.edges([0, 1]),
    "got <U": lambda: near.edges([("0", "1")]),
    "sites must be a whole number": lambda: near.edges([(0, 1)], sites=2.5),  # type: ignore[arg-type]
    "ordered is True, False or None; got 1": lambda: near.edges([(0, 1)], ordered=1),  # type: ignore[arg-type]
    r"not the same with its sites exchanged.*\(0, 1\)": lambda: spins(Skew(1.0).over(near.ring(4))),
    "do not say which is the first": lambda: spins(Skew(1.0).over(near.all_pairs())),
    "Uneven: its energy": lambda: spins(lm.Terms(Uneven().over(near.ring(4)), q=EACH([1.0, 2.0, 3.0, 4.0]))),
    r"the edge \(0, 0\) ties": lambda: near.ring(1),
    r"edges \(0, 1\) and \(1, 0\) are the same": lambda: near.ring(2),
    r"edges \(0, 2\) and \(2, 0\) are the same": lambda: near.square(2, 2),
    "chain: a length must": lambda: near.chain(0),
    r"got \(None, None\)": lambda: near.square(3, 3, periodic=None),
    "for each of 2 axes": lambda: near.square(3, 3, periodic=(True,)),
    "beyond half the box, 4.5": lambda: near.within(5.0, box=[9.0, 9.0, 9.0]),
    "positive; got": lambda: near.within(1.0, box=[9.0, -9.0, 9.0]),
    r"positive; got Vec\(\)": lambda: near.within(1.0, box=[]),
    "inner a shorter one": lambda: near.within(1.0, inner=2.0),
    "cutoff is one distance": lambda: near.within([1.0, 2.0]),  # type: ignore[arg-type]
    "cutoff must be real": lambda: near.within("a"),  # type: ignore[arg-type]
    "cutoff is nan": lambda: near.within(np.nan),
    "the box has 2 lengths": lambda: masses(Spring(1.0).over(near.within(1.0, box=[9.0, 9.0]))),
    r"SO3\(\) have not": lambda: spins(Exchange(1.0).over(near.within(1.0))),
    "come and go": lambda: masses(Spring(EACH([1.0])).over(near.within(1.0))),
    "has 5 sites, and the system 4": lambda: spins(Exchange(1.0).over(near.ring(5))),
    r"a graph, such as .*got \[\(0, 1\)\]": lambda: Exchange(1.0).over([(0, 1)]),
    "say over which edges": lambda: Exchange(1.0).over(),
    "takes three sites": lambda: Volume().over(near.ring(4)),
    r"edge 0, \(0, 1, 1\), ties": lambda: near.edges([(0, 1, 1)]),
    "2 values, and .* has 4 edges": lambda: spins(Exchange(EACH([1.0, 2.0])).over(near.ring(4))),
    "3 values, and .* has 4 sites": lambda: spins(Zeeman(EACH(np.ones((3, 3))))),
    "J is a number for each": lambda: Exchange(EACH(np.ones((4, 3)))),
    "B is a vector for each": lambda: Zeeman(EACH(np.ones(4))),
    "names site 7": lambda: coupled(held=[7]),
    "names site -1": lambda: coupled(held=[-1]),
    "held is the numbers of sites": lambda: coupled(held=[0.5]),
    "held is the numbers of sites.*got 'a'": lambda: coupled(held="a"),
    "2 values for 4 sites": lambda: coupled(mass=EACH([1.0, 2.0])),
    "mass.* is nan": lambda: coupled(mass=np.nan),
    "mu is no parameter": lambda: coupled(mu=1.0),
    "no 'g'|a.g does not count": lambda: spins(Spring(1.0).over(near.ring(4))),
    "a.mu does not count": lambda: masses(Exchange(1.0).over(near.ring(3))),
    r"SO3\(\) \*\* sites": lambda: lm.LiePoissonSystem(SPIN, Exchange(1.0).over(near.ring(3))),
    "sites 0 and 2 are in one place.*edge": lambda: masses(Pull().over(near.all_pairs())).state(
        mu=np.zeros((3, 3)), g=[[0, 0, 0], [1, 0, 0], [0, 0, 0]]
    ),
    "masses 0 and 2 are in one place": lambda: lm.models.NBody([1.0, 1.0, 1.0]).state(
        [0, 0, 0, 1, 0, 0, 0, 0, 0], np.zeros(9)
    ),
    r"base is the group of one site": lambda: (SPIN**2) ** 2,
    "those of SE3.. have 6": lambda: lm.LiePoissonSystem(lm.SE3() ** 3, lm.PerSite(lm.KineticEnergy([1.0, 2.0, 3.0]))),
}


@pytest.mark.parametrize("words", WRONG)
def test_what_cannot_be_meant_is_named(words: str) -> None:
    with pytest.raises((InvalidInput, InvalidType, IncompatibleSystem), match=words):
        WRONG[words]()
