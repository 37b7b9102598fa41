"""Multipliers of any number of bodies and joints, once for all, by elimination from joint to joint.

    mu' = ad*_xi mu + f + F - G* lam,   (G J^-1 G*) lam = d/ds G(g exp(s xi)) xi + G J^-1 (ad*_xi mu + f + F)

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.2 (index reduction);
Featherstone, Rigid Body Dynamics Algorithms (2008), section 8.5 (multipliers along a tree).
"""

from __future__ import annotations

from typing import Any

from ...compiler.sites.planes import columns, each
from ...formulas import Vec, cross, derivative, dot, mat, plain, vec
from ...formulas.classes.layouts import Layout
from ...formulas.numbers.conversions import resting
from ...systems.kinetic_energy import times
from .elimination import assembled, free_answers, pulled_by_solution, require_multipliers, save_answers
from .links import both, poses_of, pull_on, speeds
from .loads_of_links import loads
from .rattle_of_links import field


def work_in(sites: Any, memory: Layout, links: Any) -> Any:
    """The columns of what places have beside two copies of what a method carries along."""
    return columns(sites, copies=(memory, memory), work=links.work).work.fields


def multipliers(system: Any, t: float, sites: Any, memory: Layout) -> None:
    """The velocities of all bodies, with the pull of joints by the multipliers."""
    work = work_in(sites, memory, system)
    find_multipliers(system, t, sites, work.state, work)
    each(sites, rated, system, work)


def find_multipliers(system: Any, t: float, sites: Any, state: Any, work: Any) -> None:
    """The multipliers at the states in a column, and their pull on bodies."""
    equations = work.equations.heads(system.most)
    field(system, t, 0.0, sites, state, state, work)
    if system.loaded:
        loads(system, t, 1, 1.0, sites, state, state, work)
    each(sites, accelerated, system, state, work)
    each(sites, unhindered, system.at_time(t), state, work, equations)
    assembled(system, sites, equations.sides, 1.0, 1.0, work, equations)
    require_multipliers(system, work, equations)
    pulled_by_solution(system, sites, work, equations)
    if system.level is not None:  # G and c have changed under lam: a correction, with the blocks as they are
        each(sites, held, work)
        each(sites, accelerated, system, state, work)
        each(sites, off_conditions, system.at_time(t), state, work, equations)
        pulled_by_solution(system, sites, work, equations)


def accelerated(system: Any, state: Any, work: Any) -> None:
    """J^-1 (ad*_xi mu + f + F) in the place of the velocity, which is kept beside it."""
    mu, inverse = plain(state.load().mu), work.inverse.load()
    xi = times(inverse, mu)
    pull = system.group.ad_star(xi, mu) + work.force.load()
    work.free_at_end.save(xi)
    work.velocity.save(times(inverse, pull))


def unhindered(system: Any, state: Any, work: Any, equations: Any) -> None:
    """How a joint would accelerate off its conditions without multipliers, and the answers of free bodies to its impulses."""
    sides = equations.sides.load()
    equations.residual.save(acceleration_off(system, state, sides, work))
    save_answers(system, sides, free_answers(sides, work), 1.0, 1.0, work, equations)


def off_conditions(system: Any, state: Any, work: Any, equations: Any) -> None:
    """How a joint accelerates off its conditions."""
    equations.residual.save(acceleration_off(system, state, equations.sides.load(), work))


def acceleration_off(system: Any, state: Any, sides: Any, work: Any) -> Vec:
    """G J^-1 (ad*_xi mu + p) + d/ds [G(t + s, g exp(s xi)) xi + dc/dt], of all forces p."""
    (g, k), (xi, eta) = poses_of(state, work), both(work.free_at_end, work)
    eta = work.ends.load()[2] * eta

    def curvature(joint: Any) -> Vec:
        def speed(s: float) -> Vec:
            later, poses = joint, (moved_along(g, xi, s), moved_along(k, eta, s))
            if system.rheonomic:
                later = joint.at_time(system.clock[0] + s)
            rates = speeds(later.rows(*poses, system.most, 0), (xi, eta))
            if system.rheonomic:
                rates = [x + pace for x, pace in zip(rates, later.paces(*poses, system.most, 0))]
            return vec(*rates)

        return derivative(speed, 0.0)

    curvatures, free = system.of_kind(work, curvature), speeds(sides, both(work.velocity, work))
    return vec(*[x + a * y for x, a, y in zip(free, work.alive.load(), curvatures)])


def moved_along(g: Any, xi: Vec, s: float) -> Any:
    """g (1 + s xi), to first order g exp(s xi)."""
    w, v = s * xi[:3], s * xi[3:]
    R = [g[i][:3] for i in range(3)]
    return mat(*[vec(*(row + cross(row, w)), g[i][3] + dot(row, v)) for i, row in enumerate(R)], g[3])


def held(work: Any) -> None:
    """The force on a body with the pull of its joints."""
    work.force.save(work.force.load() - pull_on(work))


def rated(system: Any, work: Any) -> None:
    """The velocity of a body on T*SE(3)."""
    pull = pull_on(work)
    if system.level is not None:
        pull = pull - resting(pull)
    work.rate_on_cotangent.save(vec(*work.free_at_end.load(), *(work.force.load() - pull)))
