"""Closed forms: what a class writes in place of a formula that follows must give what follows.

Which methods follow is marked where they are written (`formulas.derived`), so that no list of them
is needed here.
"""

from __future__ import annotations

import inspect
import itertools
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from ...errors import LiemechError, OutsideChart
from ...formulas import Record
from ...formulas.classes.derived import closed_forms
from ...formulas.classes.records import fields_of
from ...formulas.vectors import Mat, Vec
from ...groups.lie_algebra import LieAlgebra
from ...groups.lie_group import LieGroup
from ...groups.retractions import Retraction
from ..points.sample_points import flat
from .law import Law, Same, factors

CLOSE = 4096.0
"""Roundings per dimension: closed forms and derived ones round differently; a slip is larger by
far.
"""

NUDGE = 2.0**-26
"""A relative change of all arguments, by which is seen how they enlarge roundings."""

GROUPS = LieGroup, LieAlgebra, Retraction

Arguments = dict[str, tuple[Any, ...]]
"""Values to put in for an argument, by its name: one, or one after the other."""


def laws_of_closed_forms(
    owner: Any, arguments: Callable[[Any], Arguments], seen: Callable[[str], bool]
) -> Iterator[Law]:
    """A law for each closed form of a record, at points that have these arguments.

    seen : is a formula looked at by a law of its own?
    """
    for name, closed, follows in closed_forms(type(owner)):
        if not seen(name):
            yield Law(
                name,
                f"{type(owner).__name__}.{name} = what it stands for, {follows.__qualname__}",
                partial(_same, owner, closed, follows, arguments),
                optional=True,
                slack=CLOSE,
            )


def records_within(record: Any) -> Iterator[Any]:
    """A record, and those that it holds, once each; groups and retractions have checks of their own."""
    records: list[Any] = []
    waiting = [record]
    while waiting:
        item = waiting.pop(0)
        if type(item) is tuple:
            waiting.extend(item)
        elif isinstance(item, GROUPS) or any(item is other for other in records):
            continue
        elif isinstance(item, Record):
            records.append(item)
            waiting.extend(fields_of(item).values())
            yield item


def _same(
    owner: Any, closed: Any, follows: Any, arguments: Callable[[Any], Arguments], _: Any, at: Any
) -> Iterator[Same]:
    """The closed form beside the formula that it stands for, component by component, as their units may differ."""
    candidates = arguments(at)
    names = [
        name
        for name, parameter in list(inspect.signature(closed).parameters.items())[1:]
        if name in candidates or parameter.default is parameter.empty
    ]
    if not all(name in candidates for name in names):
        return
    for values in itertools.product(*(candidates[name] for name in names)):
        try:
            right = follows(owner, *values)
            flat(right)
        except (LiemechError, ArithmeticError, ValueError, TypeError):
            continue  # nothing to compare with: outside of its domain, or it bears no derivatives
        unit = _rounding(partial(follows, owner), values, flat(right))
        try:
            left = flat(closed(owner, *values))
        except OutsideChart:
            if getattr(at, "inside", True):
                raise
            continue  # behind the place where dexp is singular, to refuse is honest
        if isinstance(right, Mat) and left.shape == (len(right),):
            left = np.diag(left).ravel()  # a diagonal matrix is told by its diagonal
        if left.shape != unit.shape:
            yield Same(left, right)
            continue
        scaled = flat(right) / unit
        yield Same(left / unit, scaled, 1.0, lambda scaled=scaled: factors(scaled))  # type: ignore[misc]


def _rounding(f: Callable[..., Any], values: tuple[Any, ...], here: np.ndarray) -> np.ndarray:
    """To what roundings are relative, for each component: its size, and how fast it changes with
    the arguments.
    """
    sizes = np.abs(here)
    for signs in range(3):
        rng = np.random.default_rng(signs)
        try:
            with np.errstate(all="ignore"):
                nearby = flat(f(*(_nudged(value, rng) for value in values)))
        except Exception:  # at the edge of where it is defined
            continue
        change = np.abs(nearby - here) / NUDGE
        sizes = np.maximum(sizes, np.where(np.isfinite(change), change, 0.0))
    least = sizes.max(initial=0.0) * 2.0**-14  # a component that is zero rounds as the others do
    return np.where(sizes > least, sizes, least or 1.0)


def _nudged(value: Any, rng: np.random.Generator) -> Any:
    """A vector with all components changed a little; other values unchanged."""
    if isinstance(value, float):
        return value * (1.0 + NUDGE * rng.choice([-1.0, 1.0]))
    if isinstance(value, Vec):
        numbers = np.array(value, dtype=float)
        return Vec.of((numbers * (1.0 + NUDGE * rng.choice([-1.0, 1.0], numbers.size))).tolist())
    return value
