"""Dense output: the motion between the steps of a run, still on the group and on the orbit."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from ...compiler import kernel
from ...compiler.driver import accepted, any_body, attempt, itself, read, reason, write
from ...errors import IncompatibleSystem, InvalidInput, failure, is_mistake
from ...formulas import Vec, real_array, where
from ...formulas.classes.frozen import frozen
from ...formulas.classes.layouts import NUMBER, build, layout_of, leaves
from ...formulas.numbers.conversions import rounded
from ...integrators.ending_at_jumps import AT_ENDS
from ...systems.system import state_of
from ..compiled.driver import on_the_way
from ..compiled.execution import COLUMNS, Execution, like, numbers_of
from .turning import looks_by_velocity, looks_on_the_way, turning_of


def along(retraction: Any, system: Any, row: Any, inputs: Any, out: Any, failures: Any) -> None:
    """The driver: a state, moved along its step by Omega(theta) = theta (p_1 + theta (p_2 + ...)),
    0 <= theta <= 1.  row : layout of state, coefficients and theta.

    Behind the state, out has a one; a zero tells that a formula failed.  failures : None, or a list
    for what it raised.
    """
    state, coefficients, theta = read(inputs, 0, row)
    moved = attempt(on_the_way, retraction, system, state, coefficients, theta)
    report(moved, row.parts[0], out, failures)


def short_step(method: Any, system: Any, point: Any, inputs: Any, out: Any, failures: Any) -> None:
    """The driver: one step of any length, from a state and a time.  Behind the state, out has a
    one; or a zero, as in `along`.
    """
    state = read(inputs, 0, point)
    t, h = read(inputs, point.width, NUMBER), read(inputs, point.width + 1, NUMBER)
    moved = attempt(_stepped, method, system, t, state, h)
    report(moved, point, out, failures)


def velocity_of(velocity: Any, system: Any, point: Any, moving: Any, inputs: Any, out: Any, failures: Any) -> None:
    """The driver: the velocity in a state, and behind it a time; zero where there is none."""
    state, t = read(inputs, 0, point), read(inputs, point.width, NUMBER)
    moved = attempt(velocity, system, t, state)
    for k in range(moving.width):
        write(out, k, 0.0, NUMBER)
    if any_body(accepted(moved, itself, moving)):
        write(out, 0, where(accepted(moved, itself, moving), moved, read(out, 0, moving)), moving)
    write(out, moving.width, 1.0, NUMBER)


def _turning(system: Any, t: float, state: Any) -> Any:
    """The velocity with which a step turns."""
    return rounded(system._turning_velocity(t, state))


def report(moved: Any, point: Any, out: Any, failures: Any) -> None:
    """The end of a driver: the state that came of an attempt, and behind it whether it went through."""
    good = accepted(moved, itself, point)
    if any_body(good):
        write(out, 0, moved, point)
    write(out, point.width, where(good, 1.0, 0.0), NUMBER)
    if failures is not None and not good:
        failures.append(reason(moved))


def _stepped(method: Any, system: Any, t: float, state: Any, h: float) -> Any:
    """The state after one step of a method that begins here."""
    return rounded(method.observe(method.step(system, t, method.start(system, state, h), h)))


def one_or_many(times: Any) -> np.ndarray:
    """A time, (), or times, (m,), as an array; refused with more axes."""
    at = real_array(times, "t")
    if at.ndim > 1:
        raise InvalidInput(f"Trajectory.at takes one time or many, (m,); got t of shape {at.shape}")
    return at


def within_run(times: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Times in a run that has its ends of steps at t, those beyond them by rounding at its ends.  Raises
    InvalidInput for times outside of it.
    """
    low, high = min(t[0], t[-1]), max(t[0], t[-1])
    margin = 4.0 * np.finfo(float).eps * max(abs(low), abs(high))
    inside = (times >= low - margin) & (times <= high + margin)
    if not inside.all():
        raise InvalidInput(f"t = {times[~inside][0]:g} is outside the run, which goes from {t[0]:g} to {t[-1]:g}")
    return np.clip(times, low, high)


