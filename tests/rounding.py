"""Rounding, measured: what single steps lose against the same steps in more digits, and what long runs lose.

`python tests/rounding.py --write` puts the table into docs/proof/measured/orders.md; `--print` only shows
it.  Every step of a run in double precision is made once more from where it began, in long doubles
(19 digits), by closed formulas written down here once more: the defect of energy and Casimir is
what this one step has rounded.  Its mean is the bias, the drift per step that remains when the
random walk is averaged out.
"""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from orders import replace
from scenes import Driven, seed_body

import liemech as lm

EPS = float(np.finfo(float).eps)
Wide = np.longdouble
HAS_MORE_DIGITS = np.finfo(Wide).eps < 1e-3 * EPS
Array = np.ndarray

# ---------------------------------------------------------------- vectors as columns: (3, n), in double or long double


def cross(a: Array, b: Array) -> Array:
    """a x b."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def dot(a: Array, b: Array) -> Array:
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def series(x: Array, first: int) -> Array:
    """sum_k (-x)^k/(2k + first)!, for angles up to 1.6."""
    terms = [1 / x.dtype.type(math.factorial(2 * k + first)) for k in range(12 if x.dtype == Wide else 9)]
    total = terms[-1] - 0 * x
    for term in reversed(terms[:-1]):
        total = term - x * total
    return total


@dataclass(frozen=True)
class Turn:
    """tau(x) = 1 + a X + b X^2 and its dual differential (dtau_x)* = f - d X + c X^2, X = hat(x):
    a, b and f, d, c of |x|^2.
    """

    way: Callable[[Array], tuple[Array, Array]]
    slope: Callable[[Array], tuple[Array | int, Array, Array | int]]

    def carried(self, x: Array, mu: Array) -> Array:
        """Ad*_tau(x) mu."""
        a, b = self.way(dot(x, x))
        w = cross(x, mu)
        return mu + (b * cross(x, w) - a * w)

    def pulled(self, x: Array, mu: Array) -> Array:
        """(dtau_x)* mu."""
        f, d, c = self.slope(dot(x, x))
        w = cross(x, mu)
        return f * mu + (c * cross(x, w) - d * w)

    def matrices(self, x: Array) -> Array:
        """tau(x), (n, 3, 3)."""
        a, b = self.way(dot(x, x))
        units = [np.repeat(np.eye(3, dtype=Wide)[:, i : i + 1], x.shape[1], axis=1) for i in range(3)]
        return np.stack([e + a * cross(x, e) + b * cross(x, cross(x, e)) for e in units], axis=1).transpose(2, 0, 1)


EXPONENTIAL = Turn(lambda x: (series(x, 1), series(x, 2)), lambda x: (1, series(x, 2), series(x, 3)))
CAYLEY_MAP = Turn(lambda x: (4 / (4 + x), 2 / (4 + x)), lambda x: (4 / (4 + x), 2 / (4 + x), 0))


def fixed(equation: Callable[..., Array], start: Array, *data: Array | Wide) -> Array:
    """The fixed point of a contraction that depends on data: in double precision first, then in long doubles."""
    x = start
    for digits, most in ((float, 60), (Wide, 30)):
        x, given = x.astype(digits), [d.astype(digits) for d in data]
        for _ in range(most):
            new = equation(x, *given)
            small = np.abs(new - x).max() <= 4 * np.finfo(digits).eps * np.abs(new).max()
            x = new
            if small:
                break
    return x


# ---------------------------------------------------------------- steps in more digits


@dataclass(frozen=True)
class Scene:
    """A free body, or a top if it has a weight; moments, weight, centre of mass, and a start."""

    moments: tuple[float, float, float]
    mu: tuple[float, float, float]
    weight: float = 0.0
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def system(self) -> lm.System:
        """The library's."""
        return lm.models.HeavyTop(self.moments, self.weight, self.centre) if self.weight else lm.RigidBody(self.moments)

    def energy(self, mu: Array, vertical: Array) -> Array:
        """mu . J^-1 mu/2 + w Gamma . c."""
        centre = wide(self.centre)
        return dot(mu, mu / wide(self.moments)) / 2 + self.weight * dot(vertical, centre * np.ones_like(vertical))

    def kick(self, vertical: Array) -> Array:
        """The torque w Gamma x c."""
        return self.weight * cross(vertical, wide(self.centre) * np.ones_like(vertical))


