"""Blocks between a controller and a stepper: what becomes of commands on their way to the body, and ramps."""

from __future__ import annotations

import collections
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import Record, check_finite, real_array, record
from ...formulas.classes.records import fill
from ...formulas.vectors import small
from ...simulation import arguments


@record
class Ramp(Record):
    """A number or a vector that changes evenly in time, u(t) = value + (t - t0) slope.

    A field of a force, a system, ..., whose formulas call it, `self.torque(t)`; as the input of a
    stepper it is a command between two looks at the body.

    value : at the time t0, a number or (dim,).  slope : its rate, per s; zero if left out.
    Raises InvalidInput for shapes that differ, and entries that are not finite.

    Source: Franklin, Powell and Workman, Digital Control of Dynamic Systems, 3rd ed., section 5.2.
    """

    value: Any
    slope: Any = None
    t0: float = 0.0

    def __post_init__(self) -> None:
        value = real_array(self.value, "Ramp: value")
        slope = np.zeros(value.shape) if self.slope is None else real_array(self.slope, "Ramp: slope")
        for name, array in (("value", value), ("slope", slope)):
            check_finite(array, f"Ramp: {name}")
        if value.ndim > 1 or value.shape != slope.shape:
            raise InvalidInput(
                f"Ramp: value and slope are two numbers, or (dim,) both; got shapes {value.shape} and {slope.shape}"
            )
        for name, array in (("value", value), ("slope", slope)):
            object.__setattr__(self, name, small(array) if array.ndim else float(array))
        super().__post_init__()

    def __call__(self, t: Any) -> Any:
        """u(t).  t : in s."""
        return self.value + (t - self.t0) * self.slope


class ZeroOrderHold:
    """A command that is taken at every n-th look, and held until then: a slow controller in a fast
    loop.

        hold = lm.loops.ZeroOrderHold(10)
        loop.step(4, torque=hold(lambda: controller(loop)))

    every : n.
    Source: Franklin, Powell and Workman, Digital Control of Dynamic Systems, 3rd ed., section 4.3.
    """

    def __init__(self, every: int) -> None:
        self.every = arguments.count(every, "every", 1)
        self.reset()

    def reset(self) -> None:
        """Forget the command, so that the next look takes one."""
        self._looks, self._command = 0, None

    def __call__(self, command: Any) -> Any:
        """The command that holds now.  command : a value, or a function without arguments, which is
        called when a command is taken.
        """
        if self._looks % self.every == 0:
            self._command = as_it_is(command() if callable(command) else command)
        self._looks += 1
        return self._command

    def __repr__(self) -> str:
        return f"ZeroOrderHold({self.every})"


class FirstOrderHold:
    """Commands joined by straight lines, as `Ramp`s: u(t) = u_k + (u_k - u_(k-1)) (t - t_k)/T from
    t_k on, or, one period later and without jumps, u_(k-1) + (u_k - u_(k-1)) (t - t_k)/T.

        hold = lm.loops.FirstOrderHold(0.01, delayed=True)
        loop.step(10, torque=hold(loop.t, u))

    period : T, in s, from one look to the next.  delayed : lead from the last command to this one?
    first : the command before the first one; left out, it is the first one.
    Source: Franklin, Powell and Workman, Digital Control of Dynamic Systems, 3rd ed., section 5.2.
    """

    def __init__(self, period: float, delayed: bool = False, first: Any = None) -> None:
        self.period, self.delayed, self.first = positive(period, "period"), bool(delayed), as_it_is(first)
        self.reset()

    def reset(self) -> None:
        """Forget the last command; the next one begins anew, from `first` if there is one."""
        self._last = None if self.first is None else command_of(self.first, "first")

    def __call__(self, t: float, command: Any) -> Any:
        """The command from the time t on; of an ensemble, (bodies, dim), a list of them."""
        now = command_of(command, "command")
        last = now if self._last is None else self._last
        slope, begin = (now - last) / self.period, last if self.delayed else now
        self._last = now
        if now.ndim > 1:
            return [ramp(t, *both) for both in zip(begin, slope, strict=True)]
        return ramp(t, begin, slope)

    def __repr__(self) -> str:
        return f"FirstOrderHold({self.period}{', delayed=True' if self.delayed else ''})"


class Latency:
    """Commands that arrive some looks later.

    looks : how many.  first : what arrives until then.
    Source: Franklin, Powell and Workman, Digital Control of Dynamic Systems, 3rd ed., section 4.3.2.
    """

    def __init__(self, looks: int, first: Any) -> None:
        self.looks, self.first = arguments.count(looks, "looks", 0), as_it_is(first)
        self.reset()

    def reset(self) -> None:
        """Let nothing be on its way."""
        self._on_the_way = collections.deque([self.first] * self.looks)

    def __call__(self, command: Any) -> Any:
        """The command that arrives as this one is given."""
        self._on_the_way.append(as_it_is(command))
        return self._on_the_way.popleft()

    def __repr__(self) -> str:
        return f"Latency({self.looks}, {self.first!r})"


class RateLimit:
    """Commands that follow others as fast as an actuator can: |u_k - u_(k-1)| <= rate T.

    rate : per s, one for all components or one for each.  period : T, in s, from one look to the next.
    first : where the actuator begins.
    Source: Astrom and Murray, Feedback Systems, 2nd ed., section 11.4.
    """

    def __init__(self, rate: Any, period: float, first: Any) -> None:
        self.rate, self.period = command_of(rate, "rate"), positive(period, "period")
        if not (self.rate > 0.0).all():
            raise InvalidInput(f"RateLimit: rate must be positive; got {rate!r}")
        self.first = command_of(first, "first")
        self.reset()

    def reset(self) -> None:
        """Go back to the first command."""
        self._last = self.first

    def __call__(self, command: Any) -> Any:
        """The position of the actuator as this command is given."""
        most = self.rate * self.period
        away = command_of(command, "command") - self._last
        # reached without a rest
        self._last = np.where(np.abs(away) <= most, command, self._last + np.copysign(most, away))
        return self._last.copy() if self._last.ndim else self._last.item()

    def __repr__(self) -> str:
        return f"RateLimit({self.rate.tolist()}, {self.period}, {self.first.tolist()})"


def ramp(t: float, value: np.ndarray, slope: np.ndarray) -> Ramp:
    """A ramp from the time t on, whose numbers are checked already."""
    value_and_slope = (small(value), small(slope)) if value.ndim else (float(value), float(slope))
    return fill(Ramp, {"value": value_and_slope[0], "slope": value_and_slope[1], "t0": float(t)})


def as_it_is(command: Any) -> Any:
    """The command, of an array or a list a copy: its owner may write the next one into it."""
    return command.copy() if isinstance(command, (np.ndarray, list)) else command


def command_of(value: Any, name: str) -> np.ndarray:
    """A command as an array of its own, checked."""
    array = real_array(as_it_is(value), name)
    check_finite(array, name)
    return array


def positive(value: Any, name: str) -> float:
    """The number given, refused unless it is positive."""
    number = arguments.real(value, name)
    if not number > 0.0:
        raise InvalidInput(f"{name} must be positive; got {value!r}")
    return number
