"""Coordinates of phase spaces, in which the derivative of a step and the Poisson bracket are
matrices: R^2n, duals of algebras, T*G, Poisson spaces, and the manifolds of constraints in them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...errors import InvalidInput, NotFinite
from ...formulas import jacobian, vec
from ...formulas.vectors import small
from ...rooms.constraints.constrained_body import BoundBody
from ...rooms.poisson.poisson import POISSON_SYSTEMS
from ...systems.canonical import HamiltonianSystem, PhaseSpace
from ...systems.cotangent import CotangentMotion
from ...systems.in_time.driven import DrivenHamiltonianSystem
from ...systems.many.energies import moving
from .sample_points import Units, flat, size
from .sample_states import pace

NEAR = 0.01
"""States are displaced by no more than this part of the units."""

FREE_OF_CONSTRAINTS = HamiltonianSystem, DrivenHamiltonianSystem
"""Systems whose phase space is all of R^2n."""


@dataclass(frozen=True)
class Charts:
    """Coordinates about the states of a system with a Poisson structure, in units of their size.

    whole : of a free body, is the group element a coordinate too?  On T*G coordinates are
    displacements xi of g, by g exp(xi), and changes of mu, and the structure is {xi_i,
    mu_j} = delta_ij with that of the dual of the algebra for the momenta.
    """

    system: Any
    begin: Any
    whole: bool
    reach: float = np.inf  # units are at most so many times the sizes of positions and momenta
    t: float = 0.0  # of conditions that move

    @cached_property
    def units(self) -> np.ndarray:
        """The unit of each coordinate."""
        if isinstance(self.system, PhaseSpace):
            n, rate = self.system.degrees, flat(self.system.rate(0.0, self.begin))
            v, f = size(rate[:n]), size(rate[n:])
            q, p, speed = size(self.begin.q), size(self.begin.p), pace(self.system, 0.0, self.begin)
            far_q, far_p = (max(x, min(y / speed, self.reach * x)) for x, y in ((q, v), (p, f)))
            return np.repeat([far_q or v / speed, far_p or f / speed], n)
        if isinstance(self.system, POISSON_SYSTEMS):
            y = np.abs(flat(self.begin.y))
            units = np.where(y > 0.1 * size(y), y, size(y) or 1.0)
            try:
                for sign in (-1.0, 1.0):
                    self.system.state(flat(self.begin.y) + sign * NEAR * units)
            except InvalidInput:  # there is a wall near by
                return np.where(y > 0.0, y, units)
            return units
        momenta = np.full(len(self.begin.mu), self._momentum)
        if not self.whole:
            return momenta
        group = self.group
        return np.concatenate([[1.0 / Units(group).length(e) for e in Units(group).axes], momenta])

    @cached_property
    def free(self) -> np.ndarray:
        """The numbers of the coordinates that move: all but those of sites that are held or pinned."""
        still: Any = np.zeros(0, dtype=int)
        if hasattr(self.begin, "mu"):
            moves = vec(*[1.0] * self.group.dim)
            for name in ("hamiltonian", "potential", "terms"):
                moves = moving(getattr(self.system, name, None), moves)
            still = np.flatnonzero(np.array(moves) == 0.0)
            still = np.concatenate([still, still + self.group.dim]) if self.whole else still
        return np.setdiff1d(np.arange(len(self.units)), still)

    @property
    def _momentum(self) -> float:
        """A size of momenta: of a body at rest what its force makes in the time in which it moves by its
        own size.
        """
        length = size(self.begin.mu)
        if length > 0.0 or not isinstance(self.system, CotangentMotion):
            return length
        force = size(flat(self.system.rates(self.t, self.begin.mu, self.begin.g)[1]))
        return force / (pace(self.system, 0.0, self.begin) or 1.0) or 1.0

    @property
    def group(self) -> Any:
        """The group of the configurations, or of the equation."""
        return (
            self.system.configurations if isinstance(self.system, (CotangentMotion, BoundBody)) else self.system.group
        )

    def displaced(self, x: np.ndarray) -> dict[str, np.ndarray]:
        """The state with these coordinates about the start."""
        x = x * self.units
        first = self.begin.arrays
        n = len(x) // 2
        if isinstance(self.system, FREE_OF_CONSTRAINTS):
            return {"q": first["q"] + x[:n], "p": first["p"] + x[n:]}
        if isinstance(self.system, POISSON_SYSTEMS):
            return {"y": first["y"] + x}
        if not self.whole:
            return {"mu": first["mu"] + x}
        g = self.group.compose(self.begin.g, self.group.exp(small(x[:n])))
        return {"mu": first["mu"] + x[n:], "g": np.asarray(g)}

    def coordinates(self, about: Any, state: dict[str, np.ndarray]) -> np.ndarray:
        """The coordinates of a state about another one."""
        if isinstance(self.system, FREE_OF_CONSTRAINTS):
            return np.concatenate([state["q"] - flat(about.q), state["p"] - flat(about.p)]) / self.units
        if isinstance(self.system, POISSON_SYSTEMS):
            return (state["y"] - flat(about.y)) / self.units
        change = state["mu"] - flat(about.mu)
        if not self.whole:
            return change / self.units
        g = self.group.log(self.group.compose(self.group.inverse(about.g), small(state["g"])))
        return np.concatenate([flat(g), change]) / self.units

    def structure(self, at: Any) -> np.ndarray:
        """The Poisson structure at a state, in these units."""
        if isinstance(self.system, FREE_OF_CONSTRAINTS):
            n = self.system.degrees
            whole = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
        elif isinstance(self.system, POISSON_SYSTEMS):
            whole = np.asarray(self.system.structure.matrix(at.y))
        else:
            momenta = np.asarray(self.group.algebra.poisson_structure(at.mu))
            identity = np.eye(len(momenta))
            whole = np.block([[0.0 * identity, identity], [-identity, momenta]]) if self.whole else momenta
        return whole / np.outer(self.units, self.units)

    def at_time(self, t: float) -> Charts:
        """The coordinates at time t, in these units."""
        return self

    def defect(self, trial: Any, apart: float) -> float:
        """|Phi' B Phi'^T - B(Phi)| beside |Phi'|^2 |B| + |B(Phi)|."""
        free, (end, D) = np.ix_(self.free, self.free), self.moved(trial, apart)
        B, right = self.structure(self.begin)[free], self.at_time(trial.until).structure(end)[free]
        left = D[self.free] @ B @ D[self.free].T
        scale = np.abs(D).max() ** 2 * np.abs(B).max() + np.abs(right).max()
        return float(np.abs(left - right).max() / scale)

    def moved(self, trial: Any, apart: float) -> tuple[Any, np.ndarray]:
        """The end of a step, and its derivative by the coordinates that move, by differences of order eight or four."""
        weights, directions = trial.weights, np.eye(len(self.units))[self.free]
        size, half = len(weights), len(weights) // 2
        shifts = [k * apart * e for e in directions for k in range(-half, half + 1)]
        ends = trial.ends([self.displaced(x) for x in shifts])
        end = type(self.begin)(**{name: small(np.asarray(x)) for name, x in ends[half].items()})
        chart = self.at_time(trial.until)
        coordinates = [chart.coordinates(end, state) for state in ends]
        columns = [
            sum(w * coordinates[size * j + k] for k, w in enumerate(weights)) / apart for j in range(len(directions))
        ]
        return end, np.stack(columns, axis=1)


