"""Explicit RKMK methods for the reduced equation of any number of bodies and joints: multipliers by
elimination from joint to joint.

    mu' = ad*_xi mu + f + F - G* lam,   (G J^-1 G*) lam = d/ds G(g exp(s xi)) xi + G J^-1 (ad*_xi mu + f + F)

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.2 (index reduction);
Featherstone, Rigid Body Dynamics Algorithms (2008), section 8.5 (multipliers along a tree).
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...compiler.sites.planes import at, below, each, load, put, save
from ...errors import NoConvergence
from ...formulas import Record, Vec, cross, derivative, dot, mat, plain, record, vec
from ...formulas.classes.layouts import Layout, vector
from ...formulas.numbers.conversions import fitted
from ...formulas.tables import entry
from ...groups.rigid.se3 import SE3
from ...systems.kinetic_energy import KineticEnergy, times
from ...systems.lie_poisson import LiePoissonSystem
from ...systems.mechanical import MechanicalSystem
from ...systems.potential import NoPotential
from .rattle_of_links import (
    ENDS,
    NUMBER,
    SIX,
    TWELVE,
    LinkMemory,
    RattleOfLinks,
    coupled,
    excess_of,
    factored,
    joints_here,
    kicked,
    poses_of,
    pull_on,
    pulled_together,
    scattered,
    solved,
    tied,
    wrench_of_impulses,
)

FREE = MechanicalSystem(LiePoissonSystem(SE3(), KineticEnergy([1.0] * 6)), NoPotential())
"""A body that moves alone, for its group; its inertia does not count."""


@record
class RkmkOfLinks(Record):
    """An explicit RKMK method, of many bodies and joints.

    method : the RKMK.  table : of its coefficients, a row for each stage and the last one for the step;
    nodes : c.  stages, rounds : how many there are.  loads : finds the loads at a state.
    """

    method: Any
    table: Any
    nodes: Any
    stages: int
    rounds: float
    loads: RattleOfLinks
    free: Any
    name: str = ""

    together: ClassVar[bool] = True
    settles: ClassVar[bool] = False
    symmetric: ClassVar[bool] = False
    room: ClassVar[int] = 0

    def __repr__(self) -> str:
        return self.name

    def start(self, system: Any, state: Any, h: float) -> LinkMemory:
        """A state, and room for the slopes."""
        return LinkMemory(state, (vec(*[0.0] * 12),) * self.stages)

    def observe(self, memory: LinkMemory) -> Any:
        """The state."""
        return memory.state

    def step_together(self, system: Any, t: float, h: float, sites: Any, here: int, there: int, memory: Layout) -> None:
        """A step of all bodies: stage by stage the slopes, and the state to which they lead."""
        state, width = memory.parts[0], memory.width
        old, new = below(sites, here * width), below(sites, there * width)
        slopes, work = below(sites, there * width + state.width), below(sites, 2 * width)
        for i in range(int(self.rounds)):
            each(sites, staged, self, h, i, old, new, slopes, state)
            self.multipliers(system, t + entry(self.nodes, i) * h, sites, new, work, state)
            each(sites, slope_here, self, system, h, i, slopes, work)
        each(sites, staged, self, h, self.stages, old, new, slopes, state)

    def multipliers(self, system: Any, t: float, sites: Any, new: Any, work: Any, state: Layout) -> None:
        """The multipliers at a state, and the pull of the joints by them."""
        each(sites, joints_here, system, new, work, state)
        scattered(system, work)
        if system.on_all is not None and system.on_all.potential is not None:
            pulled_together(system, new, work, state)
        each(sites, kicked, system, 0.0, new, new, work, state)
        if system.loaded:
            self.loads.loads(system, t, 1, 1.0, sites, new, new, work, state)
        each(sites, accelerated, system, new, work, state)
        each(sites, excess_of, system, work)
        each(sites, curved, system, new, work, state)
        rows, n = system.rows, system.most
        each(sites, tied, system, rows.first, n, work)
        coupled(system, work, rows.first, 1.0, n)
        bad = factored(system, work, 1.0, n)
        if bad >= 0.0:
            put(below(work, rows.note), 0, 0, bad, NUMBER)
            put(below(work, rows.note), 0, 1, -1.0, NUMBER)
            raise NoConvergence("the conditions of joints depend on each other")
        solved(system, work, n)
        each(sites, wrench_of_impulses, system, work)
        scattered(system, work)


def displacement(method: Any, h: float, i: int, slopes: Any) -> Vec:
    """Omega_i = h sum_j a_ij k_j of a body."""
    total = vec(*[0.0] * 12)
    for j in range(method.stages):
        weight = entry(method.table, i * method.stages + j)
        total = total + (h * weight) * load(slopes, j, TWELVE)
    return total


def staged(method: Any, h: float, i: int, old: Any, new: Any, slopes: Any, state: Layout) -> None:
    """The state of stage i; after the last one that of the step."""
    one, omega = load(old, 0, state), displacement(method, h, i, slopes)
    found = method.free.displaced(method.method.retraction, one, omega)
    save(new, 0, fitted(found, state), state)


def accelerated(system: Any, new: Any, work: Any, state: Layout) -> None:
    """The acceleration by field and loads alone, J^-1 (ad*_xi mu + f + F), in the place of the
    velocity, which is kept beside it.
    """
    rows, mu = system.rows, plain(load(new, 0, state).mu)
    inverse = system.inverse(work)
    xi = times(inverse, mu)
    pull = system.group.ad_star(xi, mu) + load(below(work, rows.force), 0, SIX)
    save(below(work, rows.led), 0, xi, SIX)
    save(below(work, rows.velocity), 0, times(inverse, pull), SIX)


def curved(system: Any, new: Any, work: Any, state: Layout) -> None:
    """Add to the right side of a joint the curvature of its conditions, d/ds G(g exp(s xi)) xi."""
    rows, n = system.rows, system.most
    first, second, held, _ = load(below(work, rows.ends), 0, ENDS)
    g, k = poses_of(system, new, work, state)
    velocities = below(work, rows.led)
    xi, eta = at(velocities, first, 0, SIX), held * at(velocities, second, 0, SIX)
    alive = load(below(work, rows.alive), 0, vector(n))

    def curvature(one: Any) -> Vec:
        def speed(s: float) -> Vec:
            sides = one.rows(moved_along(g, xi, s), moved_along(k, eta, s), n, 0)
            return vec(*[dot(a, xi) + dot(b, eta) for a, b in zip(*sides)])

        return derivative(speed, 0.0)

    more = system.of_kind(work, curvature)
    rest = load(below(work, rows.rest), 0, vector(n))
    save(below(work, rows.rest), 0, vec(*[x + a * y for x, a, y in zip(rest, alive, more)]), vector(n))


def moved_along(g: Any, xi: Vec, s: float) -> Any:
    """g (1 + s xi), to first order g exp(s xi)."""
    w, v = s * xi[:3], s * xi[3:]
    R = [g[i][:3] for i in range(3)]
    return mat(*[vec(*(row + cross(row, w)), g[i][3] + dot(row, v)) for i, row in enumerate(R)], g[3])


def slope_here(method: Any, system: Any, h: float, i: int, slopes: Any, work: Any) -> None:
    """The slope of a body in stage i, dtau^-1_Omega (xi, f + F - G* lam)."""
    rows = system.rows
    xi = load(below(work, rows.led), 0, SIX)
    force = load(below(work, rows.force), 0, SIX) - pull_on(system, work)
    omega = displacement(method, h, i, slopes)
    save(slopes, i, method.method.in_chart(method.free, omega, vec(*xi, *force)), TWELVE)
