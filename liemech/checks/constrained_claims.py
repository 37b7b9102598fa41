"""What methods on constraints claim: the constraints hold, and the two-form of the manifold is
kept, in coordinates of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from ..formulas import jacobian, vec
from ..formulas.broadcasting import small
from .method_claims import Charts, Trial, bracket, claims
from .report import Observation
from .sample_points import flat


def constrained_claims(trial: Trial, keeps: tuple[str, ...], native: bool) -> Iterator[Observation]:
    """All claims in turn; a symplectic method keeps both constraints."""
    symplectic = trial.method.symplectic
    yield from claims(
        trial, (*keeps, *(("constraint", "hidden constraint") if symplectic else ())), native
    )
    charts = ConstrainedCharts(trial.system, trial.start, True)
    yield bracket(
        trial,
        charts,
        "symplectic",
        "dq dp on the constraints is kept: Phi' B Phi'^T = B(Phi)",
        symplectic,
    )


class ConstrainedCharts(Charts):
    """Orthonormal coordinates of tangent spaces of M, in units of the size of positions and
    momenta.

    A displaced state is start + displacement, moved across the constraints; coordinates of others
    are those of their projection.
    """

    @cached_property
    def sizes(self) -> np.ndarray:
        """The units of (q, p)."""
        return Charts(self.system, self.begin, self.whole).units

    @cached_property
    def units(self) -> np.ndarray:
        """The coordinates are without units."""
        return np.ones(self.tangent(self.begin).shape[1])

    def tangent(self, at: Any) -> np.ndarray:
        """An orthonormal basis of the tangent space of M, (2 n, dim M), in these units."""
        system, n = self.system, len(at.q)

        def both(y: Any) -> Any:
            q, p = vec(*[y[i] for i in range(n)]), vec(*[y[n + i] for i in range(n)])
            return vec(*system.constraint(q), *system.hidden_constraint(q, p))

        rows = np.array(jacobian(both, vec(*at.q, *at.p))) * self.sizes
        _, _, basis = np.linalg.svd(rows / np.linalg.norm(rows, axis=1, keepdims=True))
        return np.asarray(basis[len(rows) :].T)

    def displaced(self, x: np.ndarray) -> dict[str, np.ndarray]:
        """The consistent state near the start with these coordinates."""
        n = self.system.degrees
        y = np.array([*self.begin.q, *self.begin.p]) + self.sizes * (self.tangent(self.begin) @ x)
        q = self.system.across(small(y[:n]), self.begin.p, self.begin.q)
        return {"q": flat(q), "p": flat(self.system.tangent(q, small(y[n:])))}

    def coordinates(self, about: Any, state: dict[str, np.ndarray]) -> np.ndarray:
        """Those of the change that are along the manifold."""
        change = np.concatenate([state["q"] - flat(about.q), state["p"] - flat(about.p)])
        return np.asarray(self.tangent(about).T @ (change / self.sizes))

    def structure(self, at: Any) -> np.ndarray:
        """The inverse of dq dp on the tangent space, in units of those of q times those of p."""
        n, basis = self.system.degrees, self.tangent(at)
        q, p = basis[:n], basis[n:]
        return np.asarray(np.linalg.inv(p.T @ q - q.T @ p))
