"""The implicit Runge-Kutta methods of Gauss, Radau and Lobatto, with any number of stages.

Source: Hairer and Wanner, Solving Ordinary Differential Equations II, 2nd ed., IV.5; Hairer,
Lubich, Wanner, II.1.3 and II.1.4.
"""

from __future__ import annotations

import functools

from ..errors import InvalidInput
from ..formulas.calls.arguments import ordinary
from .tableau import ButcherTableau

MOST_STAGES = 20


def gauss(stages: int) -> ButcherTableau:
    """Gauss' method, of order 2 s: collocation at the zeros of the s-th derivative of x^s
    (x - 1)^s.

    Symplectic, symmetric and A-stable.

    Raises InvalidInput unless stages is a whole number from 1 to 20.
    Source: Hairer, Lubich, Wanner, II.1.3; Hairer and Wanner, IV.5.
    """
    return _member("Gauss", stages)


def radau_iia(stages: int) -> ButcherTableau:
    """Radau IIA, of order 2 s - 1: collocation at the zeros of the (s-1)-st derivative of x^(s-1)
    (x - 1)^s.  L-stable.

    Raises InvalidInput unless stages is a whole number from 1 to 20.
    Source: Hairer and Wanner, IV.5.
    """
    return _member("Radau IIA", stages)


def lobatto_iiia(stages: int) -> ButcherTableau:
    """Lobatto IIIA, of order 2 s - 2: collocation at the zeros of the (s-2)-nd derivative of
    x^(s-1) (x - 1)^(s-1).  Symmetric.

    Raises InvalidInput unless stages is a whole number from 2 to 20.
    Source: Hairer and Wanner, IV.5.
    """
    return _member("Lobatto IIIA", stages)


def lobatto_iiib(stages: int) -> ButcherTableau:
    """Lobatto IIIB, of order 2 s - 2: the partner of Lobatto IIIA in a symplectic pair, b_i
    a_ij + b_j a'_ji = b_i b_j.  Symmetric.

    With two stages the rows of A sum to 1/2, which therefore are the nodes: alone it is the
    implicit midpoint rule, twice.
    Raises InvalidInput unless stages is a whole number from 2 to 20.
    Source: Hairer, Lubich, Wanner, II.1.4 and VI.4.
    """
    return _member("Lobatto IIIB", stages)


def lobatto_iiic(stages: int) -> ButcherTableau:
    """Lobatto IIIC, of order 2 s - 2: a_i1 = b_1, and C(s - 1) fixes the rest of A.  L-stable.

    Raises InvalidInput unless stages is a whole number from 2 to 20.
    Source: Hairer and Wanner, IV.5.
    """
    return _member("Lobatto IIIC", stages)


def _member(name: str, stages: int) -> ButcherTableau:
    fewest, stages = 2 if name.startswith("Lobatto") else 1, ordinary(stages)
    if type(stages) is not int or not fewest <= stages <= MOST_STAGES:
        raise InvalidInput(f"{name} has from {fewest} to {MOST_STAGES} stages; got {stages!r}")
    return _computed(name, stages)


@functools.cache
def _computed(name: str, s: int) -> ButcherTableau:
    # when needed, for an import does not wait for `decimal`
    from .collocation_digits import rounded

    order = 2 * s - {"Gauss": 0, "Radau IIA": 1}.get(name, 2)
    return ButcherTableau.shipped(
        f"{name} {order}", order, *rounded(name, s), "Hairer and Wanner, Solving ODEs II, 2nd ed., IV.5"
    )
