"""What several test files share: bodies, methods, and ways to measure."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence

import numpy as np

import liemech as lm

SEED_INERTIA, SEED_MU = (2 / 3, 1.0, 2.0), (0.5, 0.0, 0.75**0.5)

RKMK4 = lm.RKMK(order=4)
EXP = lm.CovariantVariational(lm.Exponential())
CAYLEY = lm.CovariantVariational(lm.Cayley())
METHODS = (RKMK4, EXP, CAYLEY)


def named(method: lm.Method) -> str:
    """For the names of tests."""
    return method.name


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
    """The largest error of momentum and of attitude on the way to t_end, against the exact motion, for numbers of steps."""
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
