"""`liemech bench module:system`: what a step of a system of one's own costs, and how accurate it is."""

from __future__ import annotations

import json
import sys
import time
import timeit
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

import liemech as lm

from ..checks.points.sample_states import random_state
from ..rooms.at_work.measured_orders import order_of
from .constructors import imported, read
from .options import Parser, count, duration, number, short

HALVINGS = 5


def bench(arguments: Sequence[str]) -> int:
    """The command.  Returns the exit status: 0, 1 if a run failed."""
    parser = Parser(
        prog="liemech bench",
        description="Measure a system: nanoseconds for a step, seconds to compile it, and the order that is observed.",
        epilog="examples:\n  liemech bench my_module:system --start my_module:start\n"
        "  liemech bench 'HeavyTop([1.0, 1.5, 0.7], 1.3, [0.6, 0.0, 0.8])' --method 'KickDrift(order=4)'",
    )
    add = parser.add_argument
    add(
        "system",
        metavar="module:system",
        help="a system of yours, a class or an object; or one of the library with its arguments",
    )
    add("--start", metavar="module:start", help="where it starts, an object of yours; a random state if not given")
    add("--method", default="RKMK(order=4)", metavar="METHOD", help="the method (RKMK(order=4))")
    add("--h", type=number, default=0.01, metavar="H", help="length of a step (0.01)")
    add("--steps", type=count, default=100_000, metavar="N", help="number of steps (100000)")
    add("--json", action="store_true", help="print the numbers as JSON")
    options = parser.parse_args(arguments)
    system = read(options.system, lm.System, "argument module:system")
    method = read(options.method, lm.Method, "argument --method")
    method.require(system)
    start = _start(options.start, system)
    try:
        measurements = measured(system, method, start, options.h, options.steps)
    except lm.errors.IntegrationFailure as failure:
        print(f"liemech: {failure}", file=sys.stderr)
        return 1
    print(json.dumps(measurements) if options.json else _report(measurements))
    return 0


def measured(system: Any, method: Any, start: Any, h: float, steps: int) -> dict[str, Any]:
    """The cost of steps, and how their error falls: seconds of the first call beyond a step, ns a step, the order."""

    def run(h: float, steps: int) -> Any:
        return lm.integrate(system, method, start, h=h, steps=steps, every=steps, progress=False)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", lm.errors.NotCompiledWarning)
        started = time.perf_counter()
        first = lm.integrate(system, method, start, h=h, steps=1, compiled=None, progress=False)
        result = run(h, steps)
        whole = time.perf_counter() - started
        least = min(timeit.repeat(lambda: run(h, steps), number=1, repeat=3))
        counts = [2**k for k in range(3, 3 + HALVINGS)]
        t = 8.0 * h
        ends = [_flat(run(t / n, n)) for n in (*counts, 4 * counts[-1])]
    errors = [float(np.abs(end - ends[-1]).max()) for end in ends[:-1]]
    return {
        "system": repr(system),
        "method": repr(method),
        "ns per step": 1e9 * least / steps,
        "seconds before": max(0.0, whole - least),
        "compiled": bool(result.compiled),
        "order": order_of([t / n for n in counts], errors),
        "parts": list(first.states),
    }


def _start(text: str | None, system: Any) -> Any:
    if text is None:
        state = random_state(system, np.random.default_rng(0))
        return system.state(**{name: np.asarray(x) for name, x in state.parts.items() if x is not None})
    module, _, name = text.rpartition(":")
    start = getattr(imported(module, "argument --start"), name, None) if module else None
    if not isinstance(start, lm.State):
        raise lm.errors.InvalidInput(
            f"argument --start: {text!r} is no state; give module:start, made by system.state(...)"
        )
    return start


def _flat(run: Any) -> np.ndarray:
    return np.concatenate([np.ravel(rows[-1]) for rows in run.states.values()])


def _report(found: dict[str, Any]) -> str:
    how = "native code" if found["compiled"] else "plain Python"
    order = "not seen: errors do not fall; take a larger --h" if found["order"] is None else f"{found['order']:.2f}"
    return "\n".join(
        [
            found["system"] if len(found["system"]) <= 80 else found["system"][:77] + "...",
            f"  method    {found['method']}, {', '.join(found['parts'])} recorded",
            f"  a step    {duration(1e-9 * found['ns per step'])}, {how}",
            f"  before    {short(found['seconds before'])} s to prepare and compile (less if the kernel is on disk)",
            f"  order     {order}",
        ]
    )
