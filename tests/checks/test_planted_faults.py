"""Planted faults: each line of the table is a mistake as users make them, and the law that must be named."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import Driven, asymmetric_body, heavy_top

import liemech as lm
from liemech.checks import check_action, check_group, check_method, check_poisson, check_system
from liemech.checks.check import check_retraction
from liemech.formulas import cos, cross, dot, sin, sqrt, vec, where
from liemech.groups.rigid.so3 import SO3Algebra
from liemech.rooms.constraints.constraint import parts_of

J = vec(1.0, 1.6, 2.3)
BODY, START = asymmetric_body()
GALAXY, KEPLER = lm.models.HenonHeiles(), lm.Kepler()
IN_GALAXY = GALAXY.state([0.1, 0.2], [0.3, -0.2])
IN_ORBIT = KEPLER.state([0.8, 0.1], [-0.1, 1.1])


def changed(base: type, **members: Any) -> Any:
    """A subclass with some methods or claims of its own."""
    annotations = {name: f"ClassVar[{type(x).__name__}]" for name, x in members.items() if not callable(x)}
    body = {"__module__": __name__, "__annotations__": annotations, **members}
    return lm.record(type(f"Faulty{base.__name__}", (base,), body))


# ---------------------------------------------------------------- systems to spoil


@lm.record
class Swing(lm.DrivenHamiltonianSystem):
    """A pendulum whose support moves."""

    degrees: ClassVar[int] = 1

    def energy(self, t: float, q: lm.Vec, p: lm.Vec) -> float:
        return 0.5 * p[0] ** 2 - (9.0 + cos(t)) * cos(q[0])


@lm.record
class Spinning(lm.DrivenHamiltonian):
    def energy(self, t: float, mu: lm.Vec) -> float:
        return 0.5 * dot(mu, mu / J) + sin(t) * mu[0]


@lm.record
class Tied(lm.Constraint):
    """The point `at` of a body on SE(3) stays at the distance 1 from the origin."""

    at: lm.Vec

    def value(self, g: Any) -> lm.Vec:
        there = g[:3, :3] @ self.at + g[:3, 3]
        return vec(0.5 * (dot(there, there) - 1.0))


@lm.record
class Springs(lm.MultirateSystem):
    degrees: ClassVar[int] = 2
    parts: ClassVar[tuple[str, ...]] = ("stiff", "soft")

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * dot(p, p)

    def stiff(self, q: lm.Vec) -> float:
        return 50.0 * (q[0] - q[1]) ** 2

    def soft(self, q: lm.Vec) -> float:
        return q[0] ** 4


@lm.record
class Bead(lm.ConstrainedLagrangianSystem):
    """A bead with a mass that depends on its place, on a circle."""

    degrees: ClassVar[int] = 2

    def mass(self, q: lm.Vec) -> lm.Mat:
        return lm.mat(vec(1.0 + q[0] ** 2, 0.0), vec(0.0, 2.0))

    def potential(self, q: lm.Vec) -> float:
        return q[1]

    def constraint(self, q: lm.Vec) -> lm.Vec:
        return vec(dot(q, q) - 1.0)


@lm.record
class Turns(lm.HomogeneousEquation):
    def velocity(self, t: float, x: lm.Vec) -> lm.Vec:
        return vec(0.3 + x[1], 1.0 - x[0] * x[2], 0.7 * x[0])


@lm.record
class Weight(lm.Potential):
    moment: lm.Vec

    def energy(self, g: Any) -> float:
        return dot(g[2], self.moment)


@lm.record
class Rubbing(lm.Force):
    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        return -0.3 * xi


@lm.record
class Area(lm.PoissonStructure):
    """Two coordinates that do not commute beside two that do with all."""

    dim: ClassVar[int] = 4

    def matrix(self, y: lm.Vec) -> lm.Mat:
        rows = [[0.0] * 4 for _ in range(4)]
        rows[0][1], rows[1][0] = 1.0 + y[2] ** 2, -1.0 - y[2] ** 2
        return lm.mat(*[vec(*row) for row in rows])

    def casimirs(self, y: lm.Vec) -> lm.Vec:
        return vec(y[2], y[3])


@lm.record
class Bowl(lm.Hamiltonian):
    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * dot(mu, mu) + mu[0] ** 4


@lm.record
class HalfBowl(Bowl):
    def gradient(self, mu: lm.Vec) -> lm.Vec:  # right where systems look when they are made
        return mu + vec(where(mu[0] < 0.0, 3.0, 4.0) * mu[0] ** 3, 0.0)


def free(**members: Any) -> Any:
    """A body whose energy has these formulas."""
    return lm.LiePoissonSystem(lm.SO3(), changed(lm.KineticEnergy, **members)(J))


def tied(constraint: type = Tied) -> Any:
    inertia = np.diag([1.0, 1.4, 1.9, 1.2, 1.2, 1.2])
    free = lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy(inertia))
    return lm.ConstrainedBody(free, constraint(vec(0.2, -0.1, 0.4)))


@lm.record
class Sphere(lm.Constraint):
    def value(self, g: Any) -> lm.Vec:
        return vec(dot(g, g) - 1.0)


@lm.record
class Height(lm.Potential):
    def energy(self, g: Any) -> float:
        return g[2] + 0.3 * g[0]


@functools.cache
def bead(constraint: type = Sphere) -> Any:
    """A point on a sphere, as a body under a constraint."""
    free = lm.LiePoissonSystem(lm.VectorSpace(3), lm.KineticEnergy([1.0, 1.3, 0.8]))
    return lm.ConstrainedBody(lm.MechanicalSystem(free, Height()), constraint())


@functools.cache
def on_sphere() -> Any:
    return bead().consistent([0.4, 1.5, 0.3], [0.6, 0.1, -0.8])


# ---------------------------------------------------------------- formulas that are wrong

SYSTEMS: dict[str, tuple[Callable[[], Any], str]] = {
    "force of a driven system, factor": (
        lambda: changed(Swing, force=lambda self, t, q, p: vec(-9.0 * q[0]))(),
        "force of energy",
    ),
    "force of a driven system, late": (
        lambda: changed(Swing, force=lambda self, t, q, p: vec(-where(t < 6.0, 9.0 + cos(t), 9.0) * sin(q[0])))(),
        "force of energy",
    ),
    "velocity of a driven system": (
        lambda: changed(Swing, velocity=lambda self, t, q, p: 2.0 * p)(),
        "velocity of energy",
    ),
    "gradient of a driven body": (
        lambda: lm.DrivenLiePoissonSystem(lm.SO3(), changed(Spinning, gradient=lambda self, t, mu: 2.0 * mu)()),
        "gradient",
    ),
    "a drive that is forgotten": (
        lambda: lm.DrivenLiePoissonSystem(lm.SO3(), changed(Spinning, gradient=lambda self, t, mu: mu / J)()),
        "gradient",
    ),
    "sign of a constraint's jacobian": (
        lambda: bead(changed(Sphere, jacobian=lambda self, group, g: lm.mat(-2.0 * g))),
        "jacobian",
    ),
    "right-trivialised jacobian": (
        lambda: tied(
            changed(Tied, jacobian=lambda self, group, g: lm.mat(vec(*cross(g[:3, :3] @ self.at, g[:3, 3]), *g[:3, 3])))
        ),
        "jacobian",
    ),
    "rows of a constraint": (
        lambda: bead(
            changed(
                Sphere, rows=lambda self, group, g: tuple(parts_of(group, 2.0 * row) for row in self.jacobian(group, g))
            )
        ),
        "rows of the constraint",
    ),
    "jacobian of a pendulum": (
        lambda: changed(lm.SphericalPendulum, constraint_jacobian=lambda self, q: lm.mat(-1.0 * q))(),
        "Jacobian of the constraints",
    ),
    "relative force": (
        lambda: changed(lm.Kepler, relative_force=lambda self, q: (1.0 / dot(q, q)) * q)(),
        "relative_force",
    ),
    "relative force with the attraction": (
        lambda: changed(lm.Kepler, relative_force=lambda self, q: (-self.attraction / dot(q, q)) * q)(2.0),
        "relative_force",
    ),
    "force in a region": (
        lambda: changed(lm.Kepler, force=lambda self, q, p: (-where(q[0] < -0.2, 1.01, 1.0) / dot(q, q) ** 1.5) * q)(),
        "force of energy",
    ),
    "force far out": (
        lambda: changed(
            lm.models.HenonHeiles,
            force=lambda self, q, p: where(q[1] > 3.0, 1.0, 0.0) * p + lm.models.HenonHeiles.force(self, q, p),
        )(),
        "force of energy",
    ),
    "gradient far out": (
        lambda: lm.PoissonSystem(
            Area(),
            changed(
                Bowl,
                gradient=lambda self, mu: (
                    mu + vec(4.0 * where(abs(mu[0]) > 4.0, 16.0, mu[0] ** 2) * mu[0], 0.0, 0.0, 0.0)
                ),
            )(),
        ),
        "gradient of energy",
    ),
    "force of one part": (
        lambda: changed(
            Springs, part_force=lambda self, k, q: (1.0 if k == 0 else 0.5) * lm.MultirateSystem.part_force(self, k, q)
        )(),
        "part_force",
    ),
    "slope of a time scale": (
        lambda: lm.TimeTransformed(
            KEPLER, changed(lm.time_scales.DistancePower, slope=lambda self, system, q: self.power * q)(1.5)
        ),
        "slope",
    ),
    "growth of a time scale": (
        lambda: lm.TimeTransformed(
            KEPLER,
            changed(
                lm.time_scales.DistancePower,
                growth=lambda self, system, t, state: dot(self.slope(system, state.q), state.q),
            )(1.5),
        ),
        "growth",
    ),
    "mass that changes, chain rule forgotten": (
        lambda: changed(Bead, force=lambda self, q, p: vec(0.0, -1.0))(),
        "force of energy",
    ),
    "momentum of a mass matrix": (
        lambda: changed(Bead, momentum=lambda self, q, v: vec((1.0 + q[0]) * v[0], 2.0 * v[1]))(),
        "momentum",
    ),
    "torque the wrong way round": (
        lambda: lm.MechanicalSystem(
            BODY, changed(Weight, force=lambda self, group, g: cross(self.moment, g[2]))(vec(0.1, 0.2, 0.3))
        ),
        "force",
    ),
    "torque in space": (
        lambda: lm.MechanicalSystem(
            BODY,
            changed(Weight, force=lambda self, group, g: cross(g @ self.moment, vec(0.0, 0.0, 1.0)))(
                vec(0.1, 0.2, 0.3)
            ),
        ),
        "force",
    ),
    "gradient of one part": (
        lambda: lm.PoissonSystem(
            lm.structures.Canonical(1), lm.SplitHamiltonian((lm.KineticEnergy([1.0, 1.0]), HalfBowl()))
        ),
        "gradient",
    ),
    "velocities of points": (
        lambda: Turns(changed(lm.actions.SphereAction, infinitesimal=lambda self, xi, x: cross(x, xi))(3)),
        "infinitesimal",
    ),
    "sharp": (
        lambda: lm.PoissonSystem(changed(Area, sharp=lambda self, y, a: vec(-a[1], a[0], 0.0, 0.0))(), Bowl()),
        "sharp",
    ),
    "what is no constant": (
        lambda: changed(
            lm.Kepler, constants=lambda self, states: {"area": states["q"][..., 0] * states["p"][..., 1]}
        )(),
        "constants",
    ),
    "a constant as Casimir": (
        lambda: lm.LiePoissonSystem(
            changed(lm.SO3, casimirs=lambda self, mu: vec(dot(mu, mu), 1.0))(), lm.KineticEnergy(J)
        ),
        "independent Casimirs",
    ),
    "length and its square as Casimirs": (
        lambda: lm.LiePoissonSystem(
            changed(lm.SO3, casimirs=lambda self, mu: vec(sqrt(dot(mu, mu)), dot(mu, mu)))(), lm.KineticEnergy(J)
        ),
        "independent Casimirs",
    ),
    "a load by its rates": (
        lambda: lm.MechanicalSystem(
            BODY,
            lm.NoPotential(),
            load=changed(
                Rubbing, rates=lambda self, xi, g: xi[:2], at_rates=lambda self, t, w, g: vec(*(-0.3 * w), 0.0)
            )(),
        ),
        "load",
    ),
    "a load by its efforts": (
        lambda: lm.MechanicalSystem(
            BODY,
            lm.NoPotential(),
            load=changed(
                Rubbing, by_rate=True, efforts=lambda self, t, w, g: 0.3 * w, spread=lambda self, t, k, g: k
            )(),
        ),
        "load",
    ),
    "hessian of the inverse": (lambda: free(hessian=lambda self, xi: 1.0 / self.inertia), "hessian"),
}


@pytest.mark.sample(8)
@pytest.mark.parametrize("name", SYSTEMS)
def test_a_fault_of_a_system_is_found(name: str) -> None:
    make, law = SYSTEMS[name]
    report = check_system(make(), raises=False)
    assert law in [finding.law for finding in report.broken], report


# ---------------------------------------------------------------- groups, structures, actions


def beyond(xi: lm.Vec, angle: float) -> Any:
    return dot(xi, xi) > angle * angle


@lm.record
class WrongFarOut(SO3Algebra):  # type: ignore[misc]
    """Its inverse differential is wrong beyond |xi| = 6."""

    def dexp_inv(self, xi: lm.Vec, eta: lm.Vec) -> lm.Vec:
        return where(beyond(xi, 6.0), 1.001, 1.0) * super().dexp_inv(xi, eta)


def rotations(**members: Any) -> Any:
    return changed(lm.SO3, **members)()


TURNED = changed(SO3Algebra, ad_matrix=lambda self, xi: SO3Algebra.ad_matrix(self, -xi))()
FORMED = changed(SO3Algebra, invariant_form=np.diag([1.0, 2.0, 1.0]))()

OTHERS: dict[str, tuple[Callable[[], Any], str]] = {
    "dexp_inv beyond 6": (
        lambda: check_group(rotations(algebra=property(lambda self: WrongFarOut())), raises=False),
        "dexp_inv",
    ),
    "Casimirs of large momenta": (
        lambda: check_group(
            rotations(casimirs=lambda self, mu: vec(where(dot(mu, mu) > 100.0, mu[0], dot(mu, mu)))), raises=False
        ),
        "Casimirs",
    ),
    "a constant beside a Casimir": (
        lambda: check_group(rotations(casimirs=lambda self, mu: vec(dot(mu, mu), 2.0)), raises=False),
        "independent Casimirs",
    ),
    "a constant as Casimir of a structure": (
        lambda: check_poisson(changed(Area, casimirs=lambda self, y: vec(y[2], 7.0))(), raises=False),
        "independent Casimirs",
    ),
    "a Casimir and its square": (
        lambda: check_poisson(changed(Area, casimirs=lambda self, y: vec(y[2], y[2] ** 2))(), raises=False),
        "independent Casimirs",
    ),
    "a structure far out": (
        lambda: check_poisson(
            changed(
                Area, sharp=lambda self, y, a: where(abs(y[3]) > 4.0, 1.1, 1.0) * lm.PoissonStructure.sharp(self, y, a)
            )(),
            raises=False,
        ),
        "closed product",
    ),
    "the dual of an action": (
        lambda: check_action(
            changed(lm.actions.CoadjointAction, act_dual=lambda self, g, p: self.act(g, p))(lm.SE3()), raises=False
        ),
        "act_dual",
    ),
    "the average of an action": (
        lambda: check_action(
            changed(lm.actions.CoadjointAction, phi1=lambda self, xi, x: self.act(self.group.exp(0.5 * xi), x))(
                lm.SO3()
            ),
            raises=False,
        ),
        "phi1",
    ),
    "what is no Casimir of momenta": (
        lambda: check_action(
            changed(lm.actions.CoadjointAction, casimirs=lambda self, mu: vec(mu[0]))(lm.SE3()), raises=False
        ),
        "Casimirs of momenta",
    ),
    "an action to nowhere": (
        lambda: check_action(
            changed(lm.actions.SphereAction, act=lambda self, g, x: where(g[0, 0] < 0.5, float("nan"), 1.0) * (g @ x))(
                3
            ),
            raises=False,
        ),
        "moved points",
    ),
    "numbers of orbits that move along them": (
        lambda: check_group(rotations(further_invariants=lambda self, mu: (float(mu[0]),)), raises=False),
        "further invariants",
    ),
    "two displacements that count as large": (
        lambda: check_group(rotations(scale=lambda self, g: vec(1.0, 1.0)), raises=False),
        "units",
    ),
    "a displacement of negative size": (
        lambda: check_group(rotations(scale=lambda self, g: vec(1.0, -1.0, 1.0)), raises=False),
        "units",
    ),
    "units of two components": (lambda: check_group(rotations(unit_blocks=(1, 1)), raises=False), "units"),
    "sign of the matrix of the bracket": (
        lambda: check_group(rotations(algebra=property(lambda self: TURNED)), raises=False),
        "ad_matrix",
    ),
    "a form that turns": (
        lambda: check_group(rotations(algebra=property(lambda self: FORMED)), raises=False),
        "invariant form",
    ),
    "points moved back by a retraction": (
        lambda: check_retraction(
            changed(lm.Cayley, tau_act=lambda self, action, xi, x: action.act(self.tau(action.group, -xi), x))(),
            lm.SO3(),
            raises=False,
        ),
        "tau_act",
    ),
    "a retraction far out": (
        lambda: check_retraction(
            changed(
                lm.Cayley,
                dtau_inv=lambda self, group, xi, eta: (
                    where(beyond(xi, 3.0), 1.01, 1.0) * group.algebra.dcayley_inv(xi, eta)
                ),
            )(),
            lm.SO3(),
            raises=False,
        ),
        "dcayley_inv",
    ),
}


@pytest.mark.parametrize("name", OTHERS)
def test_a_fault_of_a_group_a_structure_or_an_action_is_found(name: str) -> None:
    make, law = OTHERS[name]
    report = make()
    assert law in [finding.law for finding in report.broken], report


def test_points_that_are_no_numbers_are_refused_by_name() -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"points\[0\].*nan"):
        check_action(lm.actions.SphereAction(3), [[np.nan, 0.0, 1.0]])


# ---------------------------------------------------------------- methods


def spoilt(system: Any, state: Any, by: float) -> Any:
    """The state, moved a little along nothing in particular."""
    n = system.group.dim
    return system.displaced(lm.Exponential(), state, by * vec(*[0.3 + 0.1 * i for i in range(n)]))


@lm.record
class Drifting(lm.RKMK):
    """Its order is spoilt by 1e-6 h^2."""

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        return spoilt(system, super().step(system, t, state, h), 1e-6 * h * h)


@lm.record
class Late(lm.RKMK):
    """Of order 1 after t = 6."""

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        new = super().step(system, t, state, h)
        return new if t < 6.0 else spoilt(system, new, 1e-3 * h * h)


@lm.record
class Counted(lm.Record):
    state: Any
    steps: float


@lm.record
class SecondStep(lm.Method):
    """The method of Stormer and Verlet in the first step only."""

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True

    wrong: float = 1e-3

    def start(self, system: Any, state: Any, h: float) -> Any:
        return Counted(state, 0.0)

    def observe(self, memory: Any) -> Any:
        return memory.state

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        q, p = memory.state.q, memory.state.p
        p = p + (0.5 * h) * system.force(q, p)
        q = q + h * system.velocity(q, p)
        p = p + (0.5 * h) * system.force(q, p)
        q = (1.0 + memory.steps * self.wrong * h * h * h) * q
        return Counted(lm.CanonicalState(q, p), 1.0)


def verlet(wrong: Callable[[Any, float], bool], shear: float = 1e-3) -> Any:
    """StormerVerlet with a shear where a condition holds of state and step."""

    def step(self: Any, system: Any, t: float, memory: Any, h: float) -> Any:
        new = lm.StormerVerlet.step(self, system, t, memory, h)
        state = self.observe(new)
        if not wrong(self.observe(memory), h):
            return new
        state = lm.CanonicalState(state.q + (shear * h) * state.q, state.p)
        return self.start(system, state, h)

    return changed(lm.StormerVerlet, step=step)()


def runge(wrong: Callable[[Any, float], bool]) -> Any:
    """RKMK4 that is of order 1 where a condition holds of state and step."""

    def step(self: Any, system: Any, t: float, state: Any, h: float) -> Any:
        new = lm.RKMK.step(self, system, t, state, h)
        return spoilt(system, new, 1e-3 * h * h) if wrong(state, h) else new

    return changed(lm.RKMK, step=step)(order=4)


@lm.record
class Damped(lm.LieRATTLE):
    """It forgets a little of the momentum."""

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        new = super().step(system, t, memory, h)
        mu = (1.0 - 1e-3 * h * h * h) * new.state.mu
        state = lm.BodyState(mu, new.state.g)
        return replace(new, state=state)


@lm.record
class Unprojected(lm.LieRATTLE):
    """The velocity at the end of a step is left as it is."""

    def _projected(self, system: Any, rows: Any, mu: lm.Vec) -> Any:
        return mu


@lm.record
class Ahead(lm.Method):
    """Symmetric, but a constant pushes one way, whichever way the motion goes."""

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        q, p = state.q, state.p
        push = 0.05 * h * h * h * vec(1.0, 0.3)
        p = p + 0.5 * h * system.force(q, p)
        q = q + h * system.velocity(q, p) + push
        return lm.CanonicalState(q, p + 0.5 * h * system.force(q, p))


@lm.record
class EarlyTime(lm.Method):
    """The midpoint rule whose stage reads the drive at the start of the step."""

    order: ClassVar[int] = 2

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        half = system.displaced(lm.Exponential(), state, 0.5 * h * system.rate(t, state))
        return system.displaced(lm.Exponential(), state, h * system.rate(t, half))


@lm.record
class Backwards(lm.AdaptiveVerlet):
    """Not its own inverse: positions are pushed by |h|^3."""

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        new = super().step(system, t, memory, h)
        q = new.state.q + (0.01 * h * h * h * h) * vec(1.0, 1.0, 0.0)
        return self.start(system, lm.CanonicalState(q, new.state.p), h)


@lm.record
class WrongClock(lm.ReversibleController):
    """Its time runs too fast by a thousandth of a step, squared."""

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        new = super().step(system, t, memory, h)
        time = new.time + 0.01 * h * h
        return type(new)(new.kind, new.inner, time, new.z, new.rate)


@lm.record
class Unequal(lm.ReversibleController):
    """z is carried on by an explicit step."""

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        new = super().step(system, t, memory, h)
        z = memory.z + h * memory.rate
        return type(new)(new.kind, new.inner, new.time, z, new.rate)


TURNING = Driven(lm.SO3())
AT_REST = TURNING.state(lm.SO3().exp([0.4, -0.3, 0.5]))
MOVED = Driven(lm.VectorSpace(3))
ARC = lm.time_scales.DistancePower(1.5)
SPECIES = lm.models.LotkaVolterra()

METHODS: dict[str, tuple[Callable[[], tuple[Any, Any, Any]], str]] = {
    "damped on a constraint": (lambda: (Damped(), bead(), on_sphere()), "symplectic"),
    "off the constraint": (lambda: (changed(lm.RKMK, symplectic=True)(order=4), bead(), on_sphere()), "constraint"),
    "unprojected velocities": (lambda: (Unprojected(), bead(), on_sphere()), "hidden constraint"),
    "1e-6 h^2": (lambda: (Drifting(order=4), BODY, START), "order"),
    "1e-6 h^2 on positions": (lambda: (Drifting(order=4), GALAXY, IN_GALAXY), "order"),
    "1e-6 h^2 at order 8": (lambda: (Drifting(order=8), BODY, START), "order"),
    "wrong from the second step on": (lambda: (SecondStep(), GALAXY, IN_GALAXY), "symplectic"),
    "much from the second step on": (lambda: (SecondStep(wrong=1.0), GALAXY, IN_GALAXY), "symmetric"),
    "after t = 6": (lambda: (Late(order=4), BODY, START), "order"),
    "after t = 6, driven": (lambda: (Late(order=4), TURNING, AT_REST), "order"),
    "in a region": (lambda: (verlet(lambda s, h: s.q[0] < -0.2), GALAXY, IN_GALAXY), "symmetric"),
    "far out": (lambda: (runge(lambda s, h: s.q[1] > 3.0), GALAXY, IN_GALAXY), "order"),
    "far out on the other side": (
        lambda: (runge(lambda s, h: s.q[0] < -1.5), GALAXY, GALAXY.state([0.1, 0.2], [0.2, 0.1])),
        "order",
    ),
    "far out among species": (
        lambda: (runge(lambda s, h: abs(s.y[0]) > 4.0), SPECIES, SPECIES.state([1.5, 1.0])),
        "order",
    ),
    "fast bodies": (lambda: (runge(lambda s, h: abs(s.mu[1]) > 4.0), BODY, START), "order"),
    "slow bodies": (lambda: (runge(lambda s, h: abs(s.mu[1]) < 0.3), BODY, START), "order"),
    "steps backwards": (lambda: (runge(lambda s, h: h < 0.0), BODY, START), "order"),
    "steps backwards, symmetric": (lambda: (verlet(lambda s, h: h < 0.0), GALAXY, IN_GALAXY), "symmetric"),
    "not reversible": (lambda: (Ahead(), GALAXY, IN_GALAXY), "reversible"),
    "a stage at a wrong time": (lambda: (EarlyTime(), MOVED, MOVED.state([0.4, -0.3, 0.5])), "order"),
    "fictive time, not symmetric": (lambda: (Backwards(), lm.TimeTransformed(KEPLER, ARC), IN_ORBIT), "symmetric"),
    "a clock that errs": (lambda: (WrongClock(lm.StormerVerlet(), ARC), KEPLER, IN_ORBIT), "order"),
    "a controller that is explicit": (lambda: (Unequal(lm.StormerVerlet(), ARC), KEPLER, IN_ORBIT), "symmetric"),
}


LONG = "damped on a constraint", "off the constraint", "unprojected velocities", "steps backwards", "after t = 6"
"""Half a minute for those on a constraint, in plain Python."""


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] if n in LONG else []) for n in METHODS])
def test_a_fault_of_a_method_is_found(name: str) -> None:
    make, law = METHODS[name]
    report = check_method(*make(), compiled=False, raises=False)
    assert law in [finding.law for finding in report.broken], report


FICTIVE = {
    "controller": (lm.ReversibleController(lm.StormerVerlet(), ARC), KEPLER, IN_ORBIT),
    "controller of a body": (lm.ReversibleController(lm.LieVerlet(), lm.time_scales.EqualArc()), *heavy_top()),
    "adaptive Verlet": (lm.AdaptiveVerlet(), lm.TimeTransformed(KEPLER, ARC), IN_ORBIT),
    "composition": (lm.Composition(lm.AdaptiveVerlet(), order=4), lm.TimeTransformed(KEPLER, ARC), IN_ORBIT),
    "logarithmic": (lm.Splitting(order=4, quadratic=False), lm.LogarithmicHamiltonian(KEPLER), IN_ORBIT),
}


@pytest.mark.parametrize("name", FICTIVE)
def test_methods_in_fictive_time_keep_their_claims(name: str) -> None:
    report = check_method(*FICTIVE[name])
    assert report["order"].verdict == report["symmetric"].verdict == "holds", report
    assert report["reversible"].verdict == "holds"


@pytest.mark.slow
def test_a_reversal_of_ones_own() -> None:
    """The motion in a galaxy has mirror images too; what turns nothing back is refused."""
    system, start = GALAXY, IN_GALAXY
    mirror = check_method(
        lm.StormerVerlet(),
        system,
        start,
        compiled=False,
        rho=lambda s: lm.CanonicalState(vec(-1.0 * s.q[0], s.q[1]), vec(s.p[0], -1.0 * s.p[1])),
    )
    assert mirror["reversible"].verdict == "holds"
    with pytest.raises(lm.errors.InvalidInput, match="rho does not turn the motion"):
        check_method(lm.StormerVerlet(), system, start, rho=lambda s: s)


def test_a_time_scale_that_sees_velocities_one_way_is_not_reversible() -> None:
    """Equation sigma(rho y) = sigma(y)."""

    def sigma(q: lm.Vec, p: lm.Vec) -> float:
        return dot(q, q) * (2.0 + sin(dot(q, p)))

    method = lm.ReversibleController(lm.StormerVerlet(), sigma)
    report = check_method(method, KEPLER, IN_ORBIT, raises=False)
    assert report["time scale and reversal"].verdict == "not seen"
    assert report["reversible"].verdict == "not seen"
    insisted = check_method(method, KEPLER, IN_ORBIT, rho=lambda s: lm.CanonicalState(s.q, -s.p), raises=False)
    assert insisted["time scale and reversal"].verdict == "broken"


# ---------------------------------------------------------------- mistakes as users make them

A = lm.mat(vec(1.0, 0.4), vec(0.1, 2.0))
INVERSE = lm.mat(vec(1.0, 0.2, 0.1), vec(0.2, 0.7, 0.3), vec(0.1, 0.3, 0.5))


@lm.record
class Tilted(lm.Hamiltonian):
    """An inertia that is not diagonal."""

    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * dot(mu, INVERSE @ mu) + 0.1 * where(mu[1] < 0.0, mu[1], 0.0) ** 3


@lm.record
class Plate(lm.SeparableSystem):
    degrees: ClassVar[int] = 2

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * dot(p, p)

    def potential(self, q: lm.Vec) -> float:
        return 0.5 * dot(q, A @ q)


@lm.record
class Well(lm.SeparableSystem):
    """A potential that is a function of |q|^2."""

    degrees: ClassVar[int] = 2

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * dot(p, p)

    def potential(self, q: lm.Vec) -> float:
        return sqrt(1.0 + dot(q, q))


@lm.record
class InDegrees(lm.SeparableSystem):
    degrees: ClassVar[int] = 1

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * dot(p, p)

    def potential(self, q: lm.Vec) -> float:
        return -cos(0.017453292519943295 * q[0])

    def force(self, q: lm.Vec, p: lm.Vec) -> lm.Vec:
        return vec(-sin(0.017453292519943295 * q[0]))


@lm.record
class Turned(lm.Method):
    """The splitting into three rotations; `order_of` says which axis comes when."""

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True

    axes: tuple[int, ...] = (0, 1, 2, 1, 0)
    shares: tuple[float, ...] = (0.5, 0.5, 1.0, 0.5, 0.5)

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        mu, g = state.mu, state.g
        for axis, share in zip(self.axes, self.shares):
            angle = share * h * system.velocity(mu)[axis]
            turn = vec(*[angle if k == axis else 0.0 for k in range(3)])
            mu, g = self.turned(system, mu, g, turn, h)
        return lm.BodyState(mu, g)

    def turned(self, system: Any, mu: Any, g: Any, turn: Any, h: float) -> Any:
        moved = None if g is None else system.group.compose_exp(g, turn)
        return system.group.exp_Ad_star(turn, mu), moved


@lm.record
class FromTheWrongSide(Turned):
    def turned(self, system: Any, mu: Any, g: Any, turn: Any, h: float) -> Any:
        group = system.group
        moved = None if g is None else group.compose(group.exp(turn), g)
        return group.exp_Ad_star(turn, mu), moved


@lm.record
class LazyAttitude(lm.RKMK):
    """Momenta by RKMK4, the attitude by the velocity at the start of the step."""

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        new = super().step(system, t, state, h)
        if state.g is None:
            return new
        turn = h * system.velocity(state.mu)
        return lm.BodyState(new.mu, system.group.compose_exp(state.g, turn))


@lm.record
class Rough(lm.Method):
    """The implicit midpoint rule, iterated until two digits more are there."""

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        q, p = state.q, state.p
        x, y = q, p
        for _ in range(4):
            v, f = (system.velocity(0.5 * (q + x), 0.5 * (p + y)), system.force(0.5 * (q + x), 0.5 * (p + y)))
            x, y = q + h * v, p + h * f
        return lm.CanonicalState(x, y)


@lm.record
class Stretching(lm.StormerVerlet):
    """A step that is shorter where q is large."""

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        q = self.observe(memory).q
        return super().step(system, t, memory, h / (1.0 + 0.01 * dot(q, q)))


@lm.record
class OneWay(lm.Method):
    """|h| where h should be."""

    order: ClassVar[int] = 2

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        q, p, k = state.q, state.p, abs(h)
        p = p + 0.5 * k * system.force(q, p)
        q = q + h * system.velocity(q, p)
        return lm.CanonicalState(q, p + 0.5 * k * system.force(q, p))


@lm.record
class Kept(lm.Record):
    state: Any
    force: lm.Vec


@lm.record
class Stale(lm.Method):
    """The force at the end of a step is that of its beginning."""

    order: ClassVar[int] = 2

    def start(self, system: Any, state: Any, h: float) -> Any:
        return Kept(state, system.force(state.q, state.p))

    def observe(self, memory: Any) -> Any:
        return memory.state

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        q, p = memory.state.q, memory.state.p + 0.5 * h * memory.force
        q = q + h * system.velocity(q, p)
        force = system.force(q, p)
        return Kept(lm.CanonicalState(q, p + 0.5 * h * memory.force), force)


@lm.record
class Rescaled(lm.StormerVerlet):
    """The energy is put right after every step."""

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        before, new = self.observe(memory), super().step(system, t, memory, h)
        after = self.observe(new)
        wanted = system.energy(before.q, before.p) - system.potential(after.q)
        ratio = sqrt(abs(wanted / system.kinetic(after.p)))
        return self.start(system, lm.CanonicalState(after.q, ratio * after.p), h)


@lm.record
class Timeless(lm.RKMK):
    """A drive that is read at t = 0."""

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        return super().step(system, 0.0, state, h)


@lm.record
class NotSkew(Area):
    def matrix(self, y: lm.Vec) -> lm.Mat:
        m = super().matrix(y)
        return lm.mat(m[0], -1.0 * m[1], m[2], m[3])


@lm.record
class Coarse(lm.SO3):
    """Small rotations are taken to first order."""

    def exp(self, xi: lm.Vec) -> Any:
        first = lm.mat(vec(1.0, -xi[2], xi[1]), vec(xi[2], 1.0, -xi[0]), vec(-xi[1], xi[0], 1.0))
        return first if dot(xi, xi) < 1e-6 else super().exp(xi)


SECOND: dict[str, tuple[Callable[[], Any], str]] = {
    "not diagonal": (
        lambda: check_system(
            lm.LiePoissonSystem(
                lm.SO3(),
                changed(
                    Tilted, gradient=lambda self, mu: INVERSE @ mu + where(mu[1] < 0.0, 0.3, 0.0) * vec(0.0, mu[1], 0.0)
                )(),
            ),
            raises=False,
        ),
        "gradient",
    ),
    "a matrix that is not symmetric": (
        lambda: check_system(changed(Plate, force=lambda self, q, p: -1.0 * (A @ q))(), raises=False),
        "force of energy",
    ),
    "a transposed matrix": (
        lambda: check_system(changed(Plate, force=lambda self, q, p: -1.0 * (A.T @ q))(), raises=False),
        "force of energy",
    ),
    "the chain rule": (
        lambda: check_system(
            changed(Well, force=lambda self, q, p: (-0.5 / sqrt(1.0 + dot(q, q))) * q)(), raises=False
        ),
        "force of energy",
    ),
    "degrees": (lambda: check_system(InDegrees(), raises=False), "force of energy"),
    "a stale constant": (
        lambda: check_system(
            changed(lm.Kepler, force=lambda self, q, p: (-1.0 / dot(q, q) ** 1.5) * q)(2.0), raises=False
        ),
        "force of energy",
    ),
    "a factor of a velocity": (
        lambda: check_system(changed(lm.Kepler, velocity=lambda self, q, p: 2.0 * p)(), raises=False),
        "velocity of energy",
    ),
    "an entry with a wrong sign": (lambda: check_poisson(NotSkew(), raises=False), "skew symmetry"),
    "small rotations": (lambda: check_group(Coarse(), raises=False), "exponential"),
    "K for Ad*": (lambda: check_group(rotations(Ad_star=lambda self, g, mu: g @ mu), raises=False), "dual of Ad"),
    "an order of axes": (
        lambda: check_method(Turned((0, 1, 2, 0, 1)), BODY, START, compiled=False, raises=False),
        "symmetric",
    ),
    "a share that is missing": (
        lambda: check_method(Turned(shares=(0.5, 0.5, 1.0, 0.5, 0.45)), BODY, START, compiled=False, raises=False),
        "order",
    ),
    "the wrong side": (lambda: check_method(FromTheWrongSide(), BODY, START, compiled=False, raises=False), "order"),
    "the wrong side, momentum": (
        lambda: check_method(FromTheWrongSide(), BODY, START, keeps=["spatial momentum"], compiled=False, raises=False),
        "spatial momentum",
    ),
    "an attitude of order 1": (
        lambda: check_method(LazyAttitude(order=4), BODY, START, compiled=False, raises=False),
        "order",
    ),
    "an iteration that ends early": (
        lambda: check_method(Rough(), GALAXY, IN_GALAXY, compiled=False, raises=False),
        "symmetric",
    ),
    "a step that depends on the state": (
        lambda: check_method(Stretching(), GALAXY, IN_GALAXY, compiled=False, raises=False),
        "order",
    ),
    "|h|": (lambda: check_method(OneWay(), GALAXY, IN_GALAXY, compiled=False, raises=False), "order"),
    "a stale force": (lambda: check_method(Stale(), GALAXY, IN_GALAXY, compiled=False, raises=False), "order"),
    "an energy that is put right": (
        lambda: check_method(Rescaled(), GALAXY, IN_GALAXY, compiled=False, raises=False),
        "symplectic",
    ),
    "a drive at t = 0": (
        lambda: check_method(Timeless(order=4), TURNING, AT_REST, compiled=False, raises=False),
        "order",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SECOND)
def test_a_mistake_as_users_make_it_is_found(name: str) -> None:
    make, law = SECOND[name]
    report = make()
    assert law in [finding.law for finding in report.broken], report
