"""Samples of functions of the state: energies, angles, distances, kept instead of the state, in
memory for themselves alone.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..compiler.driver import attempt, reason
from ..errors import IntegrationInterrupted, InvalidInput, InvalidType, failure, is_mistake
from ..formulas import Record
from ..formulas.classes.frozen import frozen
from ..formulas.classes.layouts import layout_of
from ..formulas.vectors import small
from ..systems.system import State
from .between.dense import evaluated, flat, observe
from .reports.drift import RECORDED
from .trajectory import Trajectory, part_with_sites

COMPUTED = *RECORDED, "multipliers"
"""Quantities that a run computes from its samples, unless they were kept."""

PLAIN = ("number", "vec", "mat")
"""Kinds of values that a function may return."""


@frozen(eq=False)
class Recorder:
    """The content of each sample: parts of the state, and quantities by name.

    quantities : methods of the system, by their names, or functions of time and state.
    chosen : parts of the state that are kept of some sites only, and which.
    """

    parts: tuple[str, ...]
    quantities: dict[str, str | Callable[[float, Any], Any]]
    chosen: dict[str, tuple[int, ...]] = dataclasses.field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all arrays of a sample, parts of the state first."""
        return *self.parts, *self.observed

    @property
    def observed(self) -> tuple[str, ...]:
        """Names of the arrays that are kept instead of parts of the state."""
        return *self.quantities, *self.chosen

    @property
    def sites(self) -> list[int] | None:
        """The sites of which states are kept; None for all."""
        return None if self.parts or not self.chosen else sorted({*sum(self.chosen.values(), ())})

    def of_chosen(self, system: Any, name: str, array: np.ndarray) -> np.ndarray:
        """A part of the states at the chosen sites, (n, sites, ...), from that of all."""
        of_sites = system.by_site({name: array})[name]
        return part_with_sites(system, name, of_sites)[:, [*self.chosen[name]]]

    def needed(self, whole: Any, system: Any, start: Any) -> tuple[str, ...] | None:
        """The parts of the state that a run must have: for a function of the state all that there are.
        whole : the system, whose methods are recorded; system : of what moves, itself or one site.
        """
        if not isinstance(start, State):
            return None
        if not all(isinstance(q, str) for q in self.quantities.values()):
            return tuple(dict.fromkeys([*start.arrays, *self.parts, *self.chosen]))
        names = [name for name, x in system.essential_part(start).parts.items() if x is not None]
        for quantity in self.quantities.values():
            formula = getattr(whole, str(quantity))
            parts = [name for name in inspect.signature(formula).parameters if name != "t"]
            if not set(parts) <= set(start.parts):
                raise InvalidInput(
                    f"integrate: record={quantity!r} is a formula of {', '.join(parts)}, not of "
                    f"the state, which is {', '.join(start.parts)}; "
                    "record a function of time and state"
                )
            names += [part for part in parts if part != "t"]
        return tuple(dict.fromkeys([*names, *self.parts, *self.chosen]))

    # ---------------------------------------------------------------- what is kept

    def values(
        self, run: Any, kind: Any, t: np.ndarray, states: dict[str, np.ndarray], compiled: Any
    ) -> dict[str, np.ndarray]:
        """The recorded values at samples (n, ...), of an ensemble (n, bodies, ...).  kind : of state.

        An error of a function has, as `kept`, the number of samples before the one at which it failed,
        and the values there.
        """
        try:
            return self._values(run, kind, t, states, compiled)
        except (Exception, KeyboardInterrupt) as caught:
            error: Any = caught
            if isinstance(caught, KeyboardInterrupt):
                error = IntegrationInterrupted(
                    f"integrate: interrupted while {', '.join(self.quantities)} were computed; "
                    "the samples before are in `.trajectory`"
                )
            n = getattr(caught, "row", 0) // (run.bodies or 1)
            before = {name: x[:n] for name, x in states.items()}
            error.kept = n, self._values(run, kind, t[:n], before, compiled)
            raise error from error.__cause__

    def _values(
        self, run: Any, kind: Any, t: np.ndarray, states: dict[str, np.ndarray], compiled: Any
    ) -> dict[str, np.ndarray]:
        values = {name: states[name] for name in self.parts}
        each = run.bodies and t.ndim == 1  # of an ensemble, whose bodies share the times
        users = {name: part_with_sites(run.system, name, x, 2 + bool(run.bodies)) for name, x in states.items()}
        inputs = {"t": np.broadcast_to(t[:, None], (len(t), run.bodies)) if each else t, **users}
        for name in self.chosen:
            values[name] = self.of_chosen(run.system, name, states[name])
        for name, quantity in self.quantities.items():
            if isinstance(quantity, str):
                values[name] = of_method(run.system, quantity, inputs)
            elif len(t):
                values[name] = self._of_function(name, quantity, kind, t, states, run.bodies, compiled)
            else:
                values[name] = np.empty(0)
        return values

    def _of_function(
        self,
        name: str,
        function: Any,
        kind: Any,
        t: np.ndarray,
        states: dict[str, np.ndarray],
        bodies: int | None,
        compiled: Any,
    ) -> np.ndarray:
        """A function of time and state at every sample."""
        lead, at = ((len(t),), (0,)) if bodies is None else ((len(t), bodies), (0, 0))
        first = kind(*[small(states[f.name][at]) if f.name in states else None for f in dataclasses.fields(kind)])
        result = self._result(name, function, float(np.ravel(t)[0]), first)
        parts = {part: states[part] for part in first.arrays}
        rows = np.column_stack([flat(parts, math.prod(lead)), t.ravel() if t.ndim == 2 else np.repeat(t, bodies or 1)])
        arguments = function, layout_of(first), layout_of(result)
        what = f"record={name!r}", lambda k: f"at t = {rows[k, -1]:g}"
        numbers = evaluated(observe, arguments, rows, np.size(result), compiled, what)
        return numbers.reshape(*lead, *np.shape(result))

    def _result(self, name: str, function: Any, t: float, state: Any) -> Any:
        """The value of a function at the first sample, checked; the layout of all others is its own."""
        result = attempt(function, t, state)
        if hasattr(result, "error"):
            error: Any = reason(result)
            raise (error if is_mistake(error) else failure(error, f"record={name!r}", f"at t = {t:g}"))
        if layout_of(result).kind not in PLAIN or np.array(result).dtype != float:
            raise InvalidType(
                f"integrate: record={name!r} gives a number (a float), a liemech.vec(...) or a "
                f"liemech.mat(...); got {result!r}"
            )
        return result


