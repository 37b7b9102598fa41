"""What several test files share: bodies, methods, and ways to measure."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.formulas import cos, sin, sqrt, vec
from liemech.systems.equations.group_equation import GroupEquation, LinearGroupEquation

REFERENCES = Path(__file__).parent / "reference"

SEED_INERTIA, SEED_MU = (2 / 3, 1.0, 2.0), (0.5, 0.0, 0.75**0.5)

RKMK4 = lm.RKMK(order=4)
EXP = lm.CovariantVariational(lm.Exponential())
CAYLEY = lm.CovariantVariational(lm.Cayley())
METHODS = (RKMK4, EXP, CAYLEY)


@lm.record
class Fenced(lm.RKMK):
    """Steps that end where mu_2 becomes large."""

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        if state.mu[1] > 0.6:
            raise ValueError("beyond the fence")
        return super().step(system, t, state, h)


def named(method: lm.Method) -> str:
    """For the names of tests."""
    return method.name


def slow(*values: object) -> Any:
    """Parameters of a test that is run with `-m slow` only."""
    return pytest.param(*values, marks=pytest.mark.slow)


def quiet_body(inertia: object) -> lm.RigidBody:
    """A body whose inertia may break the triangle inequality."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", lm.errors.InertiaWarning)
        return lm.RigidBody(inertia)


def seed_body() -> tuple[lm.RigidBody, lm.BodyState]:
    """The article's body and start."""
    body = quiet_body(SEED_INERTIA)
    return body, body.state(SEED_MU, np.eye(3))


def asymmetric_body(seed: int = 1) -> tuple[lm.RigidBody, lm.BodyState]:
    """Three different moments, and a start that is aligned with nothing."""
    body = lm.RigidBody([1.0, 1.6, 2.3])
    rng = np.random.default_rng(seed)
    mu = rng.normal(size=3)
    return body, body.state(1.3 * mu / np.linalg.norm(mu), rotation(rng))


def rotation(rng: np.random.Generator) -> np.ndarray:
    """A random rotation matrix."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


def hat(w: Sequence[float]) -> np.ndarray:
    """hat(w) x = w x x, written down once more."""
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def slope(h: Sequence[float], error: Sequence[float]) -> float:
    """The order of a method: the slope of log error over log h, by least squares."""
    return float(np.polyfit(np.log(h), np.log(error), 1)[0])


def errors_at(
    body: lm.RigidBody, method: lm.Method, start: lm.BodyState, t_end: float, counts: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    """The largest error of momentum and of attitude on the way to t_end, against the exact motion,
    for numbers of steps.
    """
    mu, g = [], []
    for n in counts:
        run = lm.integrate(body, method, start, h=t_end / n, steps=n, every=n // min(counts))
        exact = body.exact(start, run.t)
        mu.append(np.abs(run.mu - exact.mu).max())
        g.append(np.abs(run.g - exact.g).max())
    return np.array(mu), np.array(g)


def step_map(system: lm.LiePoissonSystem, method: lm.Method, h: float) -> Callable[[np.ndarray], np.ndarray]:
    """One step of a method as a map of momenta (n, dim) to momenta."""
    return lambda mu: lm.integrate(system, method, system.state(mu), h=h, steps=1, compiled=False).mu[-1]


def poisson_defect(system: lm.LiePoissonSystem, method: lm.Method, mu: np.ndarray, h: float) -> float:
    """max |phi' B(mu) phi'^T - B(phi(mu))| of one step phi; phi' by central differences, extrapolated."""
    phi, n = step_map(system, method, h), len(mu)

    def derivative(e: float) -> np.ndarray:
        plus, minus = phi(mu + e * np.eye(n)), phi(mu - e * np.eye(n))
        return (plus - minus).T / (2 * e)

    jacobian = (4 * derivative(5e-4) - derivative(1e-3)) / 3
    structure = system.group.algebra.poisson_structure
    return float(np.abs(jacobian @ structure(mu) @ jacobian.T - structure(phi(mu[None])[0])).max())


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    """Equal bit for bit."""
    return a.shape == b.shape and bool((a.view(np.int64) == b.view(np.int64)).all())


# ---------------------------------------------------------------- equations on rotations


@lm.record
class Driven(LinearGroupEquation):
    """g' = g xi(t), with velocities that do not commute from one time to another."""

    def drive(self, t: float) -> lm.Vec:
        return vec(1.0 / (1.0 + t), sin(2.0 * t), cos(t) * cos(t))


@lm.record
class DrivenFromSpace(Driven):
    """The same numbers as a spatial velocity: g' = xi(t) g."""

    side = "right"


@lm.record
class Steered(GroupEquation):
    """g' = g xi(t, g), a body velocity that depends on time and place."""

    def velocity(self, t: float, g: lm.Element) -> lm.Vec:
        return vec(g[0, 0] * cos(t), g[1, 0] - 0.5 * g[2, 1], 1.0 + sin(t) * g[2, 0])


@lm.record
class SteeredFromSpace(Steered):
    """The same numbers as a spatial velocity: g' = xi(t, g) g."""

    side = "right"