BODY = Scene((1.0, 1.6, 2.3), (0.6, -0.7, 0.9))
TOP = Scene((1.0, 1.0, 0.7), (0.4, -0.3, 1.9), 1.3, (0.0, 0.0, 0.8))
ATTITUDE = np.array(lm.SO3().exp(lm.vec(0.4, -0.7, 0.3)))


def wide(v: object) -> Array:
    """A column of long doubles."""
    return np.array(v, dtype=Wide).reshape(3, 1)


def algorithm_1(turn: Turn, h: Wide, moments: Array, mu: Array) -> Array:
    """x = h J^-1 (dtau_x)* mu."""
    return fixed(lambda x, h, J, mu: h * (turn.pulled(x, mu) / J), h * mu / moments, h, moments, mu)


def hamilton_jacobi_4(turn: Turn, h: Wide, moments: Array, mu: Array) -> Array:
    """x(p) = h v + (h^3/6) ds_3, p = (dtau_x)* mu; of a quadratic energy, by the formula for rotations."""

    def displacement(p: Array, h: Wide, J: Array) -> Array:
        v = p / J
        w = cross(p, v) / J
        third = (cross(v, w) + cross(w, p) / J) / 2
        if turn is CAYLEY_MAP:
            third = third + dot(p, v) * (v / J) + dot(v, v) * v
        return h * v + h * h * h / 6 * third

    p = fixed(lambda p, h, J, mu: turn.pulled(displacement(p, h, J), mu), mu, h, moments, mu)
    return displacement(p, h, moments)


def rkmk_4(turn: Turn, h: Wide, moments: Array, mu: Array) -> Array:
    """The classical Runge-Kutta method for Omega' = (1 + ad/2 + ad^2/12) xi."""

    def slope(x: Array) -> Array:
        v = turn.carried(x, mu) / moments
        w = cross(x, v)
        return v + w / 2 + cross(x, w) / 12

    a = mu / moments
    b = slope(h / 2 * a)
    c = slope(h / 2 * b)
    return h / 6 * (a + 2 * b + 2 * c + slope(h * c))


S = 1 / (4 - Wide(4) ** (Wide(1) / 3))
SUZUKI = (S, S, 1 - 4 * S, S, S)


@dataclass(frozen=True)
class Case:
    """A method of the library, and its step once more: displacements of substeps, between kicks if there is a field."""

    method: lm.Method
    turn: Turn
    displacement: Callable[[Turn, Wide, Array, Array], Array]
    shares: tuple[Wide, ...] = (Wide(1),)
    scene: Scene = BODY

    @property
    def name(self) -> str:
        """That of the method."""
        return self.method.name

    def step(self, h: float, mu: Array, vertical: Array) -> tuple[Array, Array, list[Array]]:
        """Momentum and vertical after a step, and the displacements; (3, n) long doubles."""
        moments, ways = wide(self.scene.moments), []
        for share in self.shares:
            part = share * Wide(h)
            mu = mu + part / 2 * self.scene.kick(vertical)
            x = self.displacement(self.turn, part, moments, mu)
            mu, vertical = self.turn.carried(x, mu), self.turn.carried(x, vertical)
            mu = mu + part / 2 * self.scene.kick(vertical)
            ways.append(x)
        return mu, vertical, ways

    def run(
        self, steps: int, h: float = 0.1, every: int = 1, compensated: bool | None = None, **start: Array
    ) -> lm.Trajectory:
        """A run of the library."""
        system = self.scene.system
        state = system.state(**({"mu": self.scene.mu, "g": ATTITUDE} | start))
        return lm.integrate(
            system, self.method, state, h=h, steps=steps, every=every, compensated=compensated, progress=False
        )