def along(rows: np.ndarray) -> np.ndarray:
    """An orthonormal basis of the directions in which conditions with these derivatives stay as they are.  Raises
    NotFinite where these are infinite or nan, as after steps that have left all bounds.
    """
    if not np.isfinite(rows).all():
        raise NotFinite("check_method: the conditions have no finite derivatives where a step leads; give a smaller h")
    sizes = np.linalg.norm(rows, axis=1, keepdims=True)
    _, _, basis = np.linalg.svd(rows / np.where(sizes > 0.0, sizes, 1.0))
    return np.asarray(basis[len(rows) :].T)


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
        return along(rows)

    def displaced(self, x: np.ndarray) -> dict[str, np.ndarray]:
        """The consistent state near the start with these coordinates."""
        n = self.system.degrees
        y = np.array([*self.begin.q, *self.begin.p]) + self.sizes * (self.tangent(self.begin) @ x)
        q = self.system.across(small(y[:n]), self.begin.p, self.begin.q)
        return {"q": flat(q), "p": flat(self.system.tangent(q, small(y[n:])))}

    def coordinates(self, about: Any, state: dict[str, np.ndarray]) -> np.ndarray:
        """The components along the manifold of the change from a state to another one."""
        change = np.concatenate([state["q"] - flat(about.q), state["p"] - flat(about.p)])
        return np.asarray(self.tangent(about).T @ (change / self.sizes))

    def structure(self, at: Any) -> np.ndarray:
        """The inverse of dq dp on the tangent space, in units of q times units of p."""
        n, basis = self.system.degrees, self.tangent(at)
        q, p = basis[:n], basis[n:]
        return np.asarray(np.linalg.inv(p.T @ q - q.T @ p))


class BoundCharts(ConstrainedCharts):
    """Orthonormal coordinates of tangent spaces of {c(g) = 0, G J^-1 mu = 0} in T*G, in units of
    the size of displacements and momenta.

    A displaced state is the consistent one that is nearest to g exp(xi) and a changed mu.
    """

    def at_time(self, t: float) -> Charts:
        return replace(self, t=t)

    @cached_property
    def ambient(self) -> Charts:
        """The coordinates of T*G, without regard to the constraints."""
        return Charts(self.system, self.begin, True)

    @cached_property
    def sizes(self) -> np.ndarray:
        """The units of (xi, mu)."""
        return self.ambient.units

    def tangent(self, at: Any) -> np.ndarray:
        """An orthonormal basis of the tangent space, (2 dim, dim M), in these units."""
        system, group = self.system, self.group
        n = group.dim

        def both(y: Any) -> Any:
            xi, change = vec(*[y[i] for i in range(n)]), vec(*[y[n + i] for i in range(n)])
            c, speed = system.conditions_at(at.mu + change, group.compose_exp(at.g, xi), self.t)
            return vec(*c, *speed)

        rows = np.array(jacobian(both, vec(*[0.0 for _ in range(2 * n)])), dtype=float)
        rows = rows * self.sizes
        return along(rows)

    def displaced(self, x: np.ndarray) -> dict[str, np.ndarray]:
        first, n = self.begin, self.group.dim
        y = self.sizes * (self.tangent(first) @ x)
        g = self.group.compose_exp(first.g, small(y[:n]))
        return dict(self.system.consistent(flat(first.mu) + y[n:], np.asarray(g)).arrays)

    def coordinates(self, about: Any, state: dict[str, np.ndarray]) -> np.ndarray:
        return np.asarray(self.tangent(about).T @ self.ambient.coordinates(about, state))

    def structure(self, at: Any) -> np.ndarray:
        """The inverse of the two-form on the tangent space."""
        basis = self.tangent(at)
        form = np.linalg.inv(self.ambient.structure(at))
        return np.asarray(np.linalg.inv(basis.T @ form @ basis))
