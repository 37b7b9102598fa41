"""Drivers of steps of one length: the loop over steps and samples, in plain Python or native code,
for one body or many.
"""

from __future__ import annotations

from typing import Any

from ..compiler.driver import accepted, any_body, attempt, read, reason, unchanged, write
from ..formulas import where
from ..formulas.pytree import NUMBER, fitted, rounded


def fixed_steps(
    method: Any,
    system: Any,
    layout: Any,
    shown: Any,
    t0: float,
    h: float,
    first: int,
    every: int,
    samples: int,
    states: Any,
    out: Any,
    failures: Any,
) -> None:
    """The driver: `samples` times `every` steps from step number `first`, in plain Python or
    compiled, for one or many.

    states holds, before and after, what the method carries along, in this layout, and behind it the
    number of steps that went through; out the samples, laid out as `shown`.  A body whose step
    fails stays where it is, for good.
    failures : None in native code; in plain Python, which has one body, a list for what the failing
    step raised.
    """
    carry = read(states, 0, layout)
    count = read(states, layout.width, NUMBER)
    running = count == first
    turns = every if any_body(running) else 0
    for k in range(samples):
        for j in range(turns):
            t = t0 + (first + (k * every + j)) * h
            trial = attempt(stepped, method, system, t, carry, h, layout)
            good = running and accepted(trial, observed, shown)
            if any_body(not good):
                if failures is not None:
                    failures.append(reason(trial))
                running = good
                if not any_body(running):
                    break
                carry = where(good, trial[0], carry)
                count = where(good, count + 1.0, count)
            else:
                carry = trial[0]
                count = count + 1.0
        write(out, k * shown.width, attempt(sample, method, carry), shown)
        if not any_body(running):
            break
    write(states, 0, carry, layout)
    write(states, layout.width, count, NUMBER)


def begin(
    method: Any,
    system: Any,
    given: Any,
    started: Any,
    layout: Any,
    shown: Any,
    h: float,
    starts: Any,
    states: Any,
    out: Any,
    failures: Any,
) -> None:
    """The driver before the first step: from a start, given in one layout and to be used in
    another, what the method carries along, in a third, and the first sample.  A body that cannot
    begin keeps what is in `out` and a negative number of steps.
    """
    trial = attempt(begun, method, system, fitted(read(starts, 0, given), started), h)
    good = accepted(trial, observed, shown)
    if any_body(good):
        write(states, 0, fitted(trial[0], layout), layout)
        write(out, 0, where(good, trial[1], read(out, 0, shown)), shown)
    write(states, layout.width, where(good, 0.0, -1.0), NUMBER)
    if failures is not None and not good:
        failures.append(reason(trial))


def stepped(method: Any, system: Any, t: float, carry: Any, h: float, layout: Any) -> Any:
    """What the method carries along after one step, and the sample that shows it.  Raises
    InvalidType if the step returns something else than it was given.
    """
    new = method.step(system, t, carry, h)
    if layout.remembers:
        new = fitted(new, layout)
    unchanged(new, layout)
    return new, rounded(method.observe(new))


def begun(method: Any, system: Any, state: Any, h: float) -> Any:
    """What the method carries along from a start, and the sample that shows it."""
    carry = method.start(system, state, h)
    return carry, rounded(method.observe(carry))


def sample(method: Any, carry: Any) -> Any:
    """The sample that shows what the method carries along."""
    return rounded(method.observe(carry))


def observed(trial: Any) -> Any:
    """The sample in what `stepped` and `begun` return."""
    return trial[1]
