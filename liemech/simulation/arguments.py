"""Checks of the arguments of a run, before anything moves; a refusal names the argument and its value."""

from __future__ import annotations

import math
import os
import re
import sys
from collections.abc import Iterable
from datetime import timedelta
from typing import Any

import numpy as np

from ..errors import IncompatibleSystem, InconsistentState, InvalidInput, InvalidType, require, warn
from ..formulas import Vec, check_finite, real_array
from ..integrators.ending_at_jumps import distinct_times
from ..integrators.method import Method, home_of
from ..systems.system import State, System, member
from .checkpoint import ENDINGS, Checkpoint, require_ending

MOST = 2**53
"""Counts up to this are exact as floating-point numbers, and so are the times t0 + n h up to rounding."""


RTOL, ATOL = 1e-6, 1e-9
"""Tolerances of adaptive steps, if none are given."""

LOST = 1e-3
"""Part of a state that the default atol may be, and control three digits of it."""


def matching(system: Any, method: Any) -> None:
    if isinstance(system, Method) and isinstance(method, System):
        raise InvalidType("integrate: system and method are swapped; write integrate(system, method, start, ...)")
    require("integrate: method", method, Method, "a method such as RKMK(order=4)")
    require("integrate: system", system, System, "a system such as RigidBody([1.0, 1.5, 2.0])")
    try:
        method.require(system)
    except IncompatibleSystem as error:
        site = system.site_form  # which a method may accept, and not all sites as one body
        if site is None:
            raise
        try:
            method.require(site)
        except IncompatibleSystem:
            raise error from None


def started(system: Any, start: Any, record: Iterable[str] | None, t0: float = 0.0, own: Any = None) -> State:
    """The start of a run as formulas take it, with the parts that are recorded and those that they need."""
    return with_parts(system, system._written_out(known(system, start, t0, own)), record)


def known(system: Any, start: Any, t0: float = 0.0, own: Any = None) -> State:
    """The start, made by the system's `state`, where conditions change with time by that at t0.

    own : the systems of bodies that have one each, by whose parameters it is told which states there are.
    """
    if not isinstance(start, State):
        raise InvalidType(f"integrate: start must come from system.state(...); got {type(start).__name__}")
    if own is not None and start.bodies == len(own):
        return allowed(own, start, t0)
    if getattr(system, "rheonomic", False):
        system = system.at_time(t0)
    if not system._knows(start):
        try:
            start = system.state(**start.arrays)
        except TypeError:
            parts = ", ".join(start.arrays)
            raise InvalidType(
                f"integrate: start has {parts} and is of another kind of system than {system!r}"
            ) from None
    return start


def with_parts(system: Any, start: State, record: Iterable[str] | None) -> State:
    """The start with the parts that are recorded, and those that they need."""
    if record is None:
        return start
    least = [name for name, x in system.essential_part(start).parts.items() if x is not None]
    choices = " or ".join(dict.fromkeys(str(tuple(names)).replace("'", '"') for names in (least, [*start.parts])))
    try:
        recorded: tuple[Any, ...] = (record,) if isinstance(record, str) else tuple(record)
    except TypeError:
        raise InvalidType(f"integrate: record is {choices}; got {record!r}") from None
    named = {name for name in recorded if isinstance(name, str)}
    if not set(least) <= named <= set(start.parts) or not all(isinstance(name, str) for name in recorded):
        raise InvalidInput(
            f'integrate: record is {choices}, all else follows from them; or methods of the system such as "energy", and '
            f"functions of time and state; got {record!r}"
        )
    for name in recorded:
        if start.parts[name] is None:
            raise InvalidInput(f"integrate: record asks for {name}, but the start has none; give system.state a {name}")
    return type(start)(*(x if name in recorded else None for name, x in start.parts.items()))


