"""A system near one of its states: the field of its motion, momenta, and the motions that these generate.

    on T*G, left-trivialised         g = g_0 exp(x),  mu = mu_0 + nu,        z = (x, nu)
    two-form at mu                   omega(z, z') = <nu', x> - <nu, x'> + <mu, [x, x']>
    motion of a function F           v = dF/dmu,  mu' = ad*_v mu - D_g F,    of the energy xi and ad*_xi mu + f

Momenta are the functions <mu, X(g)>.  Those looked at here are of left translations, X = Ad_{g^-1} zeta, of right ones,
X = chi, and, where a factor of the group is R^n, of linear maps, X = S x.

Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 4.4, 12.1 and 12.2.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import Any

import numpy as np

from ...errors import IncompatibleSystem
from ...formulas import Vec, dot, jacobian, vec
from ...formulas.classes.frozen import frozen
from ...formulas.numbers.anything import indices_in, traced
from ...formulas.vectors import small
from ...groups.composed.product import DirectSum
from ...groups.lie_group import LieGroup
from ...groups.vector_space import VectorSpace
from ...systems.canonical import CanonicalState, HamiltonianSystem
from ...systems.cotangent import CotangentMotion
from ...systems.lie_poisson import BodyState, LiePoissonSystem

FAINT = 1e-6
"""Beside the sizes of the other parts of a state, how small a part says nothing of its own size."""


@frozen
class NearState:
    """The states of a system near one of them.

    group : G.  g : an element.  mu : (dim,).
    """

    system: Any
    group: LieGroup
    g: Any
    mu: Vec

    @property
    def dim(self) -> int:
        """The dimension of G, half of that of T*G."""
        return self.group.dim

    @property
    def state(self) -> Any:
        """The state itself, without an element where the system needs none."""
        canonical = isinstance(self.system, HamiltonianSystem)
        return CanonicalState(self.g, self.mu) if canonical else BodyState(self.mu, self.g)

    def moved(self, z: np.ndarray) -> NearState:
        """The states near the one at z."""
        g, mu = self.at(vec(*z.tolist()))
        return NearState(self.system, self.group, g, mu)

    # ---------------------------------------------------------------- formulas

    def at(self, z: Vec) -> tuple[Any, Vec]:
        """g exp(x) and mu + nu."""
        n = self.dim
        return self.group.compose_exp(self.g, z[:n]), self.mu + z[n:]

    def field(self, z: Vec) -> Vec:
        """(xi, mu') at z: the body velocity, and the rate of the body momentum."""
        g, mu = self.at(z)
        if isinstance(self.system, HamiltonianSystem):
            return vec(*self.system.velocity(g, mu), *self.system.force(g, mu))
        if isinstance(self.system, LiePoissonSystem):
            xi = self.system.velocity(mu)
            return vec(*xi, *self.group.ad_star(xi, mu))
        xi, force = self.system.rates(0.0, mu, g)
        return vec(*xi, *(self.group.ad_star(xi, mu) + force))

    def momenta(self, z: Vec) -> Vec:
        """<mu, X(g)>, (m,), of left and right translations and of linear maps."""
        g, mu = self.at(z)
        linear = [mu[place] * x for place, _ in self.vectors(g) for _, x in self.vectors(g)]
        right = [] if self.only_adds else mu
        return vec(*self.group.K(g, mu), *right, *linear)

    def generated(self, of_momenta: Vec, z: Vec) -> Vec:
        """The motion at z, (v, mu'), that a sum of these momenta generates.  of_momenta : (m,), its coefficients."""
        g, mu = self.at(z)
        n = self.dim
        left, used = self.group.Ad(self.group.inverse(g), of_momenta[:n]), n
        v, rate = [*left], [0.0] * n
        if not self.only_adds:
            right, used = of_momenta[n : 2 * n], 2 * n
            v, rate = [*(left + right)], [*self.group.ad_star(right, mu)]
        places, components = [place for place, _ in self.vectors(g)], vec(*[x for _, x in self.vectors(g)])
        for i, place in enumerate(places):
            row = of_momenta[used + i * len(places) : used + (i + 1) * len(places)]
            v[place] = v[place] + dot(row, components)
            for other, factor in zip(places, row):
                rate[other] = rate[other] - factor * mu[place]
        return vec(*v, *rate)

    @property
    def only_adds(self) -> bool:
        """Whether left and right translations are the same ones, additions."""
        return isinstance(self.group, VectorSpace)

    def vectors(self, g: Any) -> Iterator[tuple[int, Any]]:
        """The components of the factors of g that are vectors, each with its place in the algebra."""
        group: Any = self.group
        first, beside = 0, isinstance(group.algebra, DirectSum)
        for factor, element in zip(group.factors, group.split(g)) if beside else ((group, g),):
            if isinstance(factor, VectorSpace):
                yield from enumerate(element, first)
            first += factor.dim

    # ---------------------------------------------------------------- in numbers

    @property
    def here(self) -> Vec:
        """z = 0."""
        return vec(*[0.0] * (2 * self.dim))

    def two_form(self) -> np.ndarray:
        """Omega = [[m, 1], [-1, 0]], m_ij = <mu, [e_i, e_j]>: dF = Omega^T z' for the motion z' that F generates."""
        n = self.dim
        brackets = [np.asarray(self.group.ad_star(vec(*e), self.mu)) for e in np.eye(n).tolist()]
        return np.block([[np.array(brackets), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])

    def slopes(self, of_momenta: np.ndarray) -> np.ndarray:
        """The derivative, (2 dim, 2 dim), of the field less the motion that these momenta generate."""
        c = vec(*of_momenta.tolist())
        return np.asarray(jacobian(lambda z: self.field(z) - self.generated(c, z), self.here))

    def sizes(self, beside: np.ndarray | None = None) -> np.ndarray:
        """How large displacements z are that change much, (2 dim,), by blocks of one unit: a radian or the distance from
        the origin, and the momentum.

        Near the origin it is the radius of gyration instead, and of a part that hardly moves the momentum at the pace of
        the others; at rest, the momentum of the potential energy.

        beside : the sizes of a guess; a place that is near the origin beside them has theirs, it is rounding.
        """
        n, widths = self.dim, self.group.unit_blocks

        def of_blocks(numbers: Any) -> np.ndarray:
            return largest_of_blocks(numbers, widths)

        hessian = self.two_form().T @ self.slopes(np.zeros(len(self.momenta(self.here))))
        stiff, mobile = (
            largest_of_blocks(largest_of_blocks(h, widths).T, widths).diagonal()
            for h in (hessian[:n, :n], hessian[n:, n:])
        )
        turning = of_blocks(self.group.scale(self.group.identity())) > 0.0
        x, mobile = of_blocks(self.group.scale(self.g)), np.where(mobile > 0.0, mobile, 1.0)
        if beside is not None:
            x = np.where(x > FAINT * of_blocks(beside[:n]), x, of_blocks(beside[:n]))
        if turning.any():
            gyration = np.sqrt(mobile * (1.0 / mobile[turning]).max())
            x = np.where(x > FAINT * gyration, x, gyration)
        x = np.where(x > 0.0, x, 1.0)
        mu = of_blocks(self.mu)
        pace = max((of_blocks(self.field(self.here)[:n]) / x).max(), np.sqrt(stiff * mobile).max())
        at_pace = x * pace / mobile
        mu = np.where(mu > FAINT * at_pace, mu, at_pace)
        return np.repeat([*x, *np.where(mu > 0.0, mu, 1.0)], (*widths, *widths))

    def require_autonomous(self, name: str, sizes: np.ndarray) -> None:
        """Raise IncompatibleSystem for rates that depend on the time, at a random state: a load that does, a user's motion.
        name : of the caller, for messages.  sizes : of displacements.
        """
        if not isinstance(self.system, CotangentMotion):
            return
        other = self.moved(sizes * np.random.default_rng(3).uniform(-0.5, 0.5, len(sizes)))
        rates, why = traced(lambda t: [*chain(*self.system.rates(t[0], other.mu, other.g))], [1])
        if why or any(indices_in(x) for x in rates):
            raise IncompatibleSystem(
                f"{name}: the energy of {self.system!r}, or a force on it, changes with time; wanted is one that does not"
            )


def largest_of_blocks(numbers: Any, widths: tuple[int, ...]) -> np.ndarray:
    """The largest |x| in each block of the last axis, (..., blocks).  numbers : (..., n).  widths : of the blocks."""
    return np.maximum.reduceat(np.abs(np.asarray(numbers)), np.cumsum((0, *widths))[:-1], axis=-1)


def states_near(name: str, system: Any, state: Any) -> NearState:
    """The states near one.  name : of the caller, for messages.  Raises IncompatibleSystem for a system whose motion is not
    an autonomous one on T*G.
    """
    if isinstance(system, HamiltonianSystem) and isinstance(state, CanonicalState) and state.bodies is None:
        q, p = (small(np.asarray(x)) for x in (state.q, state.p))
        return NearState(system, VectorSpace(system.degrees), q, p)
    if not isinstance(system, (LiePoissonSystem, CotangentMotion)):
        raise IncompatibleSystem(
            f"{name}: {system!r}; wanted is a LiePoissonSystem, a MechanicalSystem, a CotangentSystem or a "
            "HamiltonianSystem, whose energy does not change with time"
        )
    state = system._written_out(state)  # of several bodies, SO3() ** 2, the numbers of all in a row
    if not isinstance(state, BodyState) or state.bodies is not None or system.is_large:
        raise IncompatibleSystem(
            f"{name}: the guess is the state of one body or of a few, system.state(...); got {state!r}"
        )
    group = getattr(system, "configurations", system.group)
    g = group.identity() if state.g is None else state.g
    return NearState(system, group, small(np.asarray(g)), small(np.asarray(state.mu)))
