"""The reduced equation of any number of bodies and joints, as the equation of one of them: multipliers by elimination from
joint to joint, once for all.

    mu' = ad*_xi mu + f + F - G* lam,   (G J^-1 G*) lam = d/ds G(g exp(s xi)) xi + G J^-1 (ad*_xi mu + f + F)

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.2 (index reduction);
Featherstone, Rigid Body Dynamics Algorithms (2008), section 8.5 (multipliers along a tree).
"""

from __future__ import annotations

from typing import Any

from ...compiler.sites.planes import columns, each
from ...formulas import Vec, cross, derivative, dot, mat, plain, record, vec
from ...formulas.classes.layouts import Layout
from ...formulas.sites import once, total
from ...groups.rigid.se3 import SE3
from ...systems.kinetic_energy import KineticEnergy, times
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from ...systems.mechanical import MechanicalSystem
from ...systems.potential import NoPotential
from ...systems.system import System
from .elimination import assembled, free_answers, pulled_by_solution, require_multipliers, save_answers
from .links import both, poses_of, pull_on, speeds
from .loads_of_links import loads
from .rattle_of_links import field

FREE: Any = MechanicalSystem(LiePoissonSystem(SE3(), KineticEnergy([1.0] * 6)), NoPotential())
"""A body that moves alone, for its group; its inertia does not count."""


@record
class BodyAmongJoints(System):
    """The equation of one body of a linkage, which all methods step that ask for velocities.

    links : all bodies and joints.  sites : their memory.  memory : the layout of what a method carries along for a body.
    """

    links: Any = None
    sites: Any = None
    memory: Layout = None  # type: ignore[assignment]

    @property
    def group(self) -> Any:
        """The group T*SE(3), the pose and the momentum of one body."""
        return FREE.group

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        return tuple(FREE.unit_blocks)

    def displaced(self, retraction: Any, state: BodyState, omega: Vec) -> BodyState:
        return FREE.displaced(retraction, state, omega)

    def variation(self, state: BodyState, omega: Vec) -> tuple[Vec, Vec]:
        return FREE.variation(state, omega)

    def mean_over_sites(self, value: Any) -> Any:
        """The mean over all bodies: places behind them do not count."""
        return total(work_in(self.sites, self.memory, self.links).counts.load() * value) / self.links.bodies

    def rate(self, t: float, state: BodyState) -> Vec:
        """The velocity on T*SE(3), (xi, f + F - G* lam)."""
        work = work_in(self.sites, self.memory, self.links)
        velocity: Vec = once(
            multipliers, work.state, BodyState(plain(state.mu), plain(state.g)), work.rate_on_cotangent,
            self.links, t, self.sites, self.memory,
        )  # fmt: skip
        return velocity


def work_in(sites: Any, memory: Layout, links: Any) -> Any:
    """The columns of what places have beside two copies of what a method carries along."""
    return columns(sites, copies=(memory, memory), work=links.work).work.fields


def multipliers(system: Any, t: float, sites: Any, memory: Layout) -> None:
    """The velocities of all bodies, with the pull of joints by the multipliers."""
    work = work_in(sites, memory, system)
    state, equations = work.state, work.equations.heads(system.most)
    field(system, t, 0.0, sites, state, state, work)
    if system.loaded:
        loads(system, t, 1, 1.0, sites, state, state, work)
    each(sites, accelerated, system, state, work)
    each(sites, unhindered, system.at_time(t), state, work, equations)
    assembled(system, sites, equations.sides, 1.0, 1.0, work, equations)
    require_multipliers(system, work, equations)
    pulled_by_solution(system, sites, work, equations)
    each(sites, rated, work)


def accelerated(system: Any, state: Any, work: Any) -> None:
    """J^-1 (ad*_xi mu + f + F) in the place of the velocity, which is kept beside it."""
    mu, inverse = plain(state.load().mu), work.inverse.load()
    xi = times(inverse, mu)
    pull = system.group.ad_star(xi, mu) + work.force.load()
    work.free_at_end.save(xi)
    work.velocity.save(times(inverse, pull))


def unhindered(system: Any, state: Any, work: Any, equations: Any) -> None:
    """How a joint would accelerate off its conditions without multipliers, G J^-1 (ad*_xi mu + f + F) +
    d/ds [G(t + s, g exp(s xi)) xi + dc/dt]; and the answers of free bodies to its impulses.
    """
    (g, k), (xi, eta), sides = poses_of(state, work), both(work.free_at_end, work), equations.sides.load()
    save_answers(system, sides, free_answers(sides, work), 1.0, 1.0, work, equations)
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
    equations.residual.save(vec(*[x + a * y for x, a, y in zip(free, work.alive.load(), curvatures)]))


def moved_along(g: Any, xi: Vec, s: float) -> Any:
    """g (1 + s xi), to first order g exp(s xi)."""
    w, v = s * xi[:3], s * xi[3:]
    R = [g[i][:3] for i in range(3)]
    return mat(*[vec(*(row + cross(row, w)), g[i][3] + dot(row, v)) for i, row in enumerate(R)], g[3])


def rated(work: Any) -> None:
    """The velocity of a body on T*SE(3)."""
    work.rate_on_cotangent.save(vec(*work.free_at_end.load(), *(work.force.load() - pull_on(work))))