def allowed(systems: Any, start: State, t0: float) -> State:
    """The start, refused where a body is no state of its own system."""
    for i, system in enumerate(systems):
        try:
            known(system, member(start, i), t0)
        except (InvalidInput, InconsistentState) as error:
            raise type(error)(f"integrate: body {i}: {error}") from None
    return start


def alike(method: Any) -> bool:
    """Whether the method owes its structure to steps of equal length."""
    return bool(method.symplectic or method.symmetric)


def chooses_steps(method: Any) -> bool:
    """Whether the method has an error estimate for choosing steps, and no structure to lose by it."""
    return bool(method.error_order) and not alike(method) and not behind(method)


def behind(method: Any) -> bool:
    """Whether the `trial` of the method is that of another step: a subclass has written `step` alone."""
    return not issubclass(home_of(method, "trial"), home_of(method, "step"))


def affordable_times(t0: float, h: float, steps: int) -> None:
    """Refuse steps that lead to no finite time, or that the time does not notice."""
    end = t0 + steps * h
    if not math.isfinite(end):
        raise InvalidInput(f"integrate: {steps} steps of h = {h:g} lead to t = {end}")
    latest = max(abs(t0), abs(end))
    if steps and latest + abs(h) == latest:
        smallest = np.spacing(latest)
        raise InvalidInput(
            f"integrate: h = {h:g} is lost beside t = {end:g}; the smallest useful step there is {smallest:.1e}"
        )


def large_enough(start: Any) -> None:
    """Warn of a start beside which the default atol is large: in its units no step has an error."""
    least = ATOL / LOST
    if not isinstance(start, State):
        return
    for x in vars(start).values():  # quickly
        if type(x) is Vec and (max(x) >= least or min(x) <= -least):
            return
    parts = [x for x in start.parts.values() if x is not None]
    if not all(np.abs(np.asarray(x)).max(initial=0.0) < least for x in parts):
        return
    size = max(float(np.abs(np.asarray(x)).max(initial=0.0)) for x in parts)
    if size > 0.0:
        warn(
            f"integrate: the largest number of the start is {size:.1e}, beside which the default "
            f"atol = {ATOL:g} controls less than three digits; give atol in its units, such as "
            f"{1e-3 * RTOL * size:.0e}",
            RuntimeWarning,
        )


def jumps(breaks: Any) -> tuple[float, ...]:
    """Times at which the velocity jumps."""
    if breaks is None:
        return ()
    listed = list(breaks) if hasattr(breaks, "__next__") else breaks
    not_empty = not isinstance(listed, (list, tuple)) or len(listed)
    array = np.atleast_1d(real_array(listed, "integrate: breaks")) if not_empty else np.empty(0)
    if array.ndim > 1:
        raise InvalidInput(f"integrate: breaks has shape {array.shape}; it is a list of times, (n,)")
    check_finite(array, "integrate: breaks")
    return distinct_times(array.tolist())


def names(record: Any) -> Any:
    """The parts of the state to record, as they were named."""
    if record is None or isinstance(record, str):
        return record
    try:
        return tuple(record)
    except TypeError:
        return record


def only_adaptive(method: Any, h: Any, **options: Any) -> None:
    """Refuse what has no adaptive steps.  options : those of adaptive steps."""
    options_given = {name: x for name, x in options.items() if x is not None}
    named = [name for name, x in options_given.items() if axes(x, name) == 0 or np.size(x)]
    if method.error_order and not alike(method) and behind(method) and (h is None or named):
        raise IncompatibleSystem(
            f"integrate: {type(method).__name__} writes a `step` of its own, and adaptive steps are the `trial` of "
            f"{home_of(method, 'trial').__name__}, which knows nothing of it. Write `trial` too, or give h and steps"
        )
    if h is not None and named and not chooses_steps(method):
        raise IncompatibleSystem(
            f"integrate: {method!r} makes no adaptive steps, and {named[0]} is for these; "
            f"leave out {' and '.join(named)} for steps of length h"
        )
    if alike(method):
        raise IncompatibleSystem(
            f"integrate: {method!r} keeps the structure because all its steps are alike, which an "
            "error control would spoil. Give h and steps; for adaptive steps take a method with "
            "an error estimate, such as RKMK(order=5)"
        )
    if not method.error_order:
        raise IncompatibleSystem(
            f"integrate: {method!r} has no error estimate to choose steps by. Give h and steps, or "
            "take a method with an embedded pair, such as RKMK(order=5)"
        )