class MotionBetween:
    """The motion inside of steps, and of a run that has kept their ends between these; abstract.

    A subclass writes `inputs` and `moved`.
    """

    example: Any  # a state
    wanted: bool | None  # False for plain Python only
    # (n + 1, ...) of every end of a step the time, the state, and what else `inputs` needs; of a run whose observers ask
    # there are none
    rows: Any
    closer: ClassVar[bool] = False  # may states inside of a step ask for more looks there?

    @functools.cached_property
    def width(self) -> int:
        """Count of numbers of a state."""
        return layout_of(self.example).width

    @property
    def t(self) -> np.ndarray:
        """The ends of the steps, (n + 1,)."""
        return self.rows[:, 0]

    @property
    def points(self) -> np.ndarray:
        """The numbers of the states there, (n + 1, width)."""
        return self.rows[:, 1 : 1 + self.width]

    def inputs(self, before: np.ndarray, after: np.ndarray, times: np.ndarray) -> np.ndarray:
        """The input of `moved`, (m, ...), from the rows where steps begin and end and times inside of them."""
        raise NotImplementedError

    def moved(self, inputs: np.ndarray, times: np.ndarray, body: np.ndarray | None = None) -> np.ndarray:
        """The numbers of the states at these times, (m, width).

        body : of each of them, where parameters are of each body.
        """
        raise NotImplementedError

    def looks(self, before: np.ndarray, after: np.ndarray, body: np.ndarray) -> np.ndarray:
        """Counts of looks into steps, (m,), such that none is more than a quarter of a turn from the last, from the
        rows where steps begin and end.
        """
        raise NotImplementedError

    def _by_velocities(
        self, velocity: Any, group: Any, before: np.ndarray, after: np.ndarray, body: np.ndarray
    ) -> np.ndarray:
        """`looks`, by a formula for the velocities at both ends, in the algebra of this group."""
        turning, (method,) = turning_of(group), kernel.examples([self.method])  # type: ignore[attr-defined]
        if method.noisy or not turning.parts:
            return np.ones(len(after), dtype=int)
        # steps that do not go on from the last
        new = np.append(True, (before[1:] != after[:-1]).any(axis=1))[: len(after)]
        rows, place = np.concatenate([before[new], after]), int(new.sum())
        points = np.concatenate([rows[:, 1 : 1 + self.width], rows[:, :1]], axis=1)
        arguments = velocity, self.system, layout_of(self.example), layout_of(Vec(*[0.0] * group.dim))  # type: ignore[attr-defined]
        xi = evaluated(velocity_of, arguments, points, group.dim, self.wanted, body=np.concatenate([body[new], body]))
        end = xi[place:]
        start = np.concatenate([end[:1], end[:-1]])
        start[new] = xi[:place]
        spans = (after[:, 0] - before[:, 0])[:, None]
        return looks_by_velocity(np.maximum(turning(spans * start), turning(spans * end)))

    def numbers(self, times: np.ndarray) -> np.ndarray:
        """The numbers of the states at these times, (m, width).  Raises InvalidInput for times outside the run."""
        return self.within(within_run(times, self.t))

    def within(self, times: np.ndarray) -> np.ndarray:
        """Numbers of states at times that are known to be in the run."""
        t, points = self.t, self.points
        if len(t) == 1:
            return np.repeat(points, len(times), axis=0)
        forward = t[-1] >= t[0]
        step = np.searchsorted(t if forward else -t, times if forward else -times, "right") - 1
        np.minimum(step, len(t) - 2, out=step)
        at_end = times == t[step + 1]
        states = points[step + at_end]  # at the ends of steps, to the bit
        between = ((times != t[step]) > at_end).nonzero()[0]
        if len(between):
            step, times = step[between], times[between]
            inputs = self.inputs(self.rows[step], self.rows[step + 1], times)
            states[between] = self.moved(inputs, times)
        return states

    def __call__(self, times: Any) -> Any:
        """The state at one time, or at many, (m,), whose arrays then have a leading axis."""
        at = one_or_many(times)
        kind, arrays = self.apart(self.numbers(np.atleast_1d(at).ravel()))
        index = 0 if at.ndim == 0 else slice(None)
        return state_of(kind, {name: x[index] for name, x in arrays.items()})

    def apart(self, numbers: np.ndarray) -> tuple[Any, dict[str, np.ndarray]]:
        """The kind of the states that have these numbers, and their parts."""
        return type(self.example), unpacked(layout_of(self.example), numbers)


