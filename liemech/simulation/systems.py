"""An ensemble whose members have parameters of their own: as many systems of one kind."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas.pytree import layout_of
from ..systems.system import System

BY_MEMBER = ("energy", "velocity", "momentum", "casimirs", "multipliers")
"""Quantities that depend on the parameters, of arrays (n, bodies, ...)."""


class Systems:
    """Systems of one kind, one for each body of an ensemble; what does not depend on their
    parameters is that of the first.
    """

    def __init__(self, systems: tuple[System, ...]) -> None:
        self.systems = systems

    def __len__(self) -> int:
        return len(self.systems)

    def __getitem__(self, body: int) -> System:
        return self.systems[body]

    def __iter__(self) -> Iterator[System]:
        return iter(self.systems)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "systems":
            raise AttributeError(name)
        return self._by_member(name) if name in BY_MEMBER else getattr(self.systems[0], name)

    def _by_member(self, name: str) -> Callable[..., np.ndarray]:
        """A method of the systems, for arrays (n, bodies, ...)."""

        @functools.wraps(getattr(self.systems[0], name))
        def of_all(*arrays: np.ndarray) -> np.ndarray:
            return np.stack(
                [getattr(s, name)(*(x[:, i] for x in arrays)) for i, s in enumerate(self.systems)],
                axis=1,
            )

        return of_all

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The constants of every body, (n, bodies, ...)."""
        found = [
            s.constants({name: x[:, i] for name, x in states.items()})
            for i, s in enumerate(self.systems)
        ]
        return {
            name: np.stack([constants[name] for constants in found], axis=1) for name in found[0]
        }

    def __repr__(self) -> str:
        return f"[{self.systems[0]!r}, ... {len(self.systems)} systems]"


def systems_of(given: Any) -> Systems | None:
    """The systems, if there are several."""
    if isinstance(given, Systems):
        return given
    if not isinstance(given, (list, tuple)):
        return None
    if not given or not all(isinstance(x, System) for x in given):
        wrong = next((x for x in given if not isinstance(x, System)), given)
        raise InvalidInput(
            "integrate: several systems are a list such as "
            f"[RigidBody(...), ...], one for each body; got {wrong!r}"
        )
    layout = layout_of(given[0])
    for i, other in enumerate(given):
        if layout_of(other) != layout:
            raise InvalidInput(
                f"integrate: the systems of an ensemble differ in numbers only; system {i}, "
                f"{other!r}, is of another kind than system 0, {given[0]!r}"
            )
    return Systems(tuple(given))