def longest(value: Any) -> float:
    """The longest step, any if None."""
    value = math.inf if value is None or (isinstance(value, float) and value == math.inf) else real(value, "max_step")
    if not value > 0.0:
        raise InvalidInput(f"integrate: max_step must be positive; got {value:g}")
    return value


def step_length(h: Any) -> float:
    h = real(h, "h")
    if abs(h) < sys.float_info.min:
        raise InvalidInput(f"integrate: h = {h:g} is no step; it must not be zero, nor so small that 1/h overflows")
    return h


def step_lengths(h: Any) -> float | tuple[float, ...]:
    """The step of all bodies, or one for each."""
    if not isinstance(h, (list, tuple, np.ndarray)) or not axes(h, "h"):
        return step_length(h)
    array = real_array(h, "integrate: h")
    if array.ndim != 1 or not len(array):
        raise InvalidInput(f"integrate: h has shape {array.shape}; it is one number, or one for each body, (bodies,)")
    return tuple([step_length(x) for x in array.tolist()])


def tolerance(value: Any, name: str, default: float) -> float:
    value = default if value is None else real(value, name)
    if value < 0.0 or (name == "rtol" and value == 0.0):
        raise InvalidInput(f"integrate: {name} must be positive{'' if name == 'rtol' else ' or zero'}; got {value:g}")
    least = 100 * sys.float_info.epsilon
    if name == "rtol" and value < least:
        warn(f"integrate: rtol = {value:g} is below rounding; {least:.1e} is used", RuntimeWarning)
        return least
    return value


def times(t_eval: Any, t0: float, t_end: float) -> np.ndarray | None:
    if t_eval is None:
        return None
    times = np.array(real_array(t_eval, "integrate: t_eval"))
    if times.ndim != 1:
        raise InvalidInput(f"integrate: t_eval has shape {times.shape}; it is a list of times, (n,)")
    low, high = min(t0, t_end), max(t0, t_end)
    if len(times):
        early, late = (times[:-1], times[1:]) if t_end >= t0 else (times[1:], times[:-1])
        inside = low <= times.item(0) <= high and low <= times.item(-1) <= high
        if inside and np.count_nonzero(early <= late) == len(late):  # so are all between them
            return times
    check_finite(times, "integrate: t_eval")
    margin = 4.0 * sys.float_info.epsilon * max(abs(low), abs(high))
    outside = (times < low - margin) | (times > high + margin)
    if outside.any():
        raise InvalidInput(
            f"integrate: t_eval has t = {times[outside][0]:g}, which is not between {low:g} and {high:g}"
        )
    times = np.clip(times, low, high)
    if (np.diff(times) * (t_end - t0) < 0).any():
        raise InvalidInput("integrate: t_eval must be sorted in the direction of time")
    return times


def ends(t_end: Any, bodies: int) -> list[Any]:
    """The last time of each body of an ensemble, None if none was given."""
    if t_end is None or not axes(t_end, "t_end"):
        return [None if t_end is None else real(t_end, "t_end")] * bodies
    if np.shape(t_end) != (bodies,):
        raise InvalidInput(
            f"integrate: t_end has shape {np.shape(t_end)}; it is one time, or one for each of {bodies} bodies"
        )
    return [real(t, "t_end") for t in t_end]


