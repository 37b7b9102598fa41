"""The laws of an action of a group on a space."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...errors import NotDefined
from ...formulas import Vec
from ...groups.coadjoint import CoadjointAction
from ..points.sample_points import STEP, At, size, slope
from .closed_forms import Arguments
from .group_laws import gradients
from .law import Law, Same, axiom, factors, shaped

ACTION: list[Law] = []


@axiom(ACTION, "moved points", "g . x is an array of finite numbers, shaped as x is")
def moved_points(action: Any, at: At) -> Iterator[Same]:
    x = np.asarray(at.point)
    for g in (at.g, at.h, at.group.compose(at.g, at.h), at.back):
        moved = np.asarray(action.act(g, at.point))
        yield from shaped(moved, x.shape)


@axiom(ACTION, "neutral element", "e . x = x")
def acts_neutrally(action: Any, at: At) -> Iterator[Same]:
    yield Same(action.act(at.group.identity(), at.point), at.point, size(at.point))


@axiom(ACTION, "compatibility", "(g h) . x = g . (h . x)")
def compatibility(action: Any, at: At) -> Iterator[Same]:
    g, h, x = at.g, at.h, at.point
    scale = at.share(g, h) * (size(x) + size(action.act(g, x)) + size(action.act(h, x)))
    backwards = "it is a right action; g^-1 in place of g makes it a left one"
    yield Same(
        action.act(at.group.compose(g, h), x),
        action.act(g, action.act(h, x)),
        scale,
        lambda: {backwards: action.act(h, action.act(g, x))},
    )


@axiom(ACTION, "infinitesimal action", "infinitesimal(xi, x) = d/ds exp(s xi) . x at s = 0")
def infinitesimal_action(action: Any, at: At) -> Iterator[Same]:
    rate = slope(lambda s: action.act(at.group.exp(s * at.eta), at.point))
    yield Same(
        action.infinitesimal(at.eta, at.point), rate, (size(at.point) + size(rate)) / STEP, lambda: factors(rate)
    )


@axiom(ACTION, "exp_act", "exp_act(xi, x) = exp(xi) . x", optional=True)
def exp_act(action: Any, at: At) -> Iterator[Same]:
    moved = action.act(at.g, at.point)
    scale = at.share(at.g) * (size(at.point) + size(moved)) * (1.0 + at.length)
    yield Same(
        action.exp_act(at.xi, at.point), moved, scale, lambda: {"a wrong sign of xi": action.act(at.back, at.point)}
    )


@axiom(ACTION, "points stay", "defect(g . x) = 0", optional=True)
def points_stay(action: Any, at: At) -> Iterator[Same]:
    yield Same(action.defect(action.act(at.g, at.point)), 0.0, at.share(at.g, at.back) * (1.0 + at.length))


@axiom(ACTION, "Casimirs of momenta", "casimirs(g . x) = casimirs(x)", optional=True)
def casimirs_of_momenta(action: Any, at: At) -> Iterator[Same]:
    if not isinstance(action, CoadjointAction):
        raise NotDefined("points are no momenta")
    moved = action.act(at.g, at.point)
    change = sum(size(gradients(action.casimirs, mu)) for mu in (at.point, moved))
    scale = change * (size(at.point) + size(moved)) * at.condition
    yield Same(action.casimirs(moved), action.casimirs(at.point), scale)


def arguments(at: At) -> Arguments:
    """Values for the arguments of an action's formulas, by their names; covectors are named p."""
    covector = np.random.default_rng(at.dim).normal(size=np.shape(at.point))
    by_name = {"g": at.g, "xi": at.xi, "x": at.point, "p": Vec.of(covector.ravel().tolist())}
    return {name: (value,) for name, value in by_name.items()}


def named(formula: str) -> bool:
    """Whether a law of its own looks at a formula."""
    return formula in ("infinitesimal", "exp_act")