@lm.record
class DrivenInverse(DrivenFromSpace):
    """The equation of g^-1, if g moves as `Driven`."""

    def drive(self, t: float) -> lm.Vec:
        return -Driven(lm.SO3()).drive(t)


@lm.record
class SteeredInverse(SteeredFromSpace):
    """The equation of k = g^-1, if g moves as `Steered`: k' = -xi(t, k^-1) k."""

    def velocity(self, t: float, g: lm.Element) -> lm.Vec:
        return -Steered(lm.SO3()).velocity(t, g.T)


# ---------------------------------------------------------------- bodies with reference values, and bodies in fields


def reference(name: str) -> dict[str, Any]:
    """A computation in many digits, from elsewhere."""
    return json.loads((REFERENCES / f"{name}.json").read_text())


def numbers(value: Any) -> np.ndarray:
    """Decimal fractions in text as arrays."""
    return np.array(value, dtype=float)


TOP, LAGRANGE = reference("heavy_top"), reference("heavy_top_lagrange")


def heavy_top(load: lm.Force | None = None) -> tuple[lm.models.HeavyTop, lm.BodyState]:
    """An asymmetric top with an inclined centre of mass; `TOP` has where it is later."""
    top = lm.models.HeavyTop(numbers(TOP["J"]), float(TOP["mgl"]), numbers(TOP["chi"]), load=load)
    return top, top.state(numbers(TOP["pi0"]), numbers(TOP["R0"]))


def lagrange_top() -> tuple[lm.models.LagrangeTop, lm.BodyState]:
    """A symmetric top; `LAGRANGE` has where it is later."""
    A, _, C = numbers(LAGRANGE["J"])
    top = lm.models.LagrangeTop(transverse=A, axial=C, weight=float(LAGRANGE["mgl"]), length=1.0)
    return top, top.state(numbers(LAGRANGE["pi0"]), numbers(LAGRANGE["R0"]))


def falling_body() -> tuple[lm.models.FallingBody, lm.BodyState]:
    """A body that turns and falls."""
    body = lm.models.FallingBody([1.0, 1.6, 2.3], mass=1.7)
    return body, body.state([0.4, 0.5, 0.6, 1.0, 2.0, 3.0], lm.SE3().random(1))


def orbiting_body(radius: float = 3.0) -> tuple[lm.models.OrbitingBody, lm.BodyState]:
    """A satellite in a gravity gradient, on a circular orbit, inclined."""
    body = lm.models.OrbitingBody([[0.05, 0.01, 0.0], [0.01, 0.08, 0.0], [0.0, 0.0, 0.11]], mass=1.7, attraction=1.0)
    return body, body.circular_orbit(radius, lm.SO3().exp([0.1, 0.2, 0.3]))


def kirchhoff_body() -> tuple[lm.models.KirchhoffBody, lm.BodyState, list[tuple[float, np.ndarray, np.ndarray]]]:
    """A body in a fluid with all its couplings, a start, and where it is later: times, momenta and poses, to 20 digits."""
    data = reference("kirchhoff_se3")
    A, D, M, R0, x0 = (numbers(data[name]) for name in ("A", "D", "M", "R0", "x0"))
    body = lm.models.KirchhoffBody(np.linalg.inv(np.block([[A, D], [D.T, M]])))
    later = [
        (float(at["t"]), np.array(at["Pi"] + at["P"], float), pose(*(np.array(at[name], float) for name in ("R", "x"))))
        for at in data["samples"]
    ]
    return body, body.state(np.array(data["Pi0"] + data["P0"], float), pose(R0, x0)), later