def columns(t_eval: Any, bodies: int) -> list[Any]:
    """The times of samples of each body of an ensemble: of (n, bodies) a column, of (n,) all of them."""
    if t_eval is None:
        return [None] * bodies
    samples = np.array(real_array(t_eval, "integrate: t_eval"))
    if samples.ndim != 2:
        return [samples] * bodies
    if samples.shape[1] != bodies:
        raise InvalidInput(
            f"integrate: t_eval has shape {samples.shape}; it is (n,), or (n, {bodies}) with a column for each body"
        )
    return [*samples.T]


def first(values: Any, name: str) -> Any:
    """The value for the first body of an ensemble."""
    if np.ndim(values) != 1 or not len(values):
        raise InvalidInput(
            f"integrate: {name} has shape {np.shape(values)}; it is one number, or one for each body, (bodies,)"
        )
    return values[0]


def directions(name: str, given: Any, components: int) -> np.ndarray:
    """Directions of a state with N components as an array, (N,) or (N, k), checked."""
    array = real_array(given, f"Plan.tangent: {name}")
    if array.ndim not in (1, 2) or len(array) != components or not array.size:
        raise InvalidInput(
            f"Plan.tangent: {name} are directions of the state, of N = {components} components, (N,) or "
            f"(N, k); got shape {array.shape}"
        )
    check_finite(array, f"Plan.tangent: {name}")
    return array


def events(events: Any) -> tuple[Any, ...]:
    try:
        functions = (events,) if callable(events) else () if events is None else tuple(events)
    except TypeError:
        raise InvalidType(f"integrate: events are functions of t and state; got {events!r}") from None
    for event in functions:
        if not callable(event):
            raise InvalidType(f"integrate: events are functions of t and state; got {event!r}")
        terminal, direction = getattr(event, "terminal", None), getattr(event, "direction", 0.0)
        if terminal is not None and (not isinstance(terminal, (bool, np.bool_, int, np.integer)) or terminal < 0):
            expected = "True, False, or the number of its zeros at which the run ends"
            raise InvalidInput(f"integrate: the `terminal` of an event is {expected}; got {terminal!r}")
        if isinstance(direction, bool) or not isinstance(direction, (int, float, np.number)) or direction != direction:
            raise InvalidInput(f"integrate: the `direction` of an event is +1, -1 or 0; got {direction!r}")
    return functions


def axes(value: Any, name: str) -> int:
    """Number of axes of a number or an array."""
    try:
        return np.ndim(value)
    except ValueError:
        raise InvalidInput(f"integrate: {name} is ragged: its rows have different lengths") from None


def real(value: Any, name: str) -> float:
    number = value
    if type(value) is not float:
        try:
            array = real_array(value, f"integrate: {name}")
        except InvalidType:
            array = None
        if array is None or array.ndim:
            raise InvalidType(f"integrate: {name} must be a number; got {value!r}")
        number = float(array)
    if not math.isfinite(number):
        raise InvalidInput(f"integrate: {name} must be finite; got {number}")
    return number


def parameters(by: Any, caller: str) -> tuple[str, ...]:
    """Names of what a derivative is taken by."""
    listed = (by,) if isinstance(by, str) else tuple(by) if isinstance(by, (list, tuple)) else (by,)
    if not listed or not all(isinstance(name, str) for name in listed):
        raise InvalidType(f'{caller}: by is "start", a parameter such as "inertia", or a list of these; got {by!r}')
    return listed


def known_parts(given: Any, parts: Any) -> None:
    """Refuse a cotangent by something that is no part of the state."""
    unknown = [name for name in given if name not in parts]
    if unknown:
        raise InvalidInput(
            f"Plan.pullback: cotangent has {unknown[0]!r}; the parts of the state are {', '.join(parts)}"
        )


