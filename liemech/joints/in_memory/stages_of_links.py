"""Explicit methods of stages, Runge-Kutta-Munthe-Kaas and commutator-free, for the reduced equation of any number of
bodies and joints: multipliers by elimination from joint to joint.

    mu' = ad*_xi mu + f + F - G* lam,   (G J^-1 G*) lam = d/ds G(g exp(s xi)) xi + G J^-1 (ad*_xi mu + f + F)

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.2 (index reduction);
Featherstone, Rigid Body Dynamics Algorithms (2008), section 8.5 (multipliers along a tree).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...compiler.sites.planes import columns, each
from ...formulas import Vec, cross, derivative, dot, mat, plain, record, vec
from ...formulas.classes.layouts import Layout, vector
from ...formulas.tables import Table, entry, of_whole, whole
from ...groups.retractions import Exponential
from ...groups.rigid.se3 import SE3
from ...integrators.rkmk import RKMK
from ...systems.kinetic_energy import KineticEnergy, times
from ...systems.lie_poisson import LiePoissonSystem
from ...systems.mechanical import MechanicalSystem
from ...systems.potential import NoPotential
from .elimination import assembled, excess_of, pulled_by_solution, require_multipliers
from .links import StepsOfLinks, both, poses_of, pull_on, speeds
from .loads_of_links import loads
from .rattle_of_links import field

FREE: Any = MechanicalSystem(LiePoissonSystem(SE3(), KineticEnergy([1.0] * 6)), NoPotential())
"""A body that moves alone, for its group; its inertia does not count."""


@record
class StagesOfLinks(StepsOfLinks):
    """An explicit RKMK or commutator-free method, of many bodies and joints.

    Each stage, and the end of the step, is reached from its start by flows one after the other, by sums of slopes.

    method : the RKMK or CommutatorFree.  first_flows : the numbers of the first flows to the stages and to the end, and of
    all flows.  weights : of each flow those of all slopes.  nodes : c, of the end as well.  stages, rounds : how many
    stages there are.  slopes : the layout of those of a body.
    """

    method: Any
    first_flows: Table
    weights: Table
    nodes: Table
    stages: int
    rounds: float
    slopes: Layout

    @classmethod
    def of_flows(cls, method: Any, flows_to: Any, nodes: Any) -> StagesOfLinks:
        """The method with these rows of weights for each stage and, last, for the end of the step; at least one each."""
        count = len(nodes)
        rows = [[*row, *[0.0] * (count - len(row))] for flows in flows_to for row in flows]
        firsts = np.cumsum([0, *map(len, flows_to)])
        tables = of_whole(firsts), Table(np.ravel(rows)), Table(np.array([*nodes, 1.0]))
        return cls(repr(method), method, *tables, count, float(count), Layout("tuple", (vector(12),) * count))

    @property
    def room(self) -> int:
        """The number of rows of memory that slopes take."""
        return self.slopes.width

    def step_together(
        self, system: Any, t: float, h: float, sites: Any, source: int, target: int, memory: Layout
    ) -> None:
        """A step of all bodies: stage by stage the slopes, and the state to which they lead."""
        places = columns(sites, copies=(memory, memory), slopes=self.slopes, work=system.work)
        copies, slopes, work = places.copies, places.slopes, places.work.fields
        for i in range(int(self.rounds)):
            self.reach(h, i, sites, copies, source, target, slopes)
            multipliers(system, t + entry(self.nodes, i) * h, sites, copies.nth(target).fields.state, work)
            each(sites, slope_here, self, h, i, slopes, work)
        self.reach(h, self.stages, sites, copies, source, target, slopes)

    def reach(self, h: float, i: int, sites: Any, copies: Any, source: int, target: int, slopes: Any) -> None:
        """The state of stage i, after the last one that of the end, in the one copy; the step begins in the other."""
        first = whole(self.first_flows, i)
        for flow in range(first, whole(self.first_flows, i + 1)):
            begin = copies.nth(source if flow == first else target).fields.state
            each(sites, flown, self, h, flow, begin, copies.nth(target).fields.state, slopes)


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
    pulled_by_solution(system, sites, work, equations)


def displacement(method: Any, h: float, flow: int, slopes: Any) -> Vec:
    """h sum_j w_j k_j of a body, along a flow."""
    total = vec(*[0.0] * 12)
    for j in range(method.stages):
        weight = entry(method.weights, flow * method.stages + j)
        total = total + (h * weight) * slopes.nth(j).load()
    return total


def flown(method: Any, h: float, flow: int, start: Any, new: Any, slopes: Any) -> None:
    """The state of a body at the end of a flow."""
    omega = displacement(method, h, flow, slopes)
    retraction = method.method.retraction if isinstance(method.method, RKMK) else Exponential()
    new.save(FREE.displaced(retraction, start.load(), omega))


def accelerated(system: Any, state: Any, work: Any) -> None:
    """J^-1 (ad*_xi mu + f + F) in the place of the velocity, which is kept beside it."""
    mu, inverse = plain(state.load().mu), work.inverse.load()
    xi = times(inverse, mu)
    pull = system.group.ad_star(xi, mu) + work.force.load()
    work.free_at_end.save(xi)
    work.velocity.save(times(inverse, pull))


def curved(system: Any, state: Any, work: Any, equations: Any) -> None:
    """Add to the right side of a joint the curvature of its conditions, d/ds G(g exp(s xi)) xi."""
    (g, k), (xi, eta) = poses_of(state, work), both(work.free_at_end, work)
    eta = work.ends.load()[2] * eta

    def curvature(joint: Any) -> Vec:
        def speed(s: float) -> Vec:
            sides = joint.rows(moved_along(g, xi, s), moved_along(k, eta, s), system.most, 0)
            return vec(*speeds(sides, (xi, eta)))

        return derivative(speed, 0.0)

    curvatures, residual = system.of_kind(work, curvature), equations.residual.load()
    equations.residual.save(vec(*[x + a * y for x, a, y in zip(residual, work.alive.load(), curvatures)]))


def moved_along(g: Any, xi: Vec, s: float) -> Any:
    """g (1 + s xi), to first order g exp(s xi)."""
    w, v = s * xi[:3], s * xi[3:]
    R = [g[i][:3] for i in range(3)]
    return mat(*[vec(*(row + cross(row, w)), g[i][3] + dot(row, v)) for i, row in enumerate(R)], g[3])


def rate_here(work: Any) -> Vec:
    """The velocity of a body on T*G, (xi, f + F - G* lam)."""
    return vec(*work.free_at_end.load(), *(work.force.load() - pull_on(work)))


def slope_here(method: Any, h: float, i: int, slopes: Any, work: Any) -> None:
    """The slope of a body in stage i: its velocity, of RKMK in the chart, dtau^-1_Omega (xi, f + F - G* lam)."""
    slope = rate_here(work)
    if isinstance(method.method, RKMK):
        slope = method.method.in_chart(FREE, displacement(method, h, i, slopes), slope)
    slopes.nth(i).save(slope)
