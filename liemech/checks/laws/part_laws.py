"""The laws of motions that are written: of vector fields, of their parts, and of parts of the
energy of constrained systems.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from ...errors import NotDefined
from ...formulas import Vec, derivative, vec
from ...rooms.constraints.constrained_parts import ConstrainedPart, SplitConstrainedSystem
from ...systems.vector_field import RecognisedField, SplitField, VectorField, has_flow
from ..points.sample_points import flat, size
from ..points.sample_states import AtState
from .law import Law, Same, axiom, factors, vanishes

CLOSE = 512.0
"""Roundings per dimension of a closed form and its derivative."""

FIELDS: list[Law] = []
CONSTRAINED_PARTS: list[Law] = []


def _motion(flow: Callable[[float], Vec], rate: Callable[[Vec], Vec], y: Vec, pace: float) -> Iterator[Same]:
    """The laws of a motion: it begins at y, and follows its velocity at several times of both signs."""
    yield Same(flow(0.0), y, size(y))
    for t in (0.0, 0.1, -0.1, 0.7):
        point = flow(t / (pace or 1.0))
        velocity, change = rate(point), derivative(flow, t / (pace or 1.0))
        scale = size(velocity) + size(change) + (size(y) + size(point)) * (pace or 1.0)
        yield Same(change, velocity, scale, partial(factors, flat(velocity)))


def on_manifold(system: Any, q: Vec, p: Vec) -> Iterator[Same]:
    """g(q) = 0 and G(q) H_p = 0."""
    G, v = system.constraint_jacobian(q), system.velocity(q, p)
    yield vanishes(system.constraint(q), size(G) * size(q))
    yield vanishes(G @ v, size(G) * size(v))


@axiom(FIELDS, "flow", "flow(y, 0) = y, d/dt flow = f(flow), of the field and of its parts", optional=True, slack=CLOSE)
def flows(system: VectorField, at: AtState) -> Iterator[Same]:
    parts = system.parts if isinstance(system, SplitField) else (system,)
    written = [part for part in parts if has_flow(part) and not isinstance(part, RecognisedField)]
    if not written:
        raise NotDefined("no motion is written")
    y = at.state.y
    for part in written:
        yield from _motion(partial(part.flow, y), part.velocity, y, at.pace)


@axiom(CONSTRAINED_PARTS, "parts stay on M", "G dH_i/dp = 0 where g = 0 and G H_p = 0", slack=CLOSE)
def parts_stay(system: SplitConstrainedSystem, at: AtState) -> Iterator[Same]:
    q, p = at.state.q, at.state.p
    G = system.constraint_jacobian(q)
    for part in system.parts:
        v = part.velocity(q, p)
        scale = size(G) * (size(v) + size(system.velocity(q, p)))
        yield vanishes(G @ v, scale)


@axiom(
    CONSTRAINED_PARTS,
    "motions of parts",
    "flow begins at (q, p), follows H_i on M, and stays there",
    optional=True,
    slack=CLOSE,
)
def motions(system: SplitConstrainedSystem, at: AtState) -> Iterator[Same]:
    n = system.degrees
    q, p = at.state.q, at.state.p
    written = [
        (number, part) for number, part in enumerate(system.parts) if type(part).flow is not ConstrainedPart.flow
    ]
    if not written:
        raise NotDefined("no motion is written")

    def flow(part: Any, t: float) -> Vec:
        position, after = part.flow(system, q, p, t)
        return vec(*position, *after)

    def rate(number: int, y: Vec) -> Vec:
        return system.rate_of_part(number, vec(*[y[i] for i in range(n)]), vec(*[y[n + i] for i in range(n)]))

    for number, part in written:
        yield from _motion(partial(flow, part), partial(rate, number), vec(*q, *p), at.pace)
        yield from on_manifold(system, *part.flow(system, q, p, 0.5 / (at.pace or 1.0)))