def of_method(system: Any, name: str, inputs: dict[str, Any]) -> np.ndarray:
    """The values of a method of the system, of the parts of states that it asks for."""
    formula = getattr(system, name)
    return np.asarray(formula(*(inputs[part] for part in inspect.signature(formula).parameters)))


# ------------------------------------------------------------------ what a user asks for


def recorder_of(record: Any, system: Any) -> Recorder | None:
    """The Recorder of `record=`; None if that names parts of the state only.

    record : names of parts of the state and of methods of the system, functions of time and state,
    pairs of a name and such a function, pairs of a part and the numbers of sites.
    """
    items = (record,) if isinstance(record, str) or callable(record) else record if isinstance(record, tuple) else ()
    parts: list[str] = []
    quantities: dict[str, Any] = {}
    chosen: dict[str, tuple[int, ...]] = {}
    for item in items:
        name, quantity = item if isinstance(item, tuple) and len(item) == 2 else (item, item)
        if isinstance(quantity, str):
            is_method = inspect.ismethod(getattr(system, quantity, None)) and quantity not in ("state", "constants")
            if is_method:
                quantities[name] = quantity
            else:
                parts.append(quantity)
            continue
        if isinstance(quantity, (list, range, np.ndarray, dict)) and isinstance(name, str):
            chosen[name] = numbers_of_sites(name, quantity, system)
            continue
        if not callable(quantity):
            return None  # to be refused with the parts there are
        if not isinstance(name, str):
            name = type(quantity).__name__ if isinstance(quantity, Record) else getattr(quantity, "__name__", "")
        if not name.isidentifier():
            raise InvalidInput(
                f'integrate: record has a function without a name, {quantity!r}; give it one: record=[("name", function), ...]'
            )
        quantities[name] = quantity
    for name in quantities:
        reserved = name in Trajectory.__dataclass_fields__ or (hasattr(Trajectory, name) and name not in COMPUTED)
        if reserved or [*parts, *quantities].count(name) > 1:
            raise InvalidInput(
                f"integrate: record: {name!r} is the name of something else of a run; give another "
                "one: [(name, function), ...]"
            )
    if [*parts, *chosen].count(next(iter({*parts} & {*chosen}), "")):
        raise InvalidInput("integrate: record has a part of the state twice, of all sites and of some")
    return Recorder(tuple(parts), quantities, chosen) if quantities or chosen else None


def numbers_of_sites(name: str, sites: Any, system: Any) -> tuple[int, ...]:
    """The numbers of the sites of which a part of the state is kept.  Raises InvalidInput."""
    numbers = np.asarray(sites)
    copies = getattr(getattr(system, "configurations", system.group), "copies", None)
    what = f"integrate: record=({name!r}, {sites!r})"
    if copies is None or system.site_form is None:
        raise InvalidInput(f"{what} names sites, which {system!r} has none of")
    if numbers.ndim != 1 or numbers.dtype.kind not in "iu" or not len(numbers):
        raise InvalidInput(f"{what} is for a list of the numbers of sites, those of all species in a row")
    wrong = numbers[(numbers < 0) | (numbers >= copies)]
    if len(wrong):
        raise InvalidInput(f"{what}: there is no site {wrong[0]}; the sites are 0 to {copies - 1}")
    return tuple(numbers.tolist())
