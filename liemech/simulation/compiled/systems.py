"""An ensemble whose members have parameters of their own: as many systems, or methods, of one kind."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator
from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput
from ...formulas.classes.layouts import layout_of
from ...formulas.classes.of_each import Each
from ...formulas.classes.records import records_in, with_records
from ...formulas.classes.remembered import Remembered
from ...integrators.method import Method
from ...systems.many.energies import OfManySites
from ...systems.system import System

PARTS = {"t", "mu", "xi", "g", "q", "p", "y"}
"""Names of arguments: the time and parts of the state."""

MAKERS = ("state", "consistent")
"""Methods of these arguments that make states, and are no quantities."""


class OfBodies:
    """Systems or methods of one kind, one for each body of an ensemble; what does not depend on
    their parameters is that of the first.
    """

    called: ClassVar[str]

    def __init__(self, members: tuple[Any, ...]) -> None:
        self.members = members

    def __len__(self) -> int:
        return len(self.members)

    def __getitem__(self, body: int) -> Any:
        return self.members[body]

    def __iter__(self) -> Iterator[Any]:
        return iter(self.members)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "members":
            raise AttributeError(name)
        return getattr(self.members[0], name)

    def __repr__(self) -> str:
        return f"[{self.members[0]!r}, ... {len(self.members)} {self.called}]"

    @classmethod
    def from_list(cls, given: Any, kind: type, example: str) -> Any:
        """The systems or methods of a list, one for each body; None for other values."""
        if isinstance(given, OfBodies):
            return given
        if not isinstance(given, (list, tuple)):
            return None
        if not given or not all(isinstance(x, kind) for x in given):
            wrong = next((x for x in given if not isinstance(x, kind)), given)
            raise InvalidInput(
                f"integrate: several {cls.called} are a list such as [{example}, ...], one for each body; got {wrong!r}"
            )
        layout = layout_of(given[0])
        for i, other in enumerate(given):
            if layout_of(other) != layout:
                noun = cls.called.removesuffix("s")
                raise InvalidInput(
                    f"integrate: the {cls.called} of an ensemble differ in numbers only; {noun} {i},"
                    f" {other!r}, is of another kind than {noun} 0, {given[0]!r} (numbers are floats,"
                    " Vec and Mat; ints, texts and tuples are parts of the formulas)"
                )
        return cls(tuple(given))


class Methods(OfBodies):
    """Methods of one class and layout, one for each body."""

    called = "methods"


class Systems(OfBodies):
    """Systems of one class and layout, one for each body."""

    called = "systems"

    def __getattr__(self, name: str) -> Any:
        if name == "joint_space":
            raise InvalidInput(
                "Systems.joint_space: each body has its own; ask system[i].joint_space with the states of body i"
            )
        attribute = super().__getattr__(name)
        return self._by_member(name) if inspect.ismethod(attribute) and _is_quantity(attribute.__func__) else attribute

    def _by_member(self, name: str) -> Callable[..., np.ndarray]:
        """A method of the systems, for arrays (n, bodies, ...) and times, (n,) or (n, bodies)."""

        @functools.wraps(getattr(self.members[0], name))
        def of_all(*arrays: Any, **named: Any) -> Any:
            def of_body(i: int, x: Any) -> Any:
                return x[:, i] if np.ndim(x) > 1 else x

            return _beside(
                [
                    getattr(system, name)(
                        *(of_body(i, x) for x in arrays), **{key: of_body(i, x) for key, x in named.items()}
                    )
                    for i, system in enumerate(self.members)
                ]
            )

        return of_all

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The constants of every body, (n, bodies, ...)."""
        of_bodies = [s.constants({name: x[:, i] for name, x in states.items()}) for i, s in enumerate(self.members)]
        return {name: np.stack([constants[name] for constants in of_bodies], axis=1) for name in of_bodies[0]}


def _beside(values: list[Any]) -> Any:
    """The values of a quantity for each body beside one another, (n, bodies, ...), or several of them."""
    if isinstance(values[0], tuple):
        return tuple([_beside([*part]) for part in zip(*values, strict=True)])
    return np.stack(values, axis=1)


@functools.cache
def _is_quantity(method: Callable[..., Any]) -> bool:
    """Is a method a formula of time and parts of the state?"""
    arguments, name = {*inspect.signature(method).parameters} - {"self"}, method.__name__
    return name not in MAKERS and not name.startswith("_") and set() < arguments <= PARTS


def systems_of(given: Any) -> Systems | None:
    """The systems of a list, or of one with a parameter for each member; None for one system."""
    return Systems.from_list(_of_members(given), System, "RigidBody(...)")


def _of_members(system: Any) -> Any:
    """Systems of the members of an ensemble, if parameters are `each(values)`; else the value as given. Parameters of
    the edges and sites of one system stay.
    """
    if not isinstance(system, System) or _alike.get(system):
        return system
    varied = records_in(system, Each)
    if not varied or records_in(system, OfManySites):
        _alike.set(system, True)
        return system
    counts = sorted({len(x) for x in varied})
    if len(counts) > 1:
        raise InvalidInput(f"integrate: {system!r} has parameters for {counts[0]} members and for {counts[1]}")
    return [with_records(system, Each, [x.of(i) for x in varied]) for i in range(counts[0])]


_alike = Remembered()
"""Systems that all members of an ensemble have in common."""


def methods_of(given: Any) -> Methods | None:
    """The methods of a list, one for each body; None for one method."""
    return Methods.from_list(given, Method, "ReversibleController(...)")


def of_body(thing: Any, body: int) -> Any:
    """The system or the method of body i: the only one, or its own."""
    return thing[body] if isinstance(thing, OfBodies) else thing


def each_of(thing: Any) -> list[Any]:
    """All systems or methods in a list, a single one alone in it."""
    return [*thing] if isinstance(thing, OfBodies) else [thing]