def part_of_way(curve: np.ndarray, part: float, terms: int) -> np.ndarray:
    """The coefficients of the first part of a way of so many terms, Omega(part theta)."""
    powers = part ** (1.0 + np.arange(terms))
    return (curve.reshape(terms, -1) * powers[:, None]).reshape(curve.shape)


@frozen(eq=False)
class DenseOutput(MotionBetween):
    """The motion as a continuous function of time: in every step a polynomial in the algebra,
    carried to the group.

    rows : (n + 1, ...) of every end of a step the time, the state, and the coefficients of the way
    there.
    order : of accuracy, between the steps.
    """

    system: Any
    retraction: Any
    example: Any
    rows: Any
    order: int
    wanted: bool | None = None

    @property
    def curves(self) -> np.ndarray:
        """The coefficients of the polynomials, (n, number of them * dim)."""
        return self.rows[1:, 1 + self.width :]

    def inputs(self, before: np.ndarray, after: np.ndarray, times: np.ndarray) -> np.ndarray:
        width, starts = self.width, before[:, 0]
        inputs = np.empty((len(times), after.shape[1]))
        inputs[:, :width], inputs[:, width:-1] = before[:, 1 : 1 + width], after[:, 1 + width :]
        inputs[:, -1] = (times - starts) / (after[:, 0] - starts)
        return inputs

    def moved(self, inputs: np.ndarray, times: np.ndarray, body: np.ndarray | None = None) -> np.ndarray:
        dim = kernel.examples([self.system])[0].group.dim
        terms = (inputs.shape[1] - 1 - self.width) // dim
        row = layout_of((self.example, (Vec(*[0.0] * dim),) * terms, 0.0))
        arguments = self.retraction, self.system, row
        what = "dense output", lambda k: f"between two steps, t = {times[k]:g}"
        return evaluated(along, arguments, inputs, self.width, self.wanted, what, body)

    def looks(self, before: np.ndarray, after: np.ndarray, body: np.ndarray) -> np.ndarray:
        """Counts of looks by the polynomials, whose derivatives bound the velocity."""
        (system,) = kernel.examples([self.system])
        ways = after[:, 1 + self.width :].reshape(len(after), -1, system.group.dim)
        return looks_on_the_way(turning_of(system.group), ways, system.unit_blocks)

    def then(self, rest: DenseOutput) -> DenseOutput:
        """This motion and `rest`, which begins where this one ends, as one."""
        return dataclasses.replace(rest, rows=np.concatenate([self.rows, rest.rows[1:]]))


@frozen(eq=False)
class DenseOutputs:
    """The motions of the bodies of an ensemble, each between steps of its own."""

    bodies: tuple[Any, ...]

    def __call__(self, times: Any) -> Any:
        """The states of all bodies at one time, or at many, (m,); a body whose run has ended before stays where
        it ended, as in the samples.
        """
        ends = np.array([motion.t[[0, -1]] for motion in self.bodies])
        last = ends[np.argmax(np.abs(ends[:, 1] - ends[:, 0]))]
        clipped = within_run(np.asarray(one_or_many(times), dtype=float), last)
        states = [motion(np.clip(clipped, min(span), max(span))) for motion, span in zip(self.bodies, ends.tolist())]
        axis, first = np.ndim(times), states[0]
        parts = {n: np.stack([x.arrays[n] for x in states], axis=axis) for n in first.arrays}
        return state_of(type(first), parts)

    def then(self, rest: DenseOutputs) -> DenseOutputs:
        """The motions of both runs joined body by body."""
        return DenseOutputs(tuple([x.then(y) for x, y in zip(self.bodies, rest.bodies)]))


