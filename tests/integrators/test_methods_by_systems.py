"""Every method with every kind of system: the whole motion, or a refusal.

`METHODS` of `shipped.py`, and one table of systems; what wraps a body (damping, noise, a load, an input, another
time, held sites, a constraint) is among the systems.  A pair is refused as IncompatibleSystem, or the
method converges to the motion: beside SciPy's DOP853 for bodies that turn, whose equations are written
here again, beside small steps of another method else.  Native code of a pair, of one body and of several in lanes, has the
bits of plain Python.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import warnings
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import Driven, Relativistic, Steered
from scipy.integrate import solve_ivp
from shipped import BODY, CLASSICAL, COMPOSED, END, METHODS, MU, RIGID, R

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput
from liemech.formulas import cos, log, sin
from liemech.names import everything

J = np.array([1.0, 1.5, 2.2])
SPACE = lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy([*J, 1.3, 1.3, 1.3]))


# ---------------------------------------------------------------- systems of rotations


@lm.record
class Breathing(lm.DrivenKineticEnergy):
    """Moments that change with time."""

    def inertia(self, t: float) -> Any:
        return lm.vec(1.0 + 0.3 * sin(3.0 * t), 1.5, 2.2 - 0.4 * sin(2.0 * t))


@lm.record
class Bent(lm.Hamiltonian):
    """A free body and a quartic."""

    def energy(self, mu: Any) -> Any:
        return 0.5 * (mu[0] ** 2 / J[0] + mu[1] ** 2 / J[1] + mu[2] ** 2 / J[2]) + 0.4 * mu[2] ** 4


@lm.record
class BentAgain(lm.KineticEnergy):
    """The same, as a kinetic energy that writes another one."""

    def energy(self, mu: Any) -> Any:
        return super().energy(mu) + 0.4 * mu[2] ** 4


@lm.record
class Rubbing(lm.Force):
    """Friction, and a torque that changes with time."""

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        return lm.vec(0.6 * cos(4.0 * t), 0.0, 0.0) - 0.5 * xi


@lm.record
class Tabulated(lm.Force):
    """An input: a torque from a table."""

    table: lm.PiecewisePolynomial

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        return self.table(t)


TABLE = lm.PiecewisePolynomial([0.0, 10.0], np.array([[[0.5, -0.3, 0.2], [0.4, 0.0, -0.6]]]))
METRIC = np.diag([1.0, 2.0, 0.5])


def _xi(t: float, mu: np.ndarray) -> np.ndarray:
    return mu / J


def _bent(t: float, mu: np.ndarray) -> np.ndarray:
    return mu / J + np.array([0.0, 0.0, 1.6 * mu[2] ** 3])


def _breathing(t: float, mu: np.ndarray) -> np.ndarray:
    return mu / np.array([1.0 + 0.3 * np.sin(3.0 * t), 1.5, 2.2 - 0.4 * np.sin(2.0 * t)])


def _none(t: float, mu: np.ndarray, g: np.ndarray) -> np.ndarray:
    return np.zeros(3)


def _pull(t: float, mu: np.ndarray, g: np.ndarray) -> np.ndarray:
    return -1.3 * np.cross([0.2, 0.1, 0.9], g[2])


TURNING: dict[str, tuple[Any, Callable[..., np.ndarray], Callable[..., np.ndarray]]] = {
    "free": (BODY, _xi, _none),
    "another energy": (lm.LiePoissonSystem(lm.SO3(), Bent()), _bent, _none),
    "another energy, of a subclass": (lm.LiePoissonSystem(lm.SO3(), BentAgain(J)), _bent, _none),
    "damped": (
        lm.DoubleBracket(BODY, damping=0.7),
        lambda t, mu: mu / J + 0.7 * np.cross(mu, mu / J),
        _none,
    ),
    "damped, another metric": (
        lm.DoubleBracket(BODY, damping=0.7, metric=METRIC),
        lambda t, mu: mu / J + 0.7 * np.cross(mu, mu / J) / np.diag(METRIC),
        _none,
    ),
    "damped, another energy": (
        lm.DoubleBracket(lm.LiePoissonSystem(lm.SO3(), Bent()), damping=0.7),
        lambda t, mu: _bent(t, mu) + 0.7 * np.cross(mu, _bent(t, mu)),
        _none,
    ),
    "driven": (lm.DrivenLiePoissonSystem(lm.SO3(), Breathing()), _breathing, _none),
    "in a field": (
        lm.MechanicalSystem(BODY, lm.models.FixedPointGravity(1.3, [0.2, 0.1, 0.9])),
        _xi,
        _pull,
    ),
    "under a load": (
        lm.MechanicalSystem(BODY, lm.NoPotential(), load=Rubbing()),
        _xi,
        lambda t, mu, g: np.array([0.6 * np.cos(4.0 * t), 0.0, 0.0]) - 0.5 * mu / J,
    ),
    "with an input": (
        lm.MechanicalSystem(BODY, lm.NoPotential(), load=Tabulated(TABLE)),
        _xi,
        lambda t, mu, g: np.asarray(TABLE(t)),
    ),
    "driven, in a field": (
        lm.MechanicalSystem(
            lm.DrivenLiePoissonSystem(lm.SO3(), Breathing()), lm.models.FixedPointGravity(1.3, [0.2, 0.1, 0.9])
        ),
        _breathing,
        _pull,
    ),
}  # fmt: skip


def turning(name: str) -> np.ndarray:
    """The momentum and the attitude at the end, by DOP853."""
    _, velocity, torque = TURNING[name]

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        mu, g = y[:3], y[3:].reshape(3, 3)
        x, y_, z = xi = velocity(t, mu)
        hat = np.array([[0.0, -z, y_], [z, 0.0, -x], [-y_, x, 0.0]])
        return np.concatenate([np.cross(mu, xi) + torque(t, mu, g), (g @ hat).ravel()])

    y = solve_ivp(rate, (0.0, END), np.concatenate([MU, R.ravel()]), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return y


# ---------------------------------------------------------------- all systems


@lm.record
class Stirred(lm.GroupEquation):
    """A velocity that depends on where it is."""

    group: lm.SO3 = lm.SO3()

    def velocity(self, t: float, g: Any) -> Any:
        return lm.vec(g[0, 1], 1.0 + t, g[2, 2])


@lm.record
class OnSphere(lm.HomogeneousEquation):
    """A direction that turns about an axis which depends on it."""

    def velocity(self, t: float, x: Any) -> Any:
        return lm.vec(0.3 + x[1], 1.0 - x[0] * x[2], 0.7 * x[0])


@lm.record
class Circling(lm.VectorField):
    """A flow in the plane with a sink."""

    dim: ClassVar[int] = 2

    def velocity(self, y: Any) -> Any:
        return lm.vec(y[1] - 0.3 * y[0] ** 3, -y[0])


@lm.record
class Pumped(lm.DrivenHamiltonianSystem):
    """A pendulum whose weight changes."""

    degrees: ClassVar[int] = 1

    def energy(self, t: float, q: Any, p: Any) -> Any:
        return 0.5 * p[0] ** 2 - (1.0 + 0.5 * sin(3.0 * t)) * cos(q[0])


@lm.record
class Seasons(lm.DrivenHamiltonian):
    """The energy of two species whose growth changes with the seasons."""

    def energy(self, t: float, y: Any) -> Any:
        return y[0] + y[1] - (1.0 + 0.3 * sin(2.0 * t)) * log(y[0]) - 2.0 * log(y[1])


@lm.record
class StiffAndSoft(lm.MultirateSystem):
    """Springs of two kinds."""

    degrees: ClassVar[int] = 2
    parts: ClassVar[tuple[str, ...]] = ("stiff", "soft")

    def kinetic(self, p: Any) -> Any:
        return 0.5 * lm.dot(p, p)

    def stiff(self, q: Any) -> Any:
        return 2.0 * (q[0] - q[1]) ** 2

    def soft(self, q: Any) -> Any:
        return 0.3 * q[0] ** 4 + 0.5 * q[1] ** 2


@lm.record
class Charged(lm.CotangentSystem):
    """A charged body in a magnetic field."""

    configurations: ClassVar[lm.LieGroup] = lm.SO3()

    def energy(self, mu: Any, g: Any) -> Any:
        u = mu - 0.6 * lm.vec(0.8 * g[2, 0], 0.5 * g[2, 1], 1.1 * g[2, 2])
        return 0.5 * lm.dot(u, u / lm.Vec.of(J.tolist())) + 0.4 * g[2, 0]


@lm.record
class ChargedByVelocities(lm.TangentSystem):
    """The same by its Lagrangian."""

    configurations: ClassVar[lm.LieGroup] = lm.SO3()

    def lagrangian(self, xi: Any, g: Any) -> Any:
        A = 0.6 * lm.vec(0.8 * g[2, 0], 0.5 * g[2, 1], 1.1 * g[2, 2])
        return 0.5 * lm.dot(xi, xi * lm.Vec.of(J.tolist())) + lm.dot(xi, A) - 0.4 * g[2, 0]


@lm.record
class OnRockingBase(lm.DrivenCotangentSystem):
    """A body, its place told from a base that turns to and fro."""

    configurations: ClassVar[lm.LieGroup] = lm.SO3()

    def energy(self, t: float, mu: Any, g: Any) -> Any:
        return 0.5 * lm.dot(mu, mu / lm.Vec.of(J.tolist())) - cos(3.0 * t) * lm.dot(g[0], mu)


@lm.record
class ChargedSite(lm.Term):
    """A charged body in the field of all sites."""

    def energy(self, a: Any) -> Any:
        u = a.mu - 0.6 * lm.vec(0.8 * a.g[2, 0], 0.5 * a.g[2, 1], 1.1 * a.g[2, 2])
        return 0.5 * lm.dot(u, u / lm.Vec.of(J.tolist())) + 0.4 * a.g[2, 0]


@lm.record
class RockingSite(lm.Term):
    """A body, its place told from a base that turns to and fro."""

    def energy(self, a: Any, t: float) -> Any:
        return 0.5 * lm.dot(a.mu, a.mu / lm.Vec.of(J.tolist())) - cos(3.0 * t) * lm.dot(a.g[0], a.mu)


@lm.record
class Knife(lm.VelocityConstraint):
    """No velocity along the first axis of the body."""

    def matrix(self, g: Any) -> Any:
        return lm.mat(lm.vec(0.0, 0.0, 0.0, 1.0, 0.0, 0.0))


@lm.record
class Circle(lm.Surface):
    """Half a metre from the origin."""

    def value(self, q: Any) -> Any:
        return lm.vec(lm.dot(q, q) - 0.25)


@lm.record
class Bead(lm.ConstrainedLagrangianSystem):
    """A bead on a wire, with a mass that depends on where it is."""

    degrees: ClassVar[int] = 2

    def mass(self, q: Any) -> Any:
        return lm.mat(lm.vec(1.0 + q[0] ** 2, 0.2), lm.vec(0.2, 1.5))

    def potential(self, q: Any) -> Any:
        return 0.7 * q[1]

    def constraint(self, q: Any) -> Any:
        return lm.vec(q[1] - 0.5 * q[0] ** 2)


@lm.record
class GreatCircles(lm.ConstrainedPart):
    """Free motion on the sphere."""

    def energy(self, q: Any, p: Any) -> Any:
        return 0.5 * lm.dot(p, p)

    def flow(self, system: Any, q: Any, p: Any, t: float) -> Any:
        return lm.SphericalPendulum(mass=1.0, length=1.0, gravity=0.0).geodesic(q, p, t)


@lm.record
class Weight(lm.ConstrainedPart):
    """A potential."""

    def energy(self, q: Any, p: Any) -> Any:
        return 0.9 * q[2]


@lm.record
class Ball(lm.SplitConstrainedSystem):
    """A point on the sphere, by parts of its energy."""

    degrees: ClassVar[int] = 3

    def constraint(self, q: Any) -> Any:
        return lm.vec(0.5 * (lm.dot(q, q) - 1.0))


@lm.record
class Pivot(lm.Constraint):
    """A point of the body stays where it is."""

    def value(self, g: Any) -> Any:
        return lm.vec(*[0.5 * g[i, 2] + g[i, 3] - (0.5 if i == 2 else 0.0) for i in range(3)])


def _spins(damping: float = 0.0) -> Any:
    system = lm.LiePoissonSystem(lm.SO3() ** 2, lm.Terms(Coupling(0.8).over(BOND), Level().over()))
    return lm.DoubleBracket(system, damping) if damping else system


@lm.record
class Coupling(lm.Term):
    """Exchange."""

    strength: float

    def energy(self, a: Any, b: Any) -> Any:
        return -self.strength * lm.dot(a.mu, b.mu)


@lm.record
class Level(lm.Term):
    """A field along the third axis."""

    def energy(self, a: Any) -> Any:
        return 0.6 * a.mu[2]


@lm.record
class Tie(lm.Term):
    """A spring between two places."""

    def energy(self, a: Any, b: Any) -> Any:
        d = a.g - b.g
        return 0.5 * lm.dot(d, d) + 0.2 * lm.dot(d, d) ** 2


def _masses(**options: Any) -> Any:
    free = lm.LiePoissonSystem(lm.VectorSpace(2) ** 3, lm.PerSite(lm.KineticEnergy([1.0, 1.0])))
    return lm.MechanicalSystem(free, lm.Terms(Tie().over(lm.neighbours.ring(3)), **options))


PLACES = np.array([[0.0, 0.1], [1.1, 0.0], [0.4, 0.9]])
SPINS = np.random.default_rng(3).normal(size=(2, 3))
BOND = lm.neighbours.edges([(0, 1)])
SPEEDS = np.array([[0.2, 0.0], [-0.1, 0.3], [0.0, -0.2]])
PAIR = lm.ProductGroup(lm.SO3(), lm.VectorSpace(2))
TWO = lm.LiePoissonSystem(PAIR, lm.KineticEnergy([*J, 1.1, 1.1]))
BODIES = lm.LiePoissonSystem(lm.SO3() ** 2, lm.PerSite(lm.KineticEnergy(J)))
PLANE = lm.PoissonSystem(lm.structures.LogCanonical([[0.0, 1.0], [-1.0, 0.0]]), lm.models.LotkaVolterra().hamiltonian)


def _kepler(wrap: Callable[[Any], Any]) -> tuple[Any, Any]:
    return wrap(lm.Kepler()), lm.Kepler().state([0.8, 0.1], [0.1, 1.1])


SYSTEMS: dict[str, Callable[[], tuple[Any, Any]]] = {
    **{name: (lambda s=one[0]: (s, s.state(mu=MU, g=R))) for name, one in TURNING.items()},
    "in space": lambda: (SPACE, SPACE.state([*MU, 0.3, -0.2, 0.5], np.eye(4))),
    "in space, damped": lambda: _started(lm.DoubleBracket(SPACE, 0.7), mu=[*MU, 0.3, -0.2, 0.5], g=np.eye(4)),
    "in space, falling": lambda: _started(
        lm.MechanicalSystem(SPACE, lm.models.UniformGravity(1.3)), mu=[*MU, 0.3, -0.2, 0.5], g=np.eye(4)
    ),
    "a product": lambda: _started(TWO, mu=[*MU, 0.3, -0.2]),
    "a product, damped": lambda: _started(lm.DoubleBracket(TWO, 0.7), mu=[*MU, 0.3, -0.2]),
    "two bodies": lambda: _started(BODIES, mu=[MU, MU[::-1]]),
    "two bodies, damped": lambda: _started(lm.DoubleBracket(BODIES, 0.7), mu=[MU, MU[::-1]]),
    "spins": lambda: _started(_spins(), mu=SPINS),
    "spins, damped": lambda: _started(_spins(0.7), mu=SPINS),
    "spins, held": lambda: _started(
        lm.LiePoissonSystem(lm.SO3() ** 2, lm.Terms(Coupling(0.8).over(BOND), held=[1])), mu=SPINS
    ),
    "masses": lambda: _started(_masses(), mu=SPEEDS, g=PLACES),
    "masses, one held": lambda: _started(_masses(held=[0]), mu=SPEEDS * [[0.0], [1.0], [1.0]], g=PLACES),
    "friction": lambda: _started(
        lm.Metriplectic(BODY, entropy=lm.KineticEnergy([1.0, 1.0, 1.0]), friction=0.7), mu=MU
    ),
    "viscous": lambda: _viscous(),
    "isospectral": lambda: _started(
        lm.models.TodaFlow(3), [[0.4, 0.5, 0.0], [0.5, -0.1, 0.3], [0.0, 0.3, 0.2]]
    ),
    "of momentum and place": lambda: _started(Charged(), MU, R),
    "of velocity and place": lambda: _started(ChargedByVelocities(), MU, R),
    "of momentum and place, driven": lambda: _started(OnRockingBase(), MU, R),
    "sites of momentum and place": lambda: _started(
        lm.CotangentSites(lm.SO3() ** 2, lm.Terms(ChargedSite())), [MU, MU[::-1]], np.array([R, np.eye(3)])
    ),
    "sites of momentum and place, driven": lambda: _started(
        lm.DrivenCotangentSites(lm.SO3() ** 2, lm.Terms(RockingSite())), [MU, MU[::-1]], np.array([R, np.eye(3)])
    ),
    "cells of a field": lambda: _started(
        lm.Field(lm.SO3(), lm.FieldDensity(lm.KineticEnergy(J), lm.KineticEnergy([0.5, 0.8, 0.6])), 2.0, 1),
        [MU, MU[::-1]], np.array([R, np.eye(3)])
    ),
    "another time": lambda: (lm.SundmanTransformed(BODY, lambda mu: 1.0 + lm.dot(mu, mu)), BODY.state(MU, R)),
    "another time, damped": lambda: (
        lm.SundmanTransformed(lm.DoubleBracket(BODY, 0.7), lambda mu: 1.0 + lm.dot(mu, mu)),
        lm.DoubleBracket(BODY, 0.7).state(mu=MU, g=R),
    ),
    "planet": lambda: _kepler(lambda s: s),
    "planet, another time": lambda: _kepler(lambda s: lm.TimeTransformed(s, lambda q: lm.dot(q, q))),
    "planet, logarithmic": lambda: _kepler(lm.LogarithmicHamiltonian),
    "separable": lambda: _started(Relativistic(), [1.0, 0.2], [0.3, 1.0]),
    "canonical": lambda: _started(lm.models.DoublePendulum(gravity=1.0), [0.9, -0.4], [0.7, 0.2]),
    "canonical, driven": lambda: _started(Pumped(), [0.9], [0.4]),
    "multirate": lambda: _started(StiffAndSoft(), [0.4, -0.2], [0.3, 0.5]),
    "a pendulum on a rod": lambda: _started(lm.SphericalPendulum(), [0.6, 0.0, -0.8], [0.4, 1.5, 0.3]),
    "constrained by equations": lambda: _started(
        lm.Constrained(lm.models.HenonHeiles(), Circle()), [0.3, 0.4], [0.4, -0.3]
    ),
    "constrained, of a Lagrangian": lambda: (Bead(), Bead().consistent([0.4, 0.08], [0.3, 0.15])),
    "constrained, of parts": lambda: _started(Ball((GreatCircles(), Weight())), [0.6, 0.0, -0.8], [0.4, 1.5, 0.3]),
    "a body on a pivot": lambda: _pivoted(),
    "a knife": lambda: _knife(),
    "a linkage": lambda: _linkage(),
    "Poisson": lambda: _started(PLANE, [1.5, 1.0]),
    "Poisson, in a chart": lambda: lm.charts.LogarithmicDarboux(PLANE.structure).system(PLANE, PLANE.state([1.5, 1.0])),
    "driven species": lambda: _started(lm.DrivenPoissonSystem(PLANE.structure, Seasons()), [1.5, 1.0]),
    "charged": lambda: _started(lm.models.ChargedParticle(lm.models.AxialField()), [0.9, 0.1, 0.0, 0.2, 0.5, 0.3]),
    "a field of vectors": lambda: _started(Circling(), [0.7, 0.4]),
    "a sum of fields": lambda: _started(lm.SplitField((Circling(), Circling())), [0.7, 0.4]),
    "two planets": lambda: _started(
        lm.models.NBody([1.0, 0.6], dimension=2), [1.0, 0.0, -0.5, 0.2], [0.1, 0.6, 0.0, -0.5]
    ),
    "on rotations": lambda: _started(Stirred(), R),
    "on rotations, driven": lambda: _started(Driven(lm.SO3()), R),
    "on rotations, steered": lambda: _started(Steered(lm.SO3()), R),
    "on the sphere": lambda: _started(OnSphere(lm.actions.SphereAction(3)), [0.6, 0.0, 0.8]),
    "noise": lambda: _noisy(BODY),
    "noise, damped": lambda: _noisy(lm.DoubleBracket(BODY, 0.7)),
    "noise by an energy": lambda: _noisy(BODY, fields=[lm.KineticEnergy([1.0, 2.0, 3.0])]),
}  # fmt: skip


def _started(system: Any, *args: Any, **options: Any) -> tuple[Any, Any]:
    return system, system.state(*args, **options)


def _viscous() -> tuple[Any, Any]:
    system = lm.models.ViscousSphere(lm.models.ZeitlinSphere(13), viscosity=0.2)
    return system, system.from_harmonics({(2, 1): 0.5, (3, 0): 0.4})


def _pivoted() -> tuple[Any, Any]:
    system = lm.ConstrainedBody(SPACE, Pivot())
    return system, system.consistent(mu=[0.3, 0.4, 0.5, 0.26, -0.13, 0.0], g=np.eye(4))


def _knife() -> tuple[Any, Any]:
    system = lm.NonholonomicBody(SPACE, Knife())
    return system, system.state(mu=[*MU, 0.0, 0.3, 0.5], g=np.eye(4))


def _linkage() -> tuple[Any, Any]:
    chain = lm.joints.chain(1, axis=[0.0, 1.0, 0.0])
    system = lm.joints.Linkage(chain.links, chain.joints, forces=[lm.joints.Spring(0, 3.0, 0.2)])
    return system, system.state(angles={0: 0.8})


def _noisy(body: Any, fields: Any = ((0.5, 0.0, 0.0),)) -> tuple[Any, Any]:
    system = lm.Stochastic(body, fields=[*fields], seed=1)
    return system, system.state(mu=MU)


# ---------------------------------------------------------------- runs


def end(system: Any, method: lm.Method, start: Any, steps: int) -> np.ndarray:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        span = {"t_end": END} if system.fictive or method.fictive else {"steps": steps}
        run = lm.integrate(system, method, start, h=END / steps, **span, every=steps, compiled=False)
    parts = {name: np.ravel(x) for name, x in run.last.arrays.items() if name != "path"}
    return np.concatenate([[run.t[-1]], *parts.values()])


def observed(system: Any, method: lm.Method, start: Any, reference: Callable[[int], np.ndarray]) -> str:
    """What a pair does: "refused", "the motion", or what is wrong."""
    try:
        method.require(system)
    except IncompatibleSystem:
        return "refused"
    try:
        counts = (6,) if isinstance(method, lm.ExactMoserVeselov) else (6, 12, 24)  # which is fitted to a step
        errors = [end(system, method, start, steps) - reference(steps) for steps in counts]
    except IncompatibleSystem:
        return "refused"
    except InvalidInput as error:
        if "sigma is a function of" in str(error):  # of parts that the system has not
            return "refused"
        raise
    sizes = [float(np.abs(error).max()) for error in errors]
    falling = len(sizes) > 1 and all(later <= 0.7 * size for size, later in itertools.pairwise(sizes))
    small = 1e-3 if system.noisy else 1e-9  # the noise itself changes the motion by 0.1
    return "the motion" if falling or sizes[-1] <= small else f"errors {sizes}"


DEAR = (lm.LiePoissonHamiltonJacobi(4), lm.CovariantVariational(lagrangian=lm.QuadratureLagrangian()))
FITTED = next(method for method in METHODS if isinstance(method, lm.ExactMoserVeselov))
QUICK = [name for name in SYSTEMS if name in TURNING or "damped" in name or "noise" in name or "fields" in name]
"""What wraps a body, which is looked at by default; the others are slow all together."""


def reference(name: str, system: Any, start: Any) -> Callable[[int], np.ndarray]:
    """Time and state at the end; under noise that of as many steps, on which its increments depend."""
    exact: lm.Method = lm.RKMK(order=8)
    if name in TURNING:
        found = np.concatenate([[END], turning(name)])
    elif system.noisy:
        return functools.cache(lambda steps: end(system, lm.WongZakai(exact), start, steps))
    else:
        if system.dissipative:
            exact = lm.DissipativeSplitting(exact)
        found = end(system, exact, start, 48)
    return lambda steps: found


def pairs() -> Any:
    for name in SYSTEMS:
        yield pytest.param(name, False, marks=[] if name in QUICK else [pytest.mark.slow], id=name)
        if name != "free":
            yield pytest.param(name, True, marks=pytest.mark.slow, id=f"{name}, dear methods")


@pytest.mark.parametrize(("name", "dear"), [*pairs()])
def test_the_whole_motion_or_a_refusal(name: str, dear: bool) -> None:
    system, start = SYSTEMS[name]()
    exact, wrong = reference(name, system, start), {}
    for method in METHODS:
        if (method in DEAR) is dear or name == "free":
            found = observed(system, method, start, exact)
            if found not in ("refused", "the motion"):
                wrong[repr(method)] = found
    assert not wrong


def test_what_wraps_a_body_is_seen_in_its_motion() -> None:
    """So that a method which leaves it out does not converge."""
    free = turning("free")
    for name in TURNING:
        assert name == "free" or np.abs(turning(name) - free).max() > 1e-3, name


def test_what_moves_a_free_body_refuses_a_damped_one() -> None:
    for system in (lm.DoubleBracket(BODY, 0.3), lm.DoubleBracket(SPACE, 0.3), lm.DoubleBracket(TWO, 0.3)):
        for method in (lm.ExactFreeBody(), lm.ThreeRotations(), lm.Composition(lm.ThreeRotations(), order=4), FITTED):
            with pytest.raises(IncompatibleSystem):
                method.require(system)
    with pytest.raises(IncompatibleSystem, match="more in its motion"):
        lm.ExactFreeBody().require(lm.DoubleBracket(BODIES, 0.3))


def test_every_kind_of_system_is_in_the_table() -> None:
    public = [x for x in everything().values() if isinstance(x, type)]
    seen = {base for make in SYSTEMS.values() for base in type(make()[0]).__mro__}
    kinds = {
        next(x for x in one.__mro__ if ".models." not in x.__module__) for one in public if issubclass(one, lm.System)
    }
    assert kinds - seen == set()


@pytest.mark.parametrize("sites", [2, 6])
def test_many_bodies_that_are_damped_or_driven_by_noise(sites: int) -> None:
    """Written out and by sites: what moves free bodies is refused."""
    bodies = lm.LiePoissonSystem(lm.SO3() ** sites, lm.PerSite(lm.KineticEnergy(J)))
    damped, mu = lm.DoubleBracket(bodies, 0.7), np.tile(MU, (sites, 1))
    for method in (lm.ExactFreeBody(), lm.CovariantVariational(), lm.LiePoissonHamiltonJacobi(2)):
        with pytest.raises(IncompatibleSystem):
            lm.integrate(damped, method, damped.state(mu=mu), h=0.1, steps=1, compiled=False)
        for system in (lm.Stochastic(damped, fields=[[0.5, 0.0, 0.0]]), lm.thermal_bath(bodies, 0.7, 0.1)):
            with pytest.raises(IncompatibleSystem):
                lm.integrate(system, lm.WongZakai(method), system.state(mu=mu), h=0.1, steps=1, compiled=False)
    noisy = lm.Stochastic(bodies, fields=[[0.5, 0.0, 0.0]])
    with pytest.raises(IncompatibleSystem):
        lm.integrate(noisy, lm.WongZakai(lm.ExactFreeBody()), noisy.state(mu=mu), h=0.1, steps=1, compiled=False)


# ---------------------------------------------------------------- the same bits in native code


def _turning_on(group: Any) -> tuple[Any, Any]:
    system = lm.LiePoissonSystem(group, lm.KineticEnergy(np.linspace(1.0, 2.0, group.dim)))
    return _started(system, mu=np.linspace(-0.5, 0.4, group.dim), g=group.exp(np.linspace(0.3, -0.2, group.dim)))


ON_GROUPS = {
    f"on {group!r}": functools.partial(_turning_on, group) for group in (*RIGID, *CLASSICAL, *COMPOSED) if group.dim < 9
}
EXP, CAYLEY = lm.Exponential(), lm.Cayley()
FURTHER = [
    *((name, lm.RKMK(order=4)) for name in ON_GROUPS),
    *((name, lm.CovariantVariational(EXP)) for name in ON_GROUPS),
    *((f"on {group!r}", lm.CovariantVariational(CAYLEY)) for group in (lm.SE2(), lm.SE3(), lm.SU(2), COMPOSED[1])),
    *((f"on {group!r}", lm.CovariantVariational(lm.CayleyAdjoint())) for group in (lm.SE2(), lm.SE3())),
    *((f"on {group!r}", lm.RKMK(order=4, truncation="closed")) for group in (lm.SE2(), lm.SE3())),
    *(("free", method) for method in (lm.LiePoissonHamiltonJacobi(6, EXP), lm.Composition(lm.ThreeRotations(), order=8))),
    *(("free", lm.FirstKindHamiltonJacobi(order, tau)) for order, tau in ((4, EXP), (2, CAYLEY))),
    *(("driven, in a field", lm.GalerkinVariational(4, tau)) for tau in (EXP, CAYLEY)),
    *(("in space, falling", method) for method in (lm.KickDrift(), lm.LieVerlet(CAYLEY), lm.RKMK(order=4))),
    *(("under a load", method) for method in (lm.RKMK(order=4), lm.KickDrift(order=4), lm.LieVerlet())),
    *((name, lm.Magnus(order=6)) for name in ("on rotations, driven",)),
    *(("on rotations, steered", method) for method in (lm.CommutatorFree(order=3), lm.CrouchGrossman(order=4))),
    *(("canonical", method) for method in (lm.RKMK(order=4), lm.HamiltonJacobi(3, adjoint=True))),
    *(("canonical, driven", method) for method in (lm.HamiltonJacobi(2), lm.SymmetricHamiltonJacobi(2, "qQ"))),
    *(("planet", method) for method in (lm.HamiltonJacobi(2), lm.Splitting(order=6), lm.StormerVerlet())),
    *(("of momentum and place", method) for method in (lm.RKMK(order=4), lm.SymplecticRKMK(order=4))),
    *(("multirate", lm.MultipleTimeSteps(ratios, mollified=soft)) for ratios, soft in (((40,), False), ((4,), True))),
    *((name, lm.Splitting(order=4)) for name in ("charged", "Poisson", "constrained, of parts")),
    ("planet, logarithmic", lm.Splitting(order=4, quadratic=False)),
    *((name, lm.RKMK(order=4)) for name in ("of velocity and place", "a field of vectors", "on the sphere", "masses, one held")),
    ("another time", lm.RKMK(order=2)),
    ("a linkage", lm.LieRATTLE()),
]  # fmt: skip
"""Pairs beside those of every method with the system of which it is the turn."""


@functools.cache
def native_pairs() -> dict[lm.Method, str]:
    """Of every method the system, among those that it moves, which fewest methods before it have."""
    systems, taken, chosen = {name: make()[0] for name, make in SYSTEMS.items()}, dict.fromkeys(SYSTEMS, 0), {}
    for method in METHODS:
        moved = []
        for name, system in systems.items():
            with contextlib.suppress(IncompatibleSystem):
                method.require(system)
                moved.append(name)
        if moved:
            chosen[method] = min(moved, key=taken.__getitem__)
            taken[chosen[method]] += 1
    return chosen


@pytest.mark.compiled
@pytest.mark.sample(4)
@pytest.mark.parametrize(("name", "method"), [*((None, method) for method in METHODS), *FURTHER], ids=repr)
def test_native_code_has_the_bits_of_plain_python(name: str | None, method: lm.Method) -> None:
    """One body alone, and the second of three in lanes."""
    name = name or native_pairs().get(method)
    if name is None:
        pytest.skip("moves sites, or bodies of which there is none in the table")
    system, start = {**SYSTEMS, **ON_GROUPS}[name]()
    timed = system.fictive or method.fictive

    def run(begin: Any, compiled: bool) -> Any:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            span = {"t_end": END} if timed else {"steps": 4}
            return lm.integrate(system, method, begin, h=END / 6, compiled=compiled, progress=False, **span)

    moving = next(part for part in (*("mu", "p", "y", "x", "g"), *start.parts) if part in start.parts)
    several = {part: np.stack([x, x, x]) for part, x in start.arrays.items()}
    if moving in ("mu", "p", "y"):
        several[moving] *= np.reshape([0.9, 1.0, 1.1], (3, *[1] * (several[moving].ndim - 1)))
    plain, native, lanes = run(start, False), run(start, True), run(type(start)(**several), True)
    assert native.compiled and lanes.compiled and not plain.compiled
    for part, values in {"t": plain.t, **plain.states}.items():
        assert np.array_equal(values, native.t if part == "t" else native.states[part]), part
        assert part == "t" or timed or np.array_equal(values, lanes.states[part][:, 1]), part
