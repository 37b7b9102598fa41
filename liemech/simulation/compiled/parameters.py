"""Parameters of systems by their names, and the numbers of native code that they are."""

from __future__ import annotations

import functools
import inspect
import re
import struct
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import Record
from ...formulas.classes.layouts import Layout, build, gatherer, layout_of, leaves
from ...formulas.tables import Table
from ...systems.lie_poisson import LiePoissonSystem

named: Callable[[Any], tuple[str, ...]] = functools.cache(lambda kind: tuple(inspect.signature(kind).parameters))
"""The names of what a class of records is made with."""


def parameter(system: Any, name: str, caller: str = "Plan.tangent") -> Any:
    """The value of a parameter, such as "inertia", "hamiltonian.rotor" or "forces.0.torque".
    caller : who asks, for messages.
    """
    for part in name.split("."):
        fields = arguments_of(system) if isinstance(system, Record) else {}
        if part in fields:
            system = fields[part]
        elif type(system) in (tuple, list) and part.isdigit() and int(part) < len(system):
            system = system[int(part)]
        else:
            names = ", ".join(fields) or "none"
            others = ", and the start; of the method method.name, and the step h" if caller == "Plan.tangent" else ""
            raise InvalidInput(f"{caller}: {part} is no parameter of {system!r}; there are {names}{others}")
    return system


def arguments_of(system: Record) -> dict[str, Any]:
    """The arguments that make a record, by name; without a Lagrangian for which the Hamiltonian stands in."""
    values = {name: getattr(system, name) for name in named(type(system))}
    if isinstance(system, LiePoissonSystem) and values.get("lagrangian") == values.get("hamiltonian"):
        values.pop("lagrangian", None)
    return values


def with_parameter(system: Any, name: str, value: Any) -> Any:
    """This system, made with another value of a parameter."""
    first, _, inner = name.partition(".")
    if type(system) in (tuple, list):
        others = [*system]
        others[int(first)] = with_parameter(others[int(first)], inner, value) if inner else value
        return type(system)(others)
    fields = arguments_of(system)
    fields[first] = with_parameter(fields[first], inner, value) if inner else value
    return type(system)(**fields)


def parameters(system: Any, before: str = "") -> Iterator[str]:
    """The names of all parameters that have numbers, of a system and of the records in it."""
    if isinstance(system, Record):
        inner = [*arguments_of(system).items()]
    else:
        inner = [(str(i), x) for i, x in enumerate(system)]
    for name, value in inner:
        if layout_of(value).width:
            yield before + name
        if isinstance(value, Record) or (type(value) in (tuple, list) and value):
            yield from parameters(value, f"{before}{name}.")


def full_name(system: Any, name: str, caller: str) -> str:
    """The full name of a parameter: given whole, by its end if there is only one such, or as a linkage names those of
    its joints, "elbow.torque".  Raises InvalidInput.
    """
    names = [*dict.fromkeys(parameters(system))]
    if name in names:
        return name
    at_joint = getattr(system, "parameter_of_joint", None)
    matches = [x for x in names if x.endswith(f".{name}")]
    if at_joint is not None:
        matches = at_joint(name) or matches
    if len(matches) == 1:
        return str(matches[0])
    if matches:
        raise InvalidInput(f"{caller}: {name} may be {' or '.join(matches)}; give the longer name")
    last, first_alike = name.rpartition(".")[2], {}  # type: str, dict[str, str]
    for x in names:
        first_alike.setdefault(re.sub(r"\d+", "0", x), x)
    near = [x for x in names if x.rpartition(".")[2] == last] or [*first_alike.values()]
    raise InvalidInput(
        f"{caller}: {name} is no parameter of {type(system).__name__} that has numbers; there are {', '.join(near)}"
    )