@frozen(eq=False)
class ShortSteps(MotionBetween):
    """The motion between fixed steps: from the last end of a step, a shorter step of the
    method itself.

    order : of accuracy: a single step more at the end of many changes little.
    """

    closer: ClassVar[bool] = True

    system: Any
    method: Any
    example: Any
    rows: Any
    wanted: bool | None = None

    @property
    def order(self) -> int:
        """The order of the method: a single step more, of error h^(order + 1), does not lower it."""
        return int(self.method.order)

    def inputs(self, before: np.ndarray, after: np.ndarray, times: np.ndarray) -> np.ndarray:
        points, starts = before[:, 1 : 1 + self.width], before[:, 0]
        return np.concatenate([points, starts[:, None], (times - starts)[:, None]], axis=1)

    def looks(self, before: np.ndarray, after: np.ndarray, body: np.ndarray) -> np.ndarray:
        """Counts of looks by the turning velocities at both ends of each step."""
        (system,) = kernel.examples([self.system])
        return self._by_velocities(_turning, system._turning_group, before, after, body)

    def moved(self, inputs: np.ndarray, times: np.ndarray, body: np.ndarray | None = None) -> np.ndarray:
        (method,) = kernel.examples([self.method])
        if method.noisy:
            raise IncompatibleSystem(f"{method!r} knows no state at t = {times[0]:g}, inside of a step: {AT_ENDS}")
        what = (repr(method), lambda k: f"the shorter step from t = {inputs[k, -2]:g} to t = {times[k]:g}")
        arguments = self.method, self.system, layout_of(self.example)
        return evaluated(short_step, arguments, inputs, self.width, self.wanted, what, body)


def evaluated(
    driver: Any,
    arguments: tuple[Any, ...],
    inputs: np.ndarray,
    width: int,
    wanted: bool | None,
    what: tuple[str, Callable[[int], str]] = ("dense output", lambda k: "between two steps"),
    body: np.ndarray | None = None,
) -> np.ndarray:
    """Map a driver over rows of numbers, (m, width): in plain Python until native code pays.

    what : what has failed if a row does, and where, by the number of the row.  body : of each row, of
    which body it is, where arguments are `Several`.
    """
    count = len(inputs)
    execution, constants = execution_of(driver, arguments, wanted)
    results, done = np.empty((count, width + 1)), 0

    def plainly(k: int) -> None:
        values = [x.values[body[k]] if isinstance(x, kernel.Several) and body is not None else x for x in arguments]
        _one(driver, values, inputs[k], results[k], what, k)

    while done < count and not execution.ready(done / count):
        end = min(done + 8, count)
        with execution.plain():
            for k in range(done, end):
                plainly(k)
        done = end
    if done < count:
        several = [x.columns for x in arguments if isinstance(x, kernel.Several)]
        parameters = [x.take(body[done:], axis=1) for x in several] if body is not None else []
        results[done:count] = natively(execution, constants, inputs[done:], width, parameters)
        if not results[:count, -1].all():
            for k in np.flatnonzero(results[:count, -1] == 0.0).tolist():  # say why
                plainly(k)
    return results[:count, :-1].copy()


