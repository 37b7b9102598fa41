"""Losses and running costs, functions of states, and cotangents: values and derivatives by the states of a run."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...compiler.driver import attempt, read
from ...compiler.kernel import Several
from ...errors import InvalidInput, InvalidType
from ...formulas import Record
from ...formulas.classes.layouts import layout_of
from ...formulas.numbers.conversions import fitted
from ...formulas.numbers.dual import Dual
from ...formulas.numbers.transposes import pulled_back
from ...formulas.vectors import small
from ...simulation import arguments
from ...simulation.between.dense import evaluated, flat, report
from ...systems.system import state_of
from .directions import dual_of
from .frames import LEVEL, StatesInFrames

VALUE = layout_of(Dual(0.0, 0.0, LEVEL))

AT_ONCE = 2**12
"""States of bodies or sites whose directions are in memory at once, if those of one sample are no more."""


class Asked(NamedTuple):
    """Of a gradient the loss and the running cost, or the cotangent, at samples after `every` steps; None: the last."""

    every: int | None
    loss: Any = None
    along: Any = None
    cotangent: Any = None


class Objective:
    """A number that depends on the states of a run at some of its samples, and its derivatives by them.

    run : with `states` as its samples, of a body like `example`, or of a site, and then `by_site`, from the parts of states
    as users see them to those with an axis of sites; is a loss, `as_one`, a function of all sites together?  samples : mask
    of the states by which more than the end counts; None for the end alone.
    value : the number; None of a cotangent.  by_states : (n, many, count), the derivatives.
    """

    def __init__(
        self, run: Any, states: StatesInFrames, example: Any, samples: Any = None, by_site: Any = None, as_one: bool = False,
    ) -> None:  # fmt: skip
        self.run, self.states, self.example, self.by_site, self.as_one = run, states, example, by_site, as_one
        self.alone, self.end = samples is None, np.array([len(states.numbers) - 1])
        self.samples = self.end if samples is None else np.flatnonzero(samples)
        self.value: float | None = None
        self.by_states = np.zeros((len(states.numbers), states.many, states.frames.count))

    def find(self, asked: Asked, compiled: bool | None) -> None:
        """Set it to a loss, a function of the end, and the sum of a running cost over the samples; or to a cotangent."""
        if asked.cotangent is not None:
            self.by_cotangent(asked.cotangent)
            return
        states, sums = self.states, []
        for functions, name, where in ((asked.loss, "loss", self.end), (asked.along, "along", self.samples)):
            if name == "along" and functions is None:
                continue
            function = Loss(functions, name, self.run.bodies if self.by_site is None else None)
            if self.as_one:
                lost, parts = function.pulled(self.run, where)
                sums.append(math.fsum(lost))
                self._add(where, parts)
                continue
            for some in self._pieces(where):
                of_some = self.run.t[some], states.numbers[some], states.basis(some)
                values, slopes = function.slopes(self.example, *of_some, compiled)
                sums.append(float(values.sum()))
                self.by_states[some] += slopes
        self.value = math.fsum(sums)

    def by_cotangent(self, cotangent: Any) -> None:
        """Set its derivatives by the samples to a cotangent: of each part of the state an array of its shape, by name, or
        the components in a row; with the axis of samples before.
        """
        states, frames, some = self.states, self.states.frames, self.samples
        ahead = () if self.alone else (len(some),)
        if not isinstance(cotangent, dict):
            row = (states.many * frames.count,) if self.by_site else (frames.count,)
            axes = (states.many,) if self.run.bodies is not None and not self.by_site else ()
            array = arguments.cotangent(cotangent, "", (*ahead, *axes, *row), "fiu").astype(float)
            self.by_states[some] = (
                frames.of_each(array.reshape(len(some), -1)) if self.by_site
                else array.reshape(len(some), states.many, -1)
            )  # fmt: skip
            return
        arguments.known_parts(cotangent, self.run.states)
        parts = {}
        for name, x in self.run.states.items():
            shape, shown = (*ahead, *x.shape[1:]), self.run._by_site(name, x)
            part = np.asarray(cotangent.get(name, np.zeros(shape)))
            if shown is not x and part.shape == (*ahead, *shown.shape[1:]):
                part = flat({name: np.asarray(part, shown.dtype)}, part.shape[0]).reshape(shape)
            array = arguments.cotangent(part, name, shape, "fiuc" if np.iscomplexobj(x) else "fiu")
            parts[name] = array.astype(x.dtype).reshape(len(some), *x.shape[1:])
        self._add(some, parts)

    def _add(self, some: np.ndarray, parts: dict[str, np.ndarray]) -> None:
        """Add to its derivatives by some states those by the numbers of their parts."""
        states, frames = self.states, self.states.frames
        parts = self.by_site(parts) if self.by_site else parts
        shapes = {name: (len(some), states.many, *x.shape[2:]) for name, x in states.arrays.items()}
        rows = StatesInFrames(frames, {name: x.reshape(shapes[name]) for name, x in parts.items()}).numbers
        for piece in self._pieces(np.arange(len(some))):
            self.by_states[some[piece]] += (states.basis(some[piece]) @ rows[piece][..., None])[..., 0]

    def _pieces(self, samples: np.ndarray) -> list[np.ndarray]:
        """The numbers of samples in turn, as many as are in memory at once."""
        size = max(1, AT_ONCE // self.states.many)
        return [samples[k : k + size] for k in range(0, len(samples), size)]


class Loss:
    """A function of the state, or of time and state, or one for each body.

    name : of the argument, for messages.
    """

    def __init__(self, functions: Any, name: str, bodies: int | None) -> None:
        self.name = name
        self.each = isinstance(functions, (list, tuple))
        self.functions: Sequence[Any] = functions if self.each else [functions]
        if self.each and len(functions) != (bodies or 0):
            raise InvalidInput(
                f"Plan.gradient: {name} has {len(functions)} functions for {bodies or 'a start of one'} bodies"
            )
        for function in self.functions:
            if not callable(function):
                raise InvalidType(
                    f"Plan.gradient: {name} is a function of the state, such as "
                    f"lambda state: lm.dot(state.mu, state.mu), or a list of one for each body; got {function!r}"
                )
        count = len(arguments_of(self.functions[0]))
        if count not in (1, 2):
            raise InvalidType(
                f"Plan.gradient: {self.name} is a function of the state, or of time and state; "
                f"{self.functions[0]!r} takes {count} arguments"
            )
        self.timed = count == 2

    def of(self, body: int) -> Any:
        """The function of one body."""
        return self.functions[body if self.each else 0]

    def slopes(
        self, example: Any, t: np.ndarray, numbers: np.ndarray, frames: np.ndarray, compiled: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        """The values at states of all bodies, (n, bodies), and the derivatives along the frames there, (n,
        bodies, N).

        t : (n,) times, or (n, bodies).  numbers : (n, bodies, width).  frames : (n, bodies, N, width).
        """
        n, bodies, count, width = frames.shape
        timed = int(self.timed)
        rows = np.empty((n, bodies, count, timed + 2 * width))
        rows[..., :timed] = t.reshape(n, -1, 1, 1)
        rows[..., timed::2], rows[..., timed + 1 :: 2] = numbers[:, :, None], frames
        point = layout_of((0.0, dual_of(example))[1 - timed :])
        self._checked(example, t.item(0))
        duals = np.empty((n, bodies, count, 2))
        first = self.functions[0]
        one_form = self.each and all(isinstance(f, Record) and layout_of(f) == layout_of(first) for f in self.functions)
        what = f"Plan.gradient: {self.name}", lambda k: "at a sample"
        if one_form:
            several, body = Several.of(self.functions, bodies), np.tile(np.repeat(np.arange(bodies), count), n)
            pairs = evaluated(sloping, (several, point), rows.reshape(-1, rows.shape[-1]), 2, compiled, what, body)
            duals[:] = pairs.reshape(duals.shape)
        else:
            for i in range(len(self.functions)):
                of_body = slice(i, i + 1) if self.each else slice(None)
                numbers_of_body = rows[:, of_body].reshape(-1, rows.shape[-1])
                pairs = evaluated(sloping, (self.functions[i], point), numbers_of_body, 2, compiled, what)
                duals[:, of_body] = pairs.reshape(duals[:, of_body].shape)
        return duals[:, :, 0, 0], duals[..., 1]

    def pulled(self, run: Any, some: np.ndarray) -> tuple[list[float], dict[str, np.ndarray]]:
        """The values at some samples of a run, and the derivatives by the numbers of the parts of states there."""
        function, kind, names = self.of(0), type(run.last), [*run.states]
        values, slopes = [], {name: np.zeros(x[some].shape) for name, x in run.states.items()}
        for n, k in enumerate(some.tolist()):

            def value(parts: Any, t: float = run.t.item(k)) -> Any:
                state = state_of(kind, dict(zip(names, parts)))
                return 1.0 * (function(t, state) if self.timed else function(state))

            parts = tuple([small(x[k]) for x in run.states.values()])
            self._checked(state_of(kind, dict(zip(names, parts))), run.t.item(k))
            values.append(value(parts))
            for name, slope in zip(names, pulled_back(value, None, (), parts, 1.0)[0]):
                slopes[name][n] = slope
        return values, slopes

    def _checked(self, example: Any, t: float) -> None:
        """Refuse a function that gives no number.  Raises InvalidType."""
        function = self.functions[0]
        value = function(t, example) if self.timed else function(example)
        if not isinstance(value, (int, float)):
            raise InvalidType(
                f"Plan.gradient: {self.name} gives a number, made of the state by functions of liemech; got {value!r}"
            )


def arguments_of(function: Any) -> list[str]:
    """The names of the arguments that a function needs; one that hides them has one."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return [""]
    return [
        x.name for x in parameters if x.kind in (x.POSITIONAL_ONLY, x.POSITIONAL_OR_KEYWORD) and x.default is x.empty
    ]


def sloping(function: Any, point: Any, inputs: Any, out: Any, failures: Any) -> None:
    """The driver: a function of a state that carries a derivative, or of a time and the state."""
    report(attempt(carried, function, *read(inputs, 0, point)), VALUE, out, failures)


def carried(function: Callable[..., Any], *inputs: Any) -> Any:
    """The value of a function as a number that carries its derivative, which may be zero."""
    return fitted(1.0 * function(*inputs), VALUE)