EXP, CAYLEY = lm.CovariantVariational(lm.Exponential()), lm.CovariantVariational(lm.Cayley())
CASES = (
    Case(EXP, EXPONENTIAL, algorithm_1),
    Case(CAYLEY, CAYLEY_MAP, algorithm_1),
    Case(lm.Composition(EXP, order=4), EXPONENTIAL, algorithm_1, SUZUKI),
    Case(lm.Composition(CAYLEY, order=4), CAYLEY_MAP, algorithm_1, SUZUKI),
    Case(lm.LiePoissonHamiltonJacobi(4, lm.Exponential()), EXPONENTIAL, hamilton_jacobi_4),
    Case(lm.LiePoissonHamiltonJacobi(4, lm.Cayley()), CAYLEY_MAP, hamilton_jacobi_4),
    Case(lm.LieVerlet(lm.Exponential()), EXPONENTIAL, algorithm_1, scene=TOP),
    Case(lm.RKMK(order=4), EXPONENTIAL, rkmk_4),
)


# ---------------------------------------------------------------- measurements


@dataclass(frozen=True)
class Rounding:
    """What the steps of a run have rounded, relative, in units of eps: means, standard errors of
    the means, and one step's size.
    """

    energy: float
    energy_error: float
    size: float
    casimir: float
    casimir_error: float
    attitude: float


def rounding(case: Case, steps: int, h: float = 0.1, compensated: bool | None = None, chunk: int = 4096) -> Rounding:
    """Every step of a run against the same step in long doubles."""
    run = case.run(steps, h, compensated=compensated)
    energies, casimirs, product = [], [], ATTITUDE.astype(Wide)
    for first in range(0, steps, chunk):
        last = min(first + chunk, steps)
        mu, vertical = (a[first : last + 1].T.astype(Wide) for a in (run.mu, run.g[:, 2]))
        after, upright, ways = case.step(h, mu[:, :-1], vertical[:, :-1])
        energy = case.scene.energy(after, upright)
        scale = EPS * np.abs(case.scene.energy(mu[:, :1], vertical[:, :1]))
        energies.append((case.scene.energy(mu[:, 1:], vertical[:, 1:]) - energy) / scale)
        casimirs.append(casimir(case.scene, mu[:, 1:], vertical[:, 1:]) - casimir(case.scene, after, upright))
        product = product @ whole_turn([case.turn.matrices(x) for x in ways])
    energy, other = (np.concatenate(parts).astype(float) for parts in (energies, casimirs))
    other = other / EPS / float(np.abs(casimir(case.scene, wide(run.mu[0]), wide(run.g[0, 2])))[0])
    attitude = float(np.abs(run.g[-1] - product).max())
    return Rounding(energy.mean(), error_of_mean(energy), energy.std(), other.mean(), error_of_mean(other), attitude)


def casimir(scene: Scene, mu: Array, vertical: Array) -> Array:
    """|mu|^2 of a body, mu . Gamma of a top."""
    return dot(mu, vertical) if scene.weight else dot(mu, mu)


def error_of_mean(values: Array, block: int = 1000) -> float:
    """The standard error of the mean of values that may be correlated within a block, as those of compensated sums are."""
    n = len(values) // block
    means = values[: n * block].reshape(n, block).mean(axis=1)
    return float(means.std() / np.sqrt(n - 1))