def natively(
    execution: Execution, constants: bytes, inputs: np.ndarray, width: int, parameters: Any = ()
) -> np.ndarray:
    """Run the native code of a driver on every row of numbers: what it makes of it, and behind it a
    one, or a zero for a formula that failed, (m, width + 1).

    parameters : (width, m) numbers of which every row has its own.
    """
    count, lanes = len(inputs), execution.lanes
    columns = -(-count // lanes) * lanes
    rows, out = np.empty((inputs.shape[1], columns)), np.empty((width + 1, columns))
    rows[:, :count], rows[:, count:] = inputs.T, inputs[-1][:, None]
    last = np.minimum(np.arange(columns), count - 1)
    padded = [x.take(last, axis=1) for x in parameters]
    execution.run(constants, (), (*padded, rows, out), columns, 0, columns)
    return out.T[:count]


def observe(function: Any, point: Any, result: Any, inputs: Any, out: Any, failures: Any) -> None:
    """The driver: a function of a state and, behind it, a time."""
    state, t = read(inputs, 0, point), read(inputs, point.width, NUMBER)
    report(attempt(function, t, state), result, out, failures)


_executions: dict[Any, tuple[Execution, bytes]] = {}
FEW = 64
"""Executions that are remembered."""


def execution_of(
    driver: Any, arguments: tuple[Any, ...], wanted: bool | None, silent: bool = False
) -> tuple[Execution, bytes]:
    """The Execution of a driver for these arguments, for one use, and their numbers, packed."""
    native = wanted is not False and kernel.available() is None
    key = driver, native, silent, *map(id, arguments)
    remembered = _executions.get(key)
    if remembered is not None:
        return like(remembered[0], native=remembered[0].used(wanted)), remembered[1]
    lanes = kernel.lanes() if native else 1
    call = driver, *arguments, COLUMNS, COLUMNS, None
    compiled = None if native else False
    entry = Execution(compiled, None, *call, lanes=lanes, silent=silent), numbers_of(*arguments)
    for_one_use = like(entry[0], native=entry[0].used(wanted)), entry[1]
    if len(_executions) >= FEW:
        _executions.clear()
    _executions[key] = entry  # which has the arguments, so that their identities remain theirs
    return for_one_use


def _one(
    driver: Any, arguments: Any, inputs: np.ndarray, out: np.ndarray, what: tuple[str, Callable[[int], str]], k: int
) -> None:
    failures: list[Exception | None] = []
    try:
        driver(*arguments, inputs, out, failures)
    except KeyboardInterrupt as stop:
        stop.row = k  # type: ignore[attr-defined]
        raise
    if failures:
        error: Any = failures[0]
        if error is None or not is_mistake(error):
            error = failure(error, what[0], what[1](k))
        error.row = k
        raise error


def unpacked(layout: Any, numbers: np.ndarray) -> dict[str, np.ndarray]:
    """Numbers of states, (..., width), as the parts of the state by name: views, of complex numbers perhaps copies."""
    arrays = {}
    for name, begin, end, shape, is_complex in _parts(layout):
        part = numbers[..., begin:end]
        if is_complex:
            part = np.ascontiguousarray(part).view(complex)
        if part.shape[-1:] != shape:
            part = part.reshape(numbers.shape[:-1] + shape)
        arrays[name] = part
    return arrays


@functools.lru_cache(256)
def _parts(layout: Any) -> list[tuple[str, int, int, tuple[int, ...], bool]]:
    """Per part of a state: its name, its first and last number, the shape of its array, whether it is complex."""
    parts, at = [], 0
    for name, inner in zip(layout.detail[1], layout.parts, strict=True):
        if inner.width:
            zero = np.array(build(inner, iter([0.0] * inner.width)))
            parts.append((name, at, at + inner.width, zero.shape, zero.dtype == complex))
            at += inner.width
    return parts


def flat(arrays: dict[str, np.ndarray], count: int) -> np.ndarray:
    """The numbers of many states, (count, width), from the parts of the state by name; a complex number is two."""
    parts = [np.ascontiguousarray(x) for x in arrays.values()]
    real = [x.view(float) if np.iscomplexobj(x) else x.astype(float, copy=False) for x in parts]
    rows = [x.reshape(count, x.size // count if count else math.prod(x.shape[1:])) for x in real]
    return rows[0] if len(rows) == 1 else np.concatenate(rows, axis=1)


def lay_out(arrays: dict[str, np.ndarray], columns: np.ndarray) -> None:
    """Write the numbers of many states, a column for each body; lanes that are left over repeat the last body."""
    at = 0
    for part in arrays.values():
        count = len(part)
        rows = part.reshape(count, -1) if part.dtype == float else flat({"": part}, count)
        numbers = columns[at : at + rows.shape[1], :count]
        for i in range(0, count, CACHED):  # one pass over memory, not one for each number
            numbers[:, i : i + CACHED] = rows[i : i + CACHED].T
        at += len(numbers)
    columns[:, count:] = columns[:, count - 1 : count]


CACHED = 2**10
"""Bodies whose numbers stay in the cache while they are written from rows into columns."""


def packed(value: Any) -> np.ndarray:
    """The numbers of a state, (width,)."""
    return np.array(leaves(value, layout_of(value)), dtype=float)
