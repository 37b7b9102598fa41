"""Losses: functions of states, and their derivatives along directions of the states."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...compiler.driver import attempt, read
from ...compiler.kernel import Several
from ...errors import InvalidInput, InvalidType
from ...formulas import Record
from ...formulas.classes.layouts import NUMBER, layout_of
from ...formulas.numbers.conversions import fitted
from ...formulas.numbers.dual import Dual
from ...simulation.between.dense import evaluated, report
from .frames import LEVEL
from .tangent import dual_of

VALUE = layout_of(Dual(0.0, 0.0, LEVEL))


class Loss:
    """A function of the state, or of time and state, or one for each body.

    name : of the argument, for messages.
    """

    def __init__(self, given: Any, name: str, bodies: int | None) -> None:
        self.name = name
        self.each = isinstance(given, (list, tuple))
        self.functions: Sequence[Any] = given if self.each else [given]
        if self.each and len(given) != (bodies or 0):
            raise InvalidInput(
                f"Plan.gradient: {name} has {len(given)} functions for {bodies or 'a start of one'} bodies"
            )
        for function in self.functions:
            if not callable(function):
                raise InvalidType(
                    f"Plan.gradient: {name} is a function of the state, such as "
                    f"lambda state: lm.dot(state.mu, state.mu), or a list of one for each body; got {function!r}"
                )
        self.timed = self._timed(self.functions[0])

    def of(self, body: int) -> Any:
        """The function of one body."""
        return self.functions[body if self.each else 0]

    def _timed(self, function: Any) -> bool:
        """Whether a function is of time and state, not of the state alone."""
        try:
            wanted = [
                p for p in inspect.signature(function).parameters.values()
                if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD) and p.default is p.empty
            ]  # fmt: skip
        except (TypeError, ValueError):
            return False
        if len(wanted) not in (1, 2):
            raise InvalidType(
                f"Plan.gradient: {self.name} is a function of the state, or of time and state; "
                f"{function!r} takes {len(wanted)} arguments"
            )
        return len(wanted) == 2

    def slopes(
        self, example: Any, t: np.ndarray, numbers: np.ndarray, frames: np.ndarray, compiled: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        """The values at states of all bodies, (n, bodies), and the derivatives along the frames there, (n,
        bodies, N).

        t : (n,) times.  numbers : (n, bodies, width).  frames : (n, bodies, N, width).
        """
        n, bodies, count, width = frames.shape
        rows = np.empty((n, bodies, count, 2 * width + 1))
        rows[..., 0:-1:2], rows[..., 1::2] = numbers[:, :, None], frames
        rows[..., -1] = t[:, None, None]
        point = layout_of(dual_of(example))
        self._checked(example, t.item(0))
        duals = np.empty((n, bodies, count, 2))
        alike = self.each and all(
            isinstance(f, Record) and layout_of(f) == layout_of(self.functions[0]) for f in self.functions
        )
        driver = sloping_in_time if self.timed else sloping
        what = f"Plan.gradient: {self.name}", lambda k: "at a sample"
        if alike:
            several = Several.of(self.functions, bodies)
            body = np.tile(np.repeat(np.arange(bodies), count), n)
            flat = evaluated(
                driver, (several, point), rows.reshape(-1, rows.shape[-1]), 2,
                compiled, what, body,
            )  # fmt: skip
            duals[:] = flat.reshape(duals.shape)
        else:
            for i in range(len(self.functions)):
                of_body = slice(i, i + 1) if self.each else slice(None)
                numbers_of_body = rows[:, of_body].reshape(-1, rows.shape[-1])
                flat = evaluated(driver, (self.functions[i], point), numbers_of_body, 2, compiled, what)
                duals[:, of_body] = flat.reshape(duals[:, of_body].shape)
        return duals[:, :, 0, 0], duals[..., 1]

    def _checked(self, example: Any, t: float) -> None:
        """Refuse a function that gives no number.  Raises InvalidType."""
        function = self.functions[0]
        value = function(t, example) if self.timed else function(example)
        if not isinstance(value, (int, float)):
            raise InvalidType(
                f"Plan.gradient: {self.name} gives a number, made of the state by functions of liemech; got {value!r}"
            )


def sloping(function: Any, point: Any, given: Any, out: Any, failures: Any) -> None:
    """The driver: a function of a state that carries a derivative."""
    report(attempt(carried, function, read(given, 0, point)), VALUE, out, failures)


def sloping_in_time(function: Any, point: Any, given: Any, out: Any, failures: Any) -> None:
    """The driver: a function of a time, behind the state, and of a state that carries a derivative."""
    t = read(given, point.width, NUMBER)
    report(attempt(carried, function, t, read(given, 0, point)), VALUE, out, failures)


def carried(function: Callable[..., Any], *given: Any) -> Any:
    """The value of a function as a number that carries its derivative, which may be zero."""
    return fitted(1.0 * function(*given), VALUE)