def cotangent(given: Any, name: str, shape: tuple[int, ...], kinds: str) -> np.ndarray:
    """The derivatives by a part of the state, or by all of it where `name` is empty, checked.
    kinds : of NumPy's numbers that it may have.
    """
    what, array = f"cotangent[{name!r}]" if name else "cotangent", np.asarray(given)
    if array.shape != shape or array.dtype.kind not in kinds:
        raise InvalidInput(f"Plan.pullback: {what} is {shape}, as the samples are; got {array.shape} of {array.dtype}")
    if not np.isfinite(array).all():
        raise InvalidInput(f"Plan.pullback: {what} must be finite; got {array}")
    return array


def count(value: Any, name: str, least: int) -> int:
    if type(value) is int and least <= value <= MOST:
        return value
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise InvalidType(f"integrate: {name} must be a whole number; got {value!r}")
    if not least <= value <= MOST:
        raise InvalidInput(f"integrate: {name} must be at least {least} and at most 2**53; got {value}")
    return int(value)


def choice(value: Any, name: str) -> None:
    if not any(value is x for x in (True, False, None)):
        raise InvalidType(f"integrate: {name} must be True, False or None; got {value!r}")


def digits(precision: Any, compensated: Any) -> None:
    """The numbers of the steps are of one double or of two."""
    if precision not in ("double", "double-double"):
        raise InvalidInput(f"integrate: precision is 'double' or 'double-double'; got {precision!r}")
    if precision == "double-double" and compensated is not None:
        raise InvalidInput("integrate: numbers of two doubles need no compensated sums; leave compensated out")


def checkpoint(path: Any, every: Any) -> Checkpoint:
    """The Checkpoint of these options, checked."""
    if (
        not isinstance(path, (str, os.PathLike))
        or not os.path.isdir(os.path.dirname(os.fspath(path)) or ".")
        or (os.path.exists(path) and not os.path.isfile(path))
    ):
        raise InvalidInput(f"integrate: checkpoint is the name of a file in a folder that exists; got {path!r}")
    require_ending(path, ENDINGS)
    if isinstance(every, str):
        match = re.fullmatch(r"\s*([0-9]+(?:_[0-9]+)*)[\s_]*steps?\s*", every)
        if match is None:
            raise InvalidInput(
                f"integrate: checkpoint_every is a number of seconds, or a text such as '1000 steps'; got {every!r}"
            )
        return Checkpoint(path, 0.0, count(int(match[1]), "checkpoint_every", 1))
    if isinstance(every, timedelta):
        every = every.total_seconds()
    seconds = real(every, "checkpoint_every")
    if seconds < 0.0:
        raise InvalidInput(f"integrate: checkpoint_every is a number of seconds; got {seconds:g}")
    return Checkpoint(path, seconds)


ROUNDING = 1e-9
"""Part of a step by which a last time may miss the end of one: more than rounding of h and t_end makes of it."""


def fixed_steps(steps: int | None, t_end: float | None, t0: float, before: int, h: Any) -> int:
    """The number of steps of length h, checked together with the times they lead to."""
    if t_end is not None:
        if steps is not None:
            raise InvalidInput("integrate: give steps or t_end for fixed steps, not both")
        span = (real(t_end, "t_end") - t0) / h - before
        steps = round(span)
        if steps < 0 or abs(span - steps) > ROUNDING * max(1, before + steps):
            n = max(1, math.ceil(abs(span)))
            fits = (t_end - t0 - before * h) / n
            raise InvalidInput(
                f"integrate: {span:g} steps of h = {h:g} lead to t_end = {t_end:g}; fixed "
                f"steps end there with h = {fits!r}, {n} of them"
                if fits
                else f"integrate: t_end = {t_end:g} is the start"
            )
    elif steps is None:
        raise InvalidInput("integrate: give h and steps, for fixed steps, or t_end, for adaptive ones")
    steps = count(steps, "steps", 0)
    for length in {min(h, key=abs), max(h, key=abs)} if isinstance(h, tuple) else (h,):
        affordable_times(t0, length, before + steps)
    return steps
