"""Explicit RKMK methods for the reduced equation of any number of bodies and joints: multipliers by
elimination from joint to joint.

    mu' = ad*_xi mu + f + F - G* lam,   (G J^-1 G*) lam = d/ds G(g exp(s xi)) xi + G J^-1 (ad*_xi mu + f + F)

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.2 (index reduction);
Featherstone, Rigid Body Dynamics Algorithms (2008), section 8.5 (multipliers along a tree).
"""

from __future__ import annotations

from typing import Any

from ...compiler.sites.planes import columns, each
from ...formulas import Vec, cross, derivative, dot, mat, plain, record, vec
from ...formulas.classes.layouts import Layout
from ...formulas.tables import entry
from ...groups.rigid.se3 import SE3
from ...systems.kinetic_energy import KineticEnergy, times
from ...systems.lie_poisson import LiePoissonSystem
from ...systems.mechanical import MechanicalSystem
from ...systems.potential import NoPotential
from .elimination import assembled, excess_of, pulled_by_impulses, require_multipliers, solved
from .links import LinkMemory, StepsOfLinks, both, poses_of, pull_on, speeds
from .loads_of_links import loads
from .rattle_of_links import field

FREE = MechanicalSystem(LiePoissonSystem(SE3(), KineticEnergy([1.0] * 6)), NoPotential())
"""A body that moves alone, for its group; its inertia does not count."""


@record
class RkmkOfLinks(StepsOfLinks):
    """An explicit RKMK method, of many bodies and joints.

    method : the RKMK.  table : of its coefficients, a row for each stage and the last one for the step;
    nodes : c.  stages, rounds : how many there are.
    """

    method: Any
    table: Any
    nodes: Any
    stages: int
    rounds: float
    free: Any

    def start(self, system: Any, state: Any, h: float) -> LinkMemory:
        """A state, and room for the slopes."""
        return LinkMemory(state, (vec(*[0.0] * 12),) * self.stages)

    def step_together(self, system: Any, t: float, h: float, sites: Any, here: int, there: int, memory: Layout) -> None:
        """A step of all bodies: stage by stage the slopes, and the state to which they lead."""
        places = columns(sites, copies=(memory, memory), work=system.work)
        work, old = places.work.fields, places.copies.nth(here).fields.state
        next_copy = places.copies.nth(there).fields
        new, slopes = next_copy.state, next_copy.pasts
        for i in range(int(self.rounds)):
            each(sites, staged, self, h, i, old, new, slopes)
            multipliers(system, t + entry(self.nodes, i) * h, sites, new, work)
            each(sites, slope_here, self, h, i, slopes, work)
        each(sites, staged, self, h, self.stages, old, new, slopes)


def multipliers(system: Any, t: float, sites: Any, state: Any, work: Any) -> None:
    """The multipliers at a state, and the pull of the joints by them."""
    equations = work.equations.heads(system.most)
    field(system, t, 0.0, sites, state, state, work)
    if system.loaded:
        loads(system, t, 1, 1.0, sites, state, state, work)
    each(sites, accelerated, system, state, work)
    each(sites, excess_of, system, work, equations)
    each(sites, curved, system, state, work, equations)
    assembled(system, sites, equations.sides, 1.0, 1.0, work, equations)
    require_multipliers(system, work, equations)
    solved(system, equations)
    pulled_by_impulses(system, sites, work, equations)


def displacement(method: Any, h: float, i: int, slopes: Any) -> Vec:
    """Omega_i = h sum_j a_ij k_j of a body."""
    total = vec(*[0.0] * 12)
    for j in range(method.stages):
        weight = entry(method.table, i * method.stages + j)
        total = total + (h * weight) * slopes.nth(j).load()
    return total


def staged(method: Any, h: float, i: int, old: Any, new: Any, slopes: Any) -> None:
    """The state of stage i; after the last one that of the step."""
    omega = displacement(method, h, i, slopes)
    new.save(method.free.displaced(method.method.retraction, old.load(), omega))


def accelerated(system: Any, state: Any, work: Any) -> None:
    """J^-1 (ad*_xi mu + f + F) in the place of the velocity, which is kept beside it."""
    mu, inverse = plain(state.load().mu), work.inverse.load()
    xi = times(inverse, mu)
    pull = system.group.ad_star(xi, mu) + work.force.load()
    work.led.save(xi)
    work.velocity.save(times(inverse, pull))


def curved(system: Any, state: Any, work: Any, equations: Any) -> None:
    """Add to the right side of a joint the curvature of its conditions, d/ds G(g exp(s xi)) xi."""
    (g, k), (xi, eta) = poses_of(state, work), both(work.led, work)
    eta = work.ends.load()[2] * eta

    def curvature(one: Any) -> Vec:
        def speed(s: float) -> Vec:
            sides = one.rows(moved_along(g, xi, s), moved_along(k, eta, s), system.most, 0)
            return vec(*speeds(sides, (xi, eta)))

        return derivative(speed, 0.0)

    more, rest = system.of_kind(work, curvature), equations.rest.load()
    equations.rest.save(vec(*[x + a * y for x, a, y in zip(rest, work.alive.load(), more)]))


def moved_along(g: Any, xi: Vec, s: float) -> Any:
    """g (1 + s xi), to first order g exp(s xi)."""
    w, v = s * xi[:3], s * xi[3:]
    R = [g[i][:3] for i in range(3)]
    return mat(*[vec(*(row + cross(row, w)), g[i][3] + dot(row, v)) for i, row in enumerate(R)], g[3])


def slope_here(method: Any, h: float, i: int, slopes: Any, work: Any) -> None:
    """The slope of a body in stage i, dtau^-1_Omega (xi, f + F - G* lam)."""
    xi, force = work.led.load(), work.force.load() - pull_on(work)
    omega = displacement(method, h, i, slopes)
    slopes.nth(i).save(method.method.in_chart(method.free, omega, vec(*xi, *force)))
