"""States of many sites as rows of numbers, a place in every row for each site."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....simulation.between.dense import unpacked
from ....systems.canonical import CanonicalState
from ....systems.lie_poisson import BodyState
from ....systems.many.site_state import NoisySites, SitePoints, SiteState, SiteValues, StateOfSites
from ....systems.system import State, small_state, state_of
from ...noise.stochastic import NoisyState
from ...poisson.poisson import PoissonState

OF_ONE: dict[Any, type[State]] = {
    SiteState: BodyState,
    NoisySites: NoisyState,
    SitePoints: CanonicalState,
    SiteValues: PoissonState,
}
"""What the state of one site is, by the kind of those of all."""


def by_site(system: Any, start: Any) -> StateOfSites:
    """A state as users give it, with an axis of sites."""
    if isinstance(start, StateOfSites):
        return start
    arrays = system.by_site(start.arrays)
    return state_of(kind_of(arrays), arrays)


def as_users_see(system: Any, state: Any) -> Any:
    """A state with an axis of sites, in the shape that users give it; the inverse of `by_site`."""
    arrays = state.arrays
    user_arrays = system.as_users_see(arrays)
    if user_arrays is arrays:
        return state
    return (
        small_state(one_of(user_arrays), user_arrays)
        if state.bodies is None
        else state_of(one_of(user_arrays), user_arrays)
    )


def one_of(arrays: Any) -> type[State]:
    """The kind of states of a body, a point, that have these parts."""
    return OF_ONE[kind_of(arrays)]


def kind_of(states: Any) -> Any:
    """The kind of states that has these parts."""
    if "path" in states:
        return NoisySites
    return SiteState if "mu" in states else SiteValues if "y" in states else SitePoints


def first_of(start: StateOfSites) -> Any:
    """The state of the first site, as formulas take it."""
    several = start.bodies is not None
    first = {name: x[0, 0] if several else x[0] for name, x in start.arrays.items()}
    return small_state(OF_ONE[type(start)], first)


def site_rows(state: Any) -> np.ndarray:
    """The numbers of the states of all sites, (width, sites)."""
    rows = []
    for x in state.arrays.values():
        flat = np.ascontiguousarray(x).reshape(len(x), -1)
        rows.append((flat.view(float) if np.iscomplexobj(flat) else flat).T)
    return np.concatenate(rows)


def state_of_rows(shown: Any, rows: np.ndarray) -> Any:
    """States of sites from their numbers, (width, sites)."""
    arrays = unpacked(shown, rows.T)
    return state_of(kind_of(arrays), arrays)