def pose(R: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The element of SE(3) that turns by R and shifts by x."""
    return np.block([[R, x[:, None]], [np.zeros(3), 1.0]])


# ---------------------------------------------------------------- a group that writes only what it must


@lm.record
class PlaneAlgebra(lm.LieAlgebra):
    """se(2) with the basis rotation, x, y: [E1, E2] = E3, [E1, E3] = -E2."""

    @property
    def dim(self) -> int:
        return 3

    @property
    def structure_constants(self) -> tuple:
        zero = (0.0, 0.0, 0.0)
        return (
            (zero, zero, zero),
            ((0.0, 0.0, -1.0), zero, (1.0, 0.0, 0.0)),
            ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), zero),
        )

    def hat(self, xi: lm.Vec) -> lm.Mat:
        return lm.mat(lm.vec(0.0, -xi[0], xi[1]), lm.vec(xi[0], 0.0, xi[2]), lm.vec(0.0, 0.0, 0.0))

    def vee(self, matrix: lm.Mat) -> lm.Vec:
        return lm.vec(matrix[1, 0], matrix[0, 2], matrix[1, 2])


@lm.record
class PlaneMotions(lm.LieGroup):
    """SE(2), the motions of the plane: not compact, its adjoint action not orthogonal, and without closed forms."""

    @property
    def algebra(self) -> PlaneAlgebra:
        return PlaneAlgebra()

    def identity(self) -> lm.Mat:
        return lm.SO3().identity()

    def inverse(self, g: lm.Element) -> lm.Mat:
        x, y = g[0, 2], g[1, 2]
        return lm.mat(
            lm.vec(g[0, 0], g[1, 0], -(g[0, 0] * x + g[1, 0] * y)),
            lm.vec(g[0, 1], g[1, 1], -(g[0, 1] * x + g[1, 1] * y)),
            lm.vec(0.0, 0.0, 1.0),
        )

    def exp(self, xi: lm.Vec) -> lm.Mat:
        w = xi[0]
        s, v = (sin(w) / w, 2.0 * sin(0.5 * w) * sin(0.5 * w) / w) if w != 0.0 else (1.0, 0.0)
        x, y = s * xi[1] - v * xi[2], v * xi[1] + s * xi[2]
        return lm.mat(lm.vec(cos(w), -sin(w), x), lm.vec(sin(w), cos(w), y), lm.vec(0.0, 0.0, 1.0))

    def Ad(self, g: lm.Element, xi: lm.Vec) -> lm.Vec:
        return lm.vec(
            xi[0],
            g[0, 0] * xi[1] + g[0, 1] * xi[2] + g[1, 2] * xi[0],
            g[1, 0] * xi[1] + g[1, 1] * xi[2] - g[0, 2] * xi[0],
        )


@lm.record
class Relativistic(lm.SeparableSystem):
    """A relativistic particle in an anharmonic well: T is not quadratic, and no derivative is written."""

    degrees: ClassVar[int] = 2
    c: float = 2.0

    def kinetic(self, p: lm.Vec) -> float:
        return self.c * sqrt(self.c * self.c + p @ p)

    def potential(self, q: lm.Vec) -> float:
        return 0.5 * (q @ q) + 0.1 * q[0] ** 4


@lm.record
class Oscillator(lm.SeparableSystem):
    """H = (p^2 + w^2 q^2)/2."""

    degrees: ClassVar[int] = 1
    w: float

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * p[0] * p[0]

    def potential(self, q: lm.Vec) -> float:
        return 0.5 * self.w * self.w * q[0] * q[0]


@lm.record
class Charged(lm.CotangentSystem):
    """A heavy charged body about a fixed point, in a magnetic field along the vertical."""

    configurations: ClassVar[lm.LieGroup] = lm.SO3()

    inertia: lm.Vec
    charge: lm.Mat
    weight: lm.Vec
    field: float

    def energy(self, mu: lm.Vec, g: Any) -> float:
        u = mu - (0.5 * self.field) * (self.charge @ g[2])
        return 0.5 * lm.dot(u, u / self.inertia) + lm.dot(self.weight, g[2])

    def symmetry(self, mu: Any, g: Any) -> dict[str, Any]:
        return {"vertical momentum": self.spatial_momentum(mu, g)[..., 2]}


# ---------------------------------------------------------------- what a few files share


@lm.record
class Ball(lm.SeparableSystem):
    """A ball above a floor."""

    degrees: ClassVar[int] = 1
    g: float

    def kinetic(self, p: Any) -> Any:
        return lm.dot(p, p) / 2.0

    def potential(self, q: Any) -> Any:
        return self.g * q[0]


@lm.record
class Pendulum(lm.SeparableSystem):
    degrees: ClassVar[int] = 1

    def kinetic(self, p: Any) -> Any:
        return lm.dot(p, p) / 2.0

    def potential(self, q: Any) -> Any:
        return -lm.formulas.cos(q[0])


@lm.record
class Powers(lm.LinearGroupEquation):
    """x' = t^n on the line."""

    power: int

    def drive(self, t):
        return vec(t**self.power)


@lm.record
class PointFixed(lm.Constraint):
    """The point `at` of a body on SE(3) stays in the origin."""

    at: lm.Vec

    def value(self, g):
        return lm.vec(*[g[i, 3] + lm.dot(lm.vec(g[i, 0], g[i, 1], g[i, 2]), self.at) for i in range(3)])


@lm.record
class Rolling(lm.VelocityConstraint):
    """A ball on a plane, on SO(3) x R^2: the centre moves with v = w x r e3, w seen from space."""

    radius: float

    def matrix(self, g):
        r = self.radius
        return lm.mat(lm.vec(-r * g[3], -r * g[4], -r * g[5], 1.0, 0.0), lm.vec(r * g[0], r * g[1], r * g[2], 0.0, 1.0))


@lm.record
class Slope(lm.VelocityConstraint):
    """The nonholonomic particle, z' = y x'."""

    def matrix(self, g):
        return lm.mat(lm.vec(-g[1], 0.0, 1.0))


@lm.record
class Spring(lm.Term):
    """Two masses that are held together, without a length of rest."""

    k: float

    def energy(self, a: Any, b: Any) -> float:
        d = a.g - b.g
        return 0.5 * self.k * lm.dot(d, d)


WORLDS = pytest.mark.parametrize(
    "compiled", [False, pytest.param(True, marks=pytest.mark.compiled)], ids=["plain", "compiled"]
)
