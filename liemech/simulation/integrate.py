"""`integrate`: the border of the one loop, where everything is checked before anything moves."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from typing import Any

import numpy as np

from ..errors import IncompatibleSystem, InvalidInput, InvalidType, StepWarning, warn
from ..formulas import check_finite, real_array
from ..integrators.method import Method
from ..systems.system import State, System
from .fixed import Run
from .trajectory import Trajectory

MOST = 2**53
"""Counts up to this are exact as floating-point numbers, and so are the times t0 + n h up to rounding."""


def integrate(
    system: System,
    method: Method,
    start: State,
    *,
    h: float | None = None,
    steps: int | None = None,
    every: int = 1,
    t_end: float | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    t_eval: Any = None,
    events: Any = (),
    dense: bool = True,
    record: Iterable[str] | None = None,
    t0: float = 0.0,
    compensated: bool | None = None,
    compiled: bool | None = None,
    progress: bool | None = None,
    workers: int = 1,
) -> Trajectory:
    """Follow a motion, in `steps` steps of length h, or adaptively to the time `t_end`.

    start : `system.state(...)`; with a leading axis an ensemble, which runs in SIMD lanes.
    record : the parts of the state to keep, such as ("mu",) or ("mu", "g"); what is not recorded is not computed.
    compensated : whether the increments of the steps are summed up in compensated numbers: True for all parts of the state, False
    for none, None for those that the motion depends on, if the method is symmetric or symplectic.
    compiled : True for native code, False for plain Python, None for native code as soon as it is there or pays; same bits.
    progress : True or False; None shows a bar when a run takes longer than a second.

    Steps of one length: kept are the start, every `every`-th state after it, and the last one.
    h : the step, in s; negative runs backwards.  Times are t0 + n h.
    workers : threads among which the bodies of an ensemble are divided.

    Adaptive steps, for one body and a method with an error estimate:
    t_end : the last time, before or after t0.  h, steps : the first step and the largest number of steps, if given.
    rtol, atol : the error of a step is kept below atol + rtol |state| (1e-6 and 1e-9).  As with every local error control, the
    error of the motion grows along it.
    t_eval : (n,) times at which to keep the state; default: where the steps end.
    dense : keep the way between the steps too, for `Trajectory.at`.
    events : functions of t and state whose zeros are looked for; their attributes `terminal` (True: the first zero ends the run; 3:
    the third one) and `direction` (+1 only rising, -1 only falling zeros) mean what they do in SciPy.

    Returns a Trajectory.  Raises InvalidInput, InvalidType, IncompatibleSystem, or an IntegrationFailure whose
    `.trajectory` has every sample recorded before the step that failed; so has the IntegrationInterrupted of a Ctrl-C.
    A mistake in a formula (NameError, TypeError, IndexError, ...) is raised as it is, with such a `.trajectory`.
    Warns with a StepWarning of a step that may have no solution, where the method can tell.
    In an ensemble a body that fails stays at its last state, is found in `Trajectory.stopped` with its reason, and in a warning,
    and disturbs no other.
    """
    _matching(system, method)
    t0 = _real(t0, "t0")
    every, workers = _count(every, "every", 1), _count(workers, "workers", 1)
    _choice(compensated, "compensated")
    _choice(compiled, "compiled")
    _choice(progress, "progress")
    if dense not in (True, False):
        raise InvalidType(f"integrate: dense must be True or False; got {dense!r}")
    if method.fictive or system.fictive:
        from .transformed import TransformedRun

        if h is None or (steps is None and t_end is None):
            raise InvalidInput("integrate: give h, the step in fictive time, and steps or t_end")
        for name, value in (("rtol", rtol), ("atol", atol), ("events", events or None), ("dense=False", None if dense else dense)):
            if value is not None:
                raise InvalidInput(f"integrate: {name} is for adaptive steps; {method!r} steps by its time scale")
        given = _started(system.system if system.fictive else system, start, record)  # type: ignore[attr-defined]
        transformed = TransformedRun(system, method, given, _step(h), t0, compensated, compiled, progress)
        if t_end is None:
            if t_eval is not None:
                raise InvalidInput("integrate: t_eval needs t_end, the time up to which the run goes")
            return transformed.steps(_count(steps, "steps", 0), every, workers)
        t_end = _real(t_end, "t_end")
        limit = MOST if steps is None else _count(steps, "steps", 1)
        return transformed.until(t_end, every, limit, _times(t_eval, t0, t_end))
    if t_end is not None:
        _only_adaptive(method, every, workers)
        if compensated is not None:
            raise InvalidInput("integrate: compensated is for steps of one length; adaptive ones have larger errors than rounding")
        t_end = _real(t_end, "t_end")
        first = None if h is None else _step(h)
        limit = MOST if steps is None else _count(steps, "steps", 1)
        tolerances = _tolerance(rtol, "rtol", 1e-6), _tolerance(atol, "atol", 1e-9)
        times, functions = _times(t_eval, t0, t_end), _events(events)
        start = _started(system, start, record)
        if start.bodies is not None:
            raise InvalidInput("integrate: adaptive steps are for one body at a time; give an ensemble h and steps")
        from .adaptive import AdaptiveRun

        return AdaptiveRun(
            system, method, start, t0, t_end, *tolerances, first, limit, times, functions, dense, compiled, progress
        ).trajectory()
    for name, value in (("rtol", rtol), ("atol", atol), ("t_eval", t_eval), ("events", events or None)):
        if value is not None:
            raise InvalidInput(f"integrate: {name} is for adaptive steps; give t_end and, if you like, h as the first step")
    if not dense:
        raise InvalidInput("integrate: dense is for adaptive steps; those of one length have no way between them to leave out")
    if h is None or steps is None:
        raise InvalidInput("integrate: give h and steps, for steps of one length, or t_end, for adaptive ones")
    h, steps = _step(h), _count(steps, "steps", 0)
    end = t0 + steps * h
    if not math.isfinite(end):
        raise InvalidInput(f"integrate: {steps} steps of h = {h:g} lead to t = {end}")
    if steps and max(abs(t0), abs(end)) + abs(h) == max(abs(t0), abs(end)):
        smallest = np.spacing(max(abs(t0), abs(end)))
        raise InvalidInput(
            f"integrate: h = {h:g} is lost beside t = {end:g}; the smallest useful step there is {smallest:.1e}"
        )
    start = _started(system, start, record)
    doubt = method.caution(system, start, h)
    if doubt:
        warn(doubt, StepWarning)
    return Run(system, method, start, h, steps, every, t0, compensated, compiled, progress, workers).trajectory()


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
    if not system.knows(start):
        start = system.state(**start.arrays)
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


def _only_adaptive(method: Any, every: int, workers: int) -> None:
    if method.symplectic or method.symmetric:
        raise IncompatibleSystem(
            f"integrate: {method!r} keeps the structure because all its steps are alike, which an error control would spoil. "
            "Give h and steps; for adaptive steps take a method with an error estimate, such as RKMK(order=5)"
        )
    if not getattr(method, "error_order", 0):
        raise IncompatibleSystem(
            f"integrate: {method!r} has no error estimate to choose steps by. Give h and steps, or take a method with an embedded "
            "pair, such as RKMK(order=5)"
        )
    for name, value in (("every", every), ("workers", workers)):
        if value != 1:
            raise InvalidInput(f"integrate: {name} is for steps of one length; adaptive ones have t_eval")


def _step(h: Any) -> float:
    h = _real(h, "h")
    if abs(h) < sys.float_info.min:
        raise InvalidInput(f"integrate: h = {h:g} is no step; it must not be zero, nor so small that 1/h overflows")
    return h


def _tolerance(value: Any, name: str, default: float) -> float:
    value = default if value is None else _real(value, name)
    if value < 0.0 or (name == "rtol" and value == 0.0):
        raise InvalidInput(f"integrate: {name} must be positive{'' if name == 'rtol' else ' or zero'}; got {value:g}")
    least = 100 * sys.float_info.epsilon
    if name == "rtol" and value < least:
        warn(f"integrate: rtol = {value:g} is below rounding; {least:.1e} is used", RuntimeWarning)
        return least
    return value


def _times(t_eval: Any, t0: float, t_end: float) -> np.ndarray | None:
    if t_eval is None:
        return None
    times = np.array(real_array(t_eval, "integrate: t_eval"))
    if times.ndim != 1:
        raise InvalidInput(f"integrate: t_eval has shape {times.shape}; it is a list of times, (n,)")
    check_finite(times, "integrate: t_eval")
    outside = (times < min(t0, t_end)) | (times > max(t0, t_end))
    if outside.any():
        raise InvalidInput(f"integrate: t_eval has t = {times[outside][0]:g}, which is not between {t0:g} and {t_end:g}")
    if (np.diff(times) * (t_end - t0) < 0).any():
        raise InvalidInput("integrate: t_eval must be sorted in the direction of time")
    return times


def _events(events: Any) -> tuple[Any, ...]:
    functions = (events,) if callable(events) else tuple(events)
    for event in functions:
        if not callable(event):
            raise InvalidType(f"integrate: events are functions of t and state; got {event!r}")
        terminal, direction = getattr(event, "terminal", None), getattr(event, "direction", 0.0)
        if terminal is not None and (not isinstance(terminal, (bool, np.bool_, int, np.integer)) or terminal < 0):
            wanted = "True, False, or the number of its zeros at which the run ends"
            raise InvalidInput(f"integrate: the `terminal` of an event is {wanted}; got {terminal!r}")
        if isinstance(direction, bool) or not isinstance(direction, (int, float, np.number)) or direction != direction:
            raise InvalidInput(f"integrate: the `direction` of an event is +1, -1 or 0; got {direction!r}")
    return functions


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
