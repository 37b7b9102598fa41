"""Smoothing: the most likely path of a process, given all measurements of all times."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter
from typing import Any

import numpy as np

from ..errors import InvalidInput, InvalidType, require
from ..formulas import Ambient, Element, Mat, Record, Vec, mat, record, sqrt, transpose, vec
from ..formulas.arrays import real_array
from ..formulas.classes.frozen import frozen
from ..groups.lie_group import LieGroup
from .belief import Belief, checked
from .block_tridiagonal import BlockTridiagonal, require_digits
from .errors_of_elements import by_error, error, moved
from .filter import OfBeliefs
from .least_squares import minimise
from .processes import Process
from .sensors import Sensor, require_elements


@record
class ProcessLink(OfBeliefs):
    """The process between two neighbours.

    Source: Dellaert and Kaess, Factor Graphs for Robot Perception (2017), section 6.
    """

    process: Process
    side: str

    def factor(self, g: Element, next: Element, u: Vec, h: float) -> tuple[Any, Any, Any, Any]:
        """r = error of next from move(g), its derivatives by the errors of g and of next, and the covariance of r."""
        group, side, process = self.group, self.side, self.process

        def residual(a: Any, b: Any) -> Any:
            return error(group, side, process.led(a, u, h), b)

        A = by_error(group, side, g, lambda x: residual(x, next))
        B = by_error(group, side, next, lambda x: residual(g, x))
        L = process.by_noise(side, g, u, h)
        return residual(g, next), transpose(mat(*A)), transpose(mat(*B)), L @ L.T

    _space = property(lambda self: self.process)


@record
class Sight(OfBeliefs):
    """A measurement of one element."""

    sensor: Sensor
    side: str

    def factor(self, g: Element, z: Ambient) -> tuple[Any, Any, Any]:
        """r, its derivative by the error, and the covariance."""
        sensor = self.sensor
        slopes = by_error(self.group, self.side, g, lambda x: sensor.residual(x, z))
        return sensor.residual(g, z), transpose(mat(*slopes)), sensor.covariance(g)

    def factors(self, g: Any, z: Any) -> tuple[Any, Any, Any]:
        """Values for many elements; a single one goes by itself, which is quicker."""
        if len(g) != 1:
            return self.factor(g, z)
        r, H, R = self.factor(g[0], z[0])
        return r[None], H[None], R[None]

    _space = property(lambda self: self.sensor)


@record
class Prior(Sensor):
    """The belief about an element beforehand, as a measurement of it."""

    group: LieGroup
    P: Mat
    side: str

    @property
    def deviation(self) -> Vec:
        """The roots of the variances."""
        return vec(*[sqrt(self.P[i, i]) for i in range(len(self.P))])

    def residual(self, g: Element, z: Ambient) -> Vec:
        """The error of g, where z is the truth."""
        return error(self.group, self.side, g, z)

    def covariance(self, g: Element) -> Mat:
        """The covariance P, which is the same for all g."""
        return self.P

    @property
    def elements(self) -> LieGroup:
        """The group of the truth."""
        return self.group


@record
class Mover(Record):
    """Elements moved by errors.

    Source: Absil, Mahony, Sepulchre, Optimization Algorithms on Matrix Manifolds (2008), section 4.1.
    """

    group: LieGroup
    side: str

    def moved(self, g: Element, e: Vec) -> Element:
        """g exp(e), or exp(e) g."""
        return moved(self.group, self.side, g, e)

    _space = property(attrgetter("group"))


@frozen(eq=False)
class Smoothed:
    """The most likely path: g, (n + 1, ...), and the covariance of its error at each time.

    chi2 : the sum of squared residuals in their units; excess : how many more residuals than unknowns
    there are, its expected value where the noise is what was said.  steps : of the iteration.
    """

    path: Belief
    chi2: float
    excess: int
    steps: int

    @property
    def g(self) -> Any:
        """The elements, (n + 1, ...)."""
        return self.path.g

    @property
    def covariance(self) -> Any:
        """(n + 1, dim, dim) of the error at each time, given all measurements."""
        return self.path.covariance


def smooth(
    process: Process,
    prior: Belief | None,
    inputs: Any,
    h: Any,
    observations: Sequence[tuple[Sensor, Any, Any]],
    initial: Any = None,
    tolerance: float = 1e-12,
    iterations: int = 50,
) -> Smoothed:
    """The most likely path g_0, ..., g_n of a process, given all measurements: the minimum of

        |e_0|^2_P0 + sum_k |error of g_k+1 from move(g_k, u_k, 0, h_k)|^2_Qk + sum |residuals|^2_R,

    by Gauss-Newton steps in the algebra, damped where the cost would rise (Levenberg-Marquardt), whose
    normal equations are block tridiagonal.

    prior : of the first element; None, if measurements determine the path and `initial` is given.
    inputs : (n, inputs), of processes without any (n, 0).  h : s, or (n,) of each step.
    observations : of each sensor which times it measured, whole numbers from 0 to n, (m,), and what,
        (m, ...).
    initial : a path to begin with, (n + 1, ...); by default where the process leads from the prior.

    Raises InvalidInput where something is not determined, and NoConvergence.

    Source: Dellaert and Kaess, Factor Graphs for Robot Perception (2017), sections 2, 6; Barfoot, State
    Estimation for Robotics (2017), section 8.2.
    """
    group = process.group
    side = getattr(prior, "side", "left")
    u, times = _inputs(process, inputs, h)
    n = len(u)
    sights = [observed("smooth", group, side, n, number, *each) for number, each in enumerate(observations)]
    if prior is not None:
        sights = [believed("smooth", group, side, prior), *sights]
    if initial is not None:
        path = real_array(initial, "smooth: initial", group.is_complex)
        if path.shape != (n + 1, *group.element_shape):
            raise InvalidInput(f"smooth: initial has shape {path.shape}; it must be {(n + 1, *group.element_shape)}")
    elif prior is None:
        raise InvalidInput("smooth: without a prior give a path to begin with, initial=")
    else:
        path = led(process, prior.g, u, times)
    link, mover = ProcessLink(process, side), Mover(group, side)

    def linear(x: Any, before: Any) -> tuple[float, float, Any]:
        steps: Any = times  # a row for each link
        r, A, B, Q = link.factor(x[:-1], x[1:], u, steps)
        D, E = np.zeros((n + 1, group.dim, group.dim)), np.zeros((n, group.dim, group.dim))
        b = np.zeros((n + 1, group.dim))
        At, Bt = A.swapaxes(1, 2), B.swapaxes(1, 2)
        QA, QB, Qr = over("smooth", Q, "process", A, B, r[..., None])
        D[:-1] += At @ QA
        D[1:] += Bt @ QB
        E += Bt @ QA
        b[:-1] += (At @ Qr)[..., 0]
        b[1:] += (Bt @ Qr)[..., 0]
        weights, squares = [Q], [r]
        for sight, at, z in sights:
            r, H, R = sight.factors(x[at], z)
            Ht = H.swapaxes(1, 2)
            RH, Rr = over("smooth", R, type(sight.sensor).__name__, H, r[..., None])
            np.add.at(D, at, Ht @ RH)
            np.add.at(b, at, (Ht @ Rr)[..., 0])
            weights.append(R)
            squares.append(r)
        comparable = half_squares(squares, weights if before is None else before[3])
        return comparable, half_squares(squares, weights), (D, E, b, weights)

    def step(problem: Any, damping: float) -> tuple[np.ndarray, float]:
        D, E, b, _ = problem
        diagonal = np.einsum("kii->ki", D)
        damped = D + damping * (diagonal[..., None] * np.eye(group.dim)) if damping else D
        d = -_solver(damped, E).solve(b)
        return d, float(0.5 * np.sum(d * (damping * diagonal * d - b)))

    smoothed, (D, E, _, _), cost, steps = minimise("smooth", path, linear, step, mover.moved, tolerance, iterations)
    covariance = _solver(D, E).diagonal_of_inverse()
    residuals = n * group.dim + sum(len(s) * len(o.sensor.deviation) for o, s, _ in sights)
    return Smoothed(Belief(group, smoothed, covariance, side), 2.0 * cost, residuals - (n + 1) * group.dim, steps)


def led(process: Process, g: Any, u: np.ndarray, h: np.ndarray) -> np.ndarray:
    """The path along which a process leads from an element without noise, (n + 1, ...)."""
    path = [np.asarray(g)]
    for k in range(len(u)):
        path.append(process.led(path[-1], u[k], float(h[k])))
    return np.array(path)


def _inputs(process: Process, inputs: Any, h: Any) -> tuple[np.ndarray, np.ndarray]:
    u = real_array(inputs, "smooth: inputs")
    if u.ndim != 2 or u.shape[1] != process.inputs or not len(u):
        raise InvalidInput(f"smooth: inputs has shape {u.shape}; it must be (n, {process.inputs}), a row for each step")
    times = real_array(h, "smooth: h")
    if times.shape not in ((), (len(u),)) or not np.all(times > 0.0):
        raise InvalidInput(f"smooth: h is a positive step in s, or ({len(u)},) of them; got {h!r}")
    return u, np.broadcast_to(times, (len(u),)).copy()


def observed(
    whose: str, group: Any, side: str, n: Any, number: int, sensor: Any, steps: Any, z: Any
) -> tuple[Sight, np.ndarray, np.ndarray]:
    """A sensor, the times at which it measured, at most n, and what."""
    where = f"{whose}: observations[{number}]"
    if not isinstance(sensor, Sensor):
        raise InvalidType(f"{where} begins with a Sensor; got {sensor!r}")
    if sensor.group != group:
        raise InvalidInput(f"{where} measures {sensor.group!r}; the states are in {group!r}")
    at = np.atleast_1d(np.asarray(steps))
    whole = at.dtype.kind in "iu" and at.ndim == 1
    if not whole or at.min(initial=0) < 0 or (n is not None and at.max(initial=0) > n):
        most = "on" if n is None else f"to {n}"
        raise InvalidInput(f"{where}: times are whole numbers from 0 {most}; got {steps!r}")
    values = real_array(z, f"{where}: values", sensor._complex("Ambient"))
    if values.shape != (len(at), *sensor.value_shape):
        raise InvalidInput(f"{where}: values have shape {values.shape}; they must be {(len(at), *sensor.value_shape)}")
    require_elements(f"{where}: values", sensor, values)
    return Sight(sensor, side), at, values


def believed(whose: str, group: Any, side: str, prior: Any) -> tuple[Sight, np.ndarray, np.ndarray]:
    """The belief about the first element as a measurement of it."""
    where = f"{whose}: prior"
    require(where, prior, Belief, "a Belief, as `belief(g, covariance)` of a filter gives")
    if prior.group != group:
        raise InvalidInput(f"{where} is of {prior.group!r}; the states are in {group!r}")
    belief = checked(where, group, prior.g, prior.covariance, prior.side).seen_from(side)
    return Sight(Prior(group, belief.covariance, side), side), np.array([0]), belief.g[None]


def over(where: str, covariance: np.ndarray, whose: str, *right: np.ndarray) -> list[np.ndarray]:
    """Covariance^-1 times each of these."""
    try:
        roots = np.diagonal(np.linalg.cholesky(covariance), axis1=-2, axis2=-1)
        require_digits(roots, np.diagonal(covariance, axis1=-2, axis2=-1))
        solved = np.linalg.solve(covariance, np.concatenate(right, axis=-1))
    except np.linalg.LinAlgError:
        raise InvalidInput(
            f"{where}: the covariance of the noise of the {whose} is singular: give every direction of "
            "its error some noise"
        ) from None
    return np.split(solved, np.cumsum([a.shape[-1] for a in right])[:-1], axis=-1)


def half_squares(residuals: list[np.ndarray], covariances: list[np.ndarray]) -> float:
    """|r|^2/2 in units of their deviations."""
    pairs = zip(residuals, covariances)
    return 0.5 * sum(float(np.sum(r * np.linalg.solve(C, r[..., None])[..., 0])) for r, C in pairs)


def _solver(D: np.ndarray, E: np.ndarray) -> BlockTridiagonal:
    try:
        return BlockTridiagonal(D, E)
    except np.linalg.LinAlgError:
        raise InvalidInput(
            "smooth: the measurements do not determine the path, or the noise of a step is so small beside what "
            "they leave open that rounding decides; give a prior, more of them, or fewer and longer steps"
        ) from None
