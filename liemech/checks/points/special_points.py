"""Derivatives where formulas branch: at zero, at equal components, along the axes.

A formula that asks whether a number is zero has the derivative of the branch that it takes there,
which need not be that of the function.  Random states never meet such a branch; these points do.
The first and second derivatives are compared with differences, which straddle the point.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from ...errors import NotDefined
from ...formulas import gradient, jacobian, vec
from ...rooms.poisson.poisson import PoissonSystem
from ...systems.canonical import CanonicalSystem
from ...systems.cotangent import CotangentSystem
from ...systems.lie_poisson import LiePoissonSystem
from ...systems.mechanical import MechanicalSystem
from ..laws.law import Law, Same, axiom
from .sample_points import LARGE, STEP, flat, size, slope
from .sample_states import AtState

CLOSE = 4096.0
"""Roundings per dimension, over those that differences enlarge."""

Function = Callable[[Any], Any]

SPECIAL: list[Law] = []


@axiom(
    SPECIAL,
    "derivatives at special points",
    "those of the energy at 0, at equal components and on the axes are what differences say",
    optional=True,
    once=True,
    slack=CLOSE,
)
def derivatives_at_special_points(system: Any, at: AtState) -> Iterator[Same]:
    energies = [*_energies(system, at)]
    if not energies:
        raise NotDefined("the system has no energy that this law knows")
    for energy, first, x, sign in energies:
        for point in special_points(x):
            yield from _derivatives(energy, first, point, sign)


def _energies(system: Any, at: AtState) -> Iterator[tuple[Function, Function, Any, float]]:
    """Energies as functions of one vector, their gradients, such a vector, and a sign."""
    state = at.state
    body = system.body if isinstance(system, MechanicalSystem) else system
    if isinstance(body, LiePoissonSystem):
        yield body.hamiltonian.energy, body.hamiltonian.gradient, state.mu, 1.0
    if isinstance(system, MechanicalSystem):
        group, V = system.configurations, system.potential
        places = (state.g, group.identity()) if len(flat(state.g)) == len(flat(group.identity())) else ()
        for g in places:
            energy = partial(_displaced, V, group, g)
            yield energy, partial(gradient, energy), state.mu / (size(state.mu) or 1.0), 1.0
    if isinstance(system, CotangentSystem):
        g = state.g
        yield (lambda x: system.energy(x, g)), (lambda x: system.velocity(x, g)), state.mu, 1.0
    if isinstance(system, CanonicalSystem) and not hasattr(system, "constraint"):
        q, p = state.q, state.p
        yield (lambda x: system.energy(x, p)), (lambda x: system.force(x, p)), q, -1.0
        yield (lambda x: system.energy(q, x)), (lambda x: system.velocity(q, x)), p, 1.0
    if isinstance(system, PoissonSystem):
        yield system.energy, system.gradient, state.y, 1.0


def _displaced(potential: Any, group: Any, g: Any, eta: Any) -> Any:
    """The potential at g exp(eta)."""
    return potential.energy(group.compose_exp(g, eta))


def _visited_axes(n: int) -> int:
    """The number of axes that are visited."""
    return n if n <= LARGE else LARGE // 2


def special_points(x: Any) -> Iterator[Any]:
    """Zero, equal components and the axes, of the size of x."""
    n, length = len(x), size(x) or 1.0
    yield vec(*[0.0] * n)
    yield vec(*[length / n**0.5] * n)
    for i in range(_visited_axes(n)):
        yield vec(*[length if j == i else 0.0 for j in range(n)])


def _derivatives(energy: Function, first: Function, x: Any, sign: float) -> Iterator[Same]:
    unit = STEP * (size(x) or 1.0)
    directions = [*np.eye(len(x))[: _visited_axes(len(x))]]

    def along(f: Function, d: np.ndarray) -> Callable[[float], Any]:
        return lambda s: f(vec(*(flat(x) + s * d).tolist()))

    def second(y: Any) -> Any:
        return [[row[k] for row in jacobian(first, y)] for k in range(len(directions))]

    lines = [along(energy, d) for d in directions]
    yield from _compared(lines, lambda: sign * flat(first(x))[: len(lines)], unit, x)
    yield from _compared([along(first, d) for d in directions], lambda: second(x), unit, x)


def _compared(
    lines: list[Callable[[float], Any]], derivative: Callable[[], Any], unit: float, point: Any
) -> Iterator[Same]:
    """The derivative along lines beside differences, where the function is smooth."""
    why = f"that of a branch for {', '.join(f'{c:.3g}' for c in point)} alone, or of another energy"
    differences = [_by_differences(line, unit) for line in lines]
    if all(difference is None for difference in differences):
        return
    try:
        derivatives = derivative()
    except TypeError:  # a formula that does not bear numbers with a derivative
        return
    for difference, x in zip(differences, derivatives, strict=True):
        if difference is not None and np.isfinite(flat(x)).all():
            yield Same(x, difference[0], (difference[1] + size(x)) / STEP, lambda x=x: {why: x})  # type: ignore[misc]


def _by_differences(f: Callable[[float], Any], unit: float) -> tuple[np.ndarray, float] | None:
    """The slope, and the size of its terms; None where f is not smooth or not defined."""
    try:
        with np.errstate(all="ignore"):
            middle, ahead, behind = (flat(f(s)) for s in (0.0, 0.01 * unit, -0.01 * unit))
            halves = [flat(f(s)) for s in (0.005 * unit, -0.005 * unit)]
            coarse, fine = slope(f, unit), slope(f, 0.5 * unit)
    except Exception:  # a point where a formula is not defined is no point of the function
        return None
    terms = size(middle) / unit + size(coarse)
    if not (np.isfinite(coarse).all() and np.isfinite(fine).all() and np.isfinite(middle).all()):
        return None
    kink = size(ahead - 2.0 * middle + behind) / (0.01 * unit)
    closer = size(halves[0] - 2.0 * middle + halves[1]) / (0.005 * unit)
    if closer > 0.75 * kink and kink > 1e-3 * terms:  # the slopes on both sides differ
        return None
    if size(coarse - fine) > 1e-9 * terms:  # too coarse for this function
        return None
    return fine, terms
