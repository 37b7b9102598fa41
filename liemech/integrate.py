"""`integrate`: the border of the one loop, where everything is checked before anything moves."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from typing import Any

import numpy as np

from .errors import InvalidInput, InvalidType
from .integrators.method import Method
from .marching import Run
from .native import real_array
from .systems.system import State, System
from .trajectory import Trajectory

MOST = 2**53
"""Counts up to this are exact as floating-point numbers, and so are the times t0 + n h up to rounding."""


def integrate(
    system: System,
    method: Method,
    start: State,
    *,
    h: float,
    steps: int,
    every: int = 1,
    record: Iterable[str] | None = None,
    t0: float = 0.0,
    compiled: bool | None = None,
    progress: bool | None = None,
    workers: int = 1,
) -> Trajectory:
    """Follow a motion for `steps` steps of length h; keep the start, every `every`-th state after it, and the last one.

    start : `system.state(mu, g)`; with a leading axis an ensemble, which runs in SIMD lanes.
    h : the step, in s; negative runs backwards.  Times are t0 + n h.
    record : ("mu",) or ("mu", "g"); what is not recorded is not computed.  Default: what the start has.
    compiled : True for native code, False for plain Python, None to choose by the amount of work; same bits.
    progress : True or False; None shows a bar when a run takes longer than a second.
    workers : threads among which the bodies of an ensemble are divided.

    Returns a Trajectory.  Raises InvalidInput, InvalidType, IncompatibleSystem, or an IntegrationFailure whose
    `.trajectory` has every sample recorded before the step that failed; so has the IntegrationInterrupted of a Ctrl-C.
    In an ensemble a body that fails stays at its last state, is named in `Trajectory.stopped` and in a warning, and
    disturbs no other.
    """
    _matching(system, method)
    h, t0 = _real(h, "h"), _real(t0, "t0")
    steps, every = _count(steps, "steps", 0), _count(every, "every", 1)
    workers = _count(workers, "workers", 1)
    _choice(compiled, "compiled")
    _choice(progress, "progress")
    if abs(h) < sys.float_info.min:
        raise InvalidInput(f"integrate: h = {h:g} is no step; it must not be zero, nor so small that 1/h overflows")
    end = t0 + steps * h
    if not math.isfinite(end):
        raise InvalidInput(f"integrate: {steps} steps of h = {h:g} lead to t = {end}")
    if steps and max(abs(t0), abs(end)) + abs(h) == max(abs(t0), abs(end)):
        smallest = np.spacing(max(abs(t0), abs(end)))
        raise InvalidInput(
            f"integrate: h = {h:g} is lost beside t = {end:g}; the smallest useful step there is {smallest:.1e}"
        )
    start = _started(system, start, record)
    return Run(system, method, start, h, steps, every, t0, compiled, progress, workers).trajectory()


# ------------------------------------------------------------------ the border


def _matching(system: Any, method: Any) -> None:
    if isinstance(system, Method) and isinstance(method, System):
        raise InvalidType("integrate: system and method are swapped; write integrate(system, method, start, ...)")
    if not isinstance(method, Method):
        cure = f"; write {method.__name__}(...), with the brackets" if isinstance(method, type) else ""
        raise InvalidType(f"integrate: method must be a method such as RKMK(order=4); got {method!r}{cure}")
    if not isinstance(system, System):
        raise InvalidType(f"integrate: system must be a system such as RigidBody([1.0, 1.5, 2.0]); got {system!r}")
    method.require(system)


def _started(system: Any, start: Any, record: Iterable[str] | None) -> State:
    if not isinstance(start, State):
        raise InvalidType(f"integrate: start must come from system.state(...); got {type(start).__name__}")
    start = system.state(**{name: np.asarray(x) for name, x in start.parts.items() if x is not None})
    if record is None:
        return start
    least = [name for name, x in system.essential(start).parts.items() if x is not None]
    choices = " or ".join(dict.fromkeys(str(tuple(names)).replace("'", '"') for names in (least, [*start.parts])))
    try:
        wanted = (record,) if isinstance(record, str) else tuple(record)
    except TypeError:
        raise InvalidType(f"integrate: record is {choices}; got {record!r}") from None
    if not set(least) <= set(wanted) <= set(start.parts):
        raise InvalidInput(f"integrate: record is {choices}, all else follows from them; got {record!r}")
    for name in wanted:
        if start.parts[name] is None:
            raise InvalidInput(f"integrate: record asks for {name}, but the start has none; give system.state a {name}")
    return type(start)(*(x if name in wanted else None for name, x in start.parts.items()))


def _real(value: Any, name: str) -> float:
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


def _count(value: Any, name: str, least: int) -> int:
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise InvalidType(f"integrate: {name} must be a whole number; got {value!r}")
    if not least <= value <= MOST:
        raise InvalidInput(f"integrate: {name} must be at least {least} and at most 2**53; got {value}")
    return int(value)


def _choice(value: Any, name: str) -> None:
    if value not in (True, False, None):
        raise InvalidType(f"integrate: {name} must be True, False or None; got {value!r}")
