"""Batch least squares over tangent maps: the start of a motion without noise, and parameters of its
system, from measurements along it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import IncompatibleSystem, InvalidInput
from ..formulas.classes.frozen import frozen
from ..groups.composed.product import ProductGroup
from ..groups.vector_space import VectorSpace
from ..rooms.constraints.constrained import ConstrainedSystem
from ..rooms.constraints.constrained_body import BoundBody
from ..rooms.derivatives.frames import Frames, group_of
from ..simulation.compiled.parameters import parameter, with_parameter
from ..simulation.plan import Plan
from .block_tridiagonal import ALMOST
from .least_squares import minimise
from .sensors import Sensor
from .smoothing import Mover, believed, half_squares, observed, over


@frozen(eq=False)
class Fit:
    """The start and the parameters that fit measurements best.

    start : the state.  parameters : by name.  covariance : of the errors of all, those of the start
    first, in the order of the columns of the tangent map.  run : the motion.
    chi2 : the sum of squared residuals in their units; excess : how many more residuals than unknowns.
    """

    start: Any
    parameters: dict[str, np.ndarray]
    covariance: np.ndarray
    run: Any
    chi2: float
    excess: int
    steps: int

    @property
    def deviations(self) -> np.ndarray:
        """The standard deviations of all unknowns."""
        return np.sqrt(np.diagonal(self.covariance))


def phase_space(system: Any, start: Any) -> Any:
    """The group of the states of a system, of which sensors for `fit` measure elements: a vector space
    for momenta and canonical variables, the group for g, in the order of the state; of one part alone
    that group.

    Raises IncompatibleSystem for states on a surface, such as those of a pendulum.
    """
    factors: list[Any] = []
    sizes = Frames(system, start).sizes
    bound = isinstance(system, (ConstrainedSystem, BoundBody))
    for name, part in start.arrays.items():
        if name == "g":
            factors.append(group_of(system))
        elif not bound and part.ndim == 1 and sizes[name] == len(part):
            factors.append(VectorSpace(len(part)))
        else:
            raise IncompatibleSystem(
                f"phase_space: {name} of a {type(system).__name__} is not free to move in every "
                "direction; fit it with scipy.optimize.least_squares and Plan.tangent"
            )
    return factors[0] if len(factors) == 1 else ProductGroup(*factors)


def fit(
    plan: Plan,
    start: Any,
    observations: Sequence[tuple[Sensor, Any, Any]],
    by: Sequence[str] = ("start",),
    prior: Any = None,
    tolerance: float = 1e-12,
    iterations: int = 50,
) -> Fit:
    """The start, and the parameters named, whose motion fits all measurements best: the minimum of
    sum |residuals|^2_R by Levenberg-Marquardt steps, with the exact derivative of the discrete motion
    (`Plan.tangent`).

    plan : with fixed steps.  start : a state to begin with.
    observations : of each sensor, on `phase_space(system, start)`, after which steps it measured,
        whole numbers, (m,), and what, (m, ...).
    by : "start", and parameters of the system such as "inertia"; what a sensor measures may not
        depend on these.
    prior : a Belief of the start, on the same group.

    Raises InvalidInput where something is not determined, and NoConvergence.

    Source: Tapley, Schutz, Born, Statistical Orbit Determination (2004), section 4.3; Nocedal and
    Wright, Numerical Optimization, 2nd ed., section 10.3.
    """
    plan, system = plan.replace(every=1, record=None), plan.system
    space = phase_space(system, start)
    names = (by,) if isinstance(by, str) else tuple(by)
    if not names or names[0] != "start":
        raise InvalidInput(f'fit: by begins with "start"; got {by!r}')
    sights = [observed("fit", space, "left", None, i, *each) for i, each in enumerate(observations)]
    if not sights:
        raise InvalidInput("fit: there are no observations")
    last = max(int(at.max(initial=0)) for _, at, _ in sights)
    if prior is not None:
        sights.append(believed("fit", space, "left", prior))
    values = {name: np.asarray(parameter(system, name), dtype=float) for name in names[1:]}
    mover, dim, parts = Mover(space, "left"), space.dim, [*start.arrays]

    def linear(x: Any, before: Any) -> tuple[float, float, Any]:
        g, numbers = x
        run = _plan(plan, numbers).tangent(_state(space, start, g), steps=max(last, 1), by=list(names))
        path = _element(space, {name: getattr(run, name) for name in parts})
        T = np.concatenate([run.tangent[name] for name in names], axis=2)
        A, b = np.zeros((T.shape[2], T.shape[2])), np.zeros(T.shape[2])
        weights: list[Any] = []
        squares: list[Any] = []
        for sight, at, z in sights:
            r, H, R = sight.factors(path[at], z)
            J = H @ T[at]
            RJ, Rr = over("fit", R, type(sight.sensor).__name__, J, r[..., None])
            A += np.einsum("kmi,kmj->ij", J, RJ)
            b += np.einsum("kmi,km->i", J, Rr[..., 0])
            weights.append(R)
            squares.append(r)
        comparable = half_squares(squares, weights if before is None else before[3])
        return comparable, half_squares(squares, weights), (A, b, run, weights)

    def step(problem: Any, damping: float) -> tuple[np.ndarray, float]:
        A, b, *_ = problem
        diagonal = np.diagonal(A)
        size = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        scaled = A / size[:, None] / size + damping * np.eye(len(A))
        if not damping and np.linalg.cond(scaled) > 1.0 / ALMOST:
            _, vectors = np.linalg.eigh(scaled)
            loose = vectors[:, 0] / size
            raise InvalidInput(
                f"fit: the measurements do not determine the unknowns ({', '.join(names)}) along "
                f"{np.round(loose / np.abs(loose).max(), 3).tolist()}; give a prior, or fit fewer"
            )
        d = -np.linalg.solve(scaled, b / size) / size
        return d, float(0.5 * d @ (damping * size * size * d - b))

    def move(x: Any, d: np.ndarray) -> Any:
        g, numbers = x
        at, moved = dim, {}
        for name, value in numbers.items():
            moved[name] = value + d[at : at + value.size].reshape(value.shape)
            at += value.size
        return mover.moved(g, d[:dim]), moved

    (g, numbers), (A, _, run, _), cost, steps = minimise(
        "fit", (_element(space, start.arrays), values), linear, step, move, tolerance, iterations
    )
    residuals = sum(len(at) * len(sight.sensor.deviation) for sight, at, _ in sights)
    return Fit(_state(space, start, g), numbers, np.linalg.inv(A), run, 2.0 * cost, residuals - len(A), steps)


def _plan(plan: Plan, numbers: dict[str, np.ndarray]) -> Plan:
    """The plan for a system with other parameters."""
    system = plan.system
    for name, value in numbers.items():
        system = with_parameter(system, name, value if value.ndim else float(value))
    return plan.replace(system=system) if numbers else plan


def _element(space: Any, parts: dict[str, Any]) -> Any:
    arrays = [np.asarray(part) for part in parts.values()]
    return np.asarray(space.join(*arrays)) if len(arrays) > 1 else arrays[0]


def _state(space: Any, start: Any, g: Any) -> Any:
    names = [*start.arrays]
    parts = space.split(g) if len(names) > 1 else (g,)
    return dataclasses.replace(start, **dict(zip(names, parts)))