def whole_turn(substeps: list[Array]) -> Array:
    """The product of all steps, each the product of its substeps, by pairs."""
    g = functools.reduce(multiplied, substeps)
    while len(g) > 1:
        rest = g[-1:] if len(g) % 2 else g[:0]
        g = np.concatenate([multiplied(g[: len(g) // 2 * 2 : 2], g[1::2]), rest])
    return g[0]


def multiplied(a: Array, b: Array) -> Array:
    """Products of matrices, entry by entry: there is no fast routine for long doubles."""
    return np.stack(
        [np.stack([sum(a[:, i, k] * b[:, k, j] for k in range(3)) for j in range(3)], -1) for i in range(3)], -2
    )


WINDOW = np.kaiser(4096, 40.0)
"""Weights of a mean in which an oscillation of less than 300 steps is invisible, by 16 digits."""


def growth(case: Case, compensated: bool | None = None, h: float = 0.1, most: int = 1_000_000) -> tuple[float, Array]:
    """How the root mean square over 16 starts of the change of the mean energy grows with the
    steps: its exponent, and itself.
    """
    counts, rng = (np.unique(np.geomspace(most / 100, most, 9).round().astype(int)), np.random.default_rng(11))
    mu = starts(case.scene, rng)
    run, means = case.run(len(WINDOW), h, compensated=compensated, mu=mu), []
    done = len(WINDOW)
    for n in (0, *counts):
        if n:
            run = case.run(n - done, h, every=n - done, compensated=compensated, mu=run.mu[-1], g=run.g[-1])
            run = case.run(len(WINDOW), h, compensated=compensated, mu=run.mu[-1], g=run.g[-1])
            done = n + len(WINDOW)
        energy = case.scene.energy(*(a[1:].astype(Wide).reshape(-1, 3).T for a in (run.mu, run.g[:, :, 2])))
        means.append(WINDOW @ energy.reshape(-1, 16) / WINDOW.sum())
    change = np.array([(m - means[0]) / means[0] for m in means[1:]], dtype=float)
    rms = np.sqrt((change**2).mean(axis=1))
    return float(np.polyfit(np.log(counts), np.log(rms), 1)[0]), rms


def energy_walk(method: lm.Method, counts: Array, h: float = 0.1, **sums: object) -> tuple[Array, Array]:
    """After numbers of steps, root mean square over 16 free bodies: the change of the mean energy,
    and that of the energy itself.

    One run for all; the mean is taken over the steps that follow.  sums : `compensated` or
    `precision`, as for `integrate`.
    """
    windows = np.add.outer(np.concatenate([[0], counts]), np.arange(len(WINDOW)))
    times, back = np.unique(windows, return_inverse=True)
    start = BODY.system.state(starts(BODY, np.random.default_rng(11)))
    run = lm.integrate(
        BODY.system,
        method,
        start,
        h=h,
        steps=int(times[-1]),
        t_eval=h * times,
        progress=False,
        **sums,  # type: ignore[arg-type]
    )
    mu = run.mu.astype(Wide).reshape(-1, 3).T
    energy = BODY.energy(mu, 0 * mu).reshape(-1, 16)[back.reshape(windows.shape)]
    mean = np.einsum("k,nkb->nb", WINDOW, energy) / WINDOW.sum()
    changes = (mean[1:] - mean[0]) / mean[0], (energy[1:, 0] - energy[0, 0]) / energy[0, 0]
    of_mean, itself = (np.sqrt((x**2).mean(axis=1)).astype(float) for x in changes)
    return of_mean, itself


def starts(scene: Scene, rng: np.random.Generator) -> Array:
    """Sixteen momenta: of a body near its stable axes, half about each; of a top near its start."""
    near = np.array([scene.mu] * 16 if scene.weight else [[1.3, 0.0, 0.0], [0.0, 0.0, 1.3]] * 8)
    return near + 0.2 * rng.normal(size=(16, 3))


def casimir_drift(case: Case, steps: int, compensated: bool | None = None, h: float = 0.1) -> float:
    """The largest relative change of the Casimir."""
    run = case.run(steps, h, every=steps // 100, compensated=compensated)
    value = casimir(case.scene, *(a.astype(Wide).T for a in (run.mu, run.g[:, 2])))
    return float(np.abs(value / value[0] - 1).max())


def reversibility(case: Case, compensated: bool | None = None, h: float = 0.1, steps: int = 10_000) -> float:
    """How far from the start many steps forth and back lead."""
    there = case.run(steps, h, every=steps, compensated=compensated)
    back = case.run(steps, -h, every=steps, compensated=compensated, mu=there.mu[-1], g=there.g[-1])
    return float(max(np.abs(back.mu[-1] - there.mu[0]).max(), np.abs(back.g[-1] - there.g[0]).max()))


def spatial_drift(case: Case, steps: int, compensated: bool | None = None, h: float = 0.1) -> tuple[float, float]:
    """The largest changes of what the space sees, the momentum (of a top its vertical part), and of g^T g."""
    run = case.run(steps, h, every=steps // 100, compensated=compensated)
    space = np.einsum("nij,nj->ni", run.g, run.mu)[:, 2 if case.scene.weight else slice(None)]
    size = np.linalg.norm(run.mu[0])
    return float(np.abs(space - space[0]).max() / size), float(
        np.abs(np.swapaxes(run.g, 1, 2) @ run.g - np.eye(3)).max()
    )


def driven_attitude(
    compensated: bool | None = None, steps: int = 1_000_000, h: float = 0.1, chunk: int = 4096
) -> float:
    """The error of an attitude that turns at a given varying rate: against the product of the same
    turns in long doubles.
    """
    system, product = Driven(lm.SO3()), ATTITUDE.astype(Wide)
    start = system.state(ATTITUDE)
    run = lm.integrate(
        system, lm.Magnus(2), start, h=h, steps=steps, every=steps, compensated=compensated, progress=False
    )
    for first in range(0, steps, chunk):
        t = h * np.arange(first, min(first + chunk, steps)) + 0.5 * h
        x = h * np.array([1.0 / (1.0 + t), np.sin(2.0 * t), np.cos(t) * np.cos(t)])
        product = product @ whole_turn([EXPONENTIAL.matrices(x.astype(Wide))])
    return float(np.abs(run.g[-1] - product).max())


def offset(method: lm.Method, delta: float = 1e-12, steps: int = 1_000_000, **sums: object) -> float:
    """The offset from the middle axis of the article's body that explains the mean time between its
    flips; 16 starts with another.

    From an offset d along another axis they come every 2K/rate = 4 log(4/(sqrt(2) d)); far below
    rounding d is what rounding adds.
    sums : `compensated` or `precision`, as for `integrate`.
    """
    body, _ = seed_body()
    mu = np.tile([0.0, 1.0, 0.0], (16, 1))
    mu[0::2, 0] = mu[1::2, 2] = delta * np.linspace(0.95, 1.05, 8) * np.resize([1.0, -1.0], 8)
    run = lm.integrate(body, method, body.state(mu), h=0.1, steps=steps, every=10, progress=False, **sums)  # type: ignore[arg-type]
    flips = [np.flatnonzero(np.diff(np.sign(y))) for y in run.mu[:, :, 1].T]
    between = np.mean([(f[-1] - f[0]) / (len(f) - 1) for f in flips])
    return float(8.0**0.5 * np.exp(-between / 4.0))


# ---------------------------------------------------------------- the table

STEPS = 200_000
"""Steps, or substeps, of which every one is made once more."""

HEAD = (
    "| method | sums | energy a step, 10^-3 eps | Casimir | 10^7 steps | energy grows like | there "
    "and back | momentum in space | g^T g |"
)


def line(choice: tuple[int, bool]) -> str:
    """A row: a method with the sums it has by default (for those that are not symmetric, on
    demand), or with ordinary ones.
    """
    case, plain = CASES[choice[0]], choice[1]
    compensated = False if plain else None if case.method.symmetric else True
    one = rounding(case, STEPS // len(case.shares), compensated=compensated)
    power = f"N^{growth(case, compensated)[0]:.2f}" if case.method.symmetric else "drifts"
    back = f"{reversibility(case, compensated):.1e}" if case.method.symmetric else ""
    space, unit = spatial_drift(case, 1_000_000, compensated)
    cells = (
        case.name, "plain" if plain else "compensated", f"{1e3 * one.energy:.2f} ± {1e3 * one.energy_error:.2f}",
        f"{1e3 * one.casimir:.2f} ± {1e3 * one.casimir_error:.2f}", f"{casimir_drift(case, 10**7, compensated):.1e}",
        power, back, f"{space:.1e}", f"{unit:.1e}",
    )  # fmt: skip
    return f"| {' | '.join(cells)} |"


def text() -> str:
    """All rows, measured now."""
    with ProcessPoolExecutor() as pool:
        lines = pool.map(line, [(i, plain) for i in range(len(CASES)) for plain in (True, False)])
        return "\n".join((HEAD, "| --- " * (HEAD.count("|") - 1) + "|", *lines))


if __name__ == "__main__":
    found = text()
    print(found)
    if "--write" in sys.argv:
        replace(HEAD, found)