class Input:
    """A parameter of a system that may change between steps.

    name : the full one.  places : where its numbers are among those of the system, at one place or
    more; None if the system is to be made anew, because other numbers follow from this one, or
    because its class looks at what it is given.
    """

    def __init__(self, system: Any, name: str, caller: str) -> None:
        self.name, self.caller = name, caller
        if system.noisy:
            raise InvalidInput(f"{caller}: {name} of a system with noise is no input: the noise would begin anew")
        self.layout = layout_of(parameter(system, name, caller))
        self.whole = layout_of(system)
        self.width, self.gather = self.layout.width, gatherer(self.layout)
        self.shape = shape_of(self.layout)
        self.places = places_of(system, name, self.layout)
        self.pack = struct.Struct(f"{self.width}d").pack_into

    def numbers(self, value: Any) -> list[float]:
        """The numbers of a value, checked.  Raises InvalidInput."""
        if self.shape is None:
            if layout_of(value) != self.layout:
                raise InvalidInput(
                    f"{self.caller}: {self.name} is a {self.layout!r:.200}; got {value!r}, which is laid out otherwise"
                )
            return self.gather(value)
        try:
            array = value if type(value) is np.ndarray else np.array(value, dtype=float)
            numbers: list[float] = array.ravel().tolist()
            for x in numbers:
                if x - x != 0.0:  # not finite
                    raise InvalidInput(f"{self.caller}: {self.name} must be finite; got {value!r}")
        except (TypeError, ValueError) as error:
            if isinstance(error, InvalidInput):
                raise
            raise InvalidInput(f"{self.caller}: {self.name} is {in_words(self.shape)}; got {value!r}") from None
        if array.shape != self.shape:
            raise InvalidInput(f"{self.caller}: {self.name} is {in_words(self.shape)}; got shape {array.shape}")
        return numbers

    def columns(self, value: Any, bodies: int) -> np.ndarray:
        """The numbers of a value for all bodies, or of one for each, (width, bodies) or (width, 1)."""
        if self.shape is None:
            each = value if type(value) is list and len(value) == bodies else [value]
            return np.array([self.numbers(member) for member in each]).T
        array = np.asarray(value)
        if array.shape != (bodies, *self.shape):
            if array.ndim > len(self.shape):
                raise InvalidInput(
                    f"{self.caller}: {self.name} of {bodies} bodies is {in_words(self.shape)}, for all "
                    f"or with a leading axis of {bodies}; got shape {array.shape}"
                )
            return np.array(self.numbers(value))[:, None]
        array = array.astype(float).reshape(bodies, -1).T
        if not np.isfinite(array).all():
            wrong = int(np.flatnonzero(~np.isfinite(array).all(axis=0))[0])
            raise InvalidInput(
                f"{self.caller}: {self.name} must be finite; body {wrong} has {array[:, wrong].tolist()}"
            )
        return array

    def value(self, numbers: Any) -> Any:
        """The value of the parameter that has these numbers."""
        return build(self.layout, iter([float(x) for x in numbers]))

    def in_system(self, system: Any, numbers: Any) -> Any:
        """The system with this value; refused if its layout changes."""
        changed = with_parameter(system, self.name, self.value(numbers))
        if layout_of(changed) != self.whole:
            raise InvalidInput(
                f"{self.caller}: with {self.name} = {self.value(numbers)!r} the system is one of "
                "another kind; make a plan of it"
            )
        return changed


def shape_of(layout: Layout) -> tuple[int, ...] | None:
    """The shape of a number, a vector or a matrix; None for a record."""
    if layout.kind == "number":
        return ()
    if layout.only_numbers and layout.kind == "vec":
        return (len(layout.parts),)
    if layout.kind == "mat":
        return len(layout.parts), len(layout.parts[0].parts)
    return None


def in_words(shape: tuple[int, ...]) -> str:
    """A shape in words, for error messages."""
    return f"of shape {shape}" if shape else "a number"


# ------------------------------------------------------------------ where the numbers are


def places_of(system: Any, name: str, layout: Layout) -> tuple[int, ...] | None:
    """Offsets of a parameter among the numbers of the system, found by trying other values; None if others change
    with it, or if one of them is refused.
    """
    value, whole = parameter(system, name), layout_of(system)
    before, offsets = np.array(leaves(system, whole)), None
    for scale, shift in ((0.731, 0.0), (-1.318, 1.0), (0.0, 0.0), (1e6, 3.0)):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                other = tried(value, scale, shift)
                changed = with_parameter(system, name, other)
            if layout_of(changed) != whole or layout_of(other) != layout:
                return None
        except Exception:
            return None
        numbers, after = np.array(leaves(other, layout)), np.array(leaves(changed, whole))
        if offsets is None:
            windows = np.lib.stride_tricks.sliding_window_view(after, len(numbers))
            old = np.array(leaves(value, layout))
            offsets = [
                int(i) for i in np.flatnonzero((windows == numbers).all(axis=1))
                if (before[i : i + len(numbers)] == old).all()
            ]  # fmt: skip
        covered = before.copy()
        for i in offsets:
            covered[i : i + len(numbers)] = numbers
        agree = (covered == after) | (np.isnan(covered) & np.isnan(after))
        if not offsets or not agree.all():
            return None
    return tuple(offsets or ())


def tried(value: Any, scale: float, shift: float) -> Any:
    """Another value of the same kind, all of whose numbers differ."""
    if isinstance(value, float):
        return scale * (value or 1.0) + 0.577 * shift
    if layout_of(value).kind in ("vec", "mat"):
        array = np.array(value)
        steps = 1.0 + 0.0131 * np.arange(array.size).reshape(array.shape)
        large = float(np.abs(array).max()) or 1.0
        other = scale * large * steps + shift * 0.1 * large * steps**2
        return build(layout_of(value), iter(other.ravel().tolist()))
    if isinstance(value, Table):
        array = np.asarray(value)
        return Table(array * (1.0 + abs(scale)))
    if isinstance(value, Record):
        return type(value)(**{n: tried(getattr(value, n), scale, shift) for n in named(type(value))})
    if type(value) in (tuple, list):
        return type(value)([tried(x, scale, shift) for x in value])
    return value
