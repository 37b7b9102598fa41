"""Throughput of ensembles: 10^5 bodies beside the C++ in SIMD lanes, attitudes beside momenta
alone, two workers beside one.

    python tests/benchmarks/throughput.py [--quick] [--out results.json]

Times are those of the clock, of whole calls from given starts to the last states; runs that are
compared take turns, and ratios are medians over neighbouring repetitions.  Let nothing else run.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import baseline
import harness
import numpy as np

import liemech as lm

BODIES, STEP = 99_840, 0.05  # a multiple of 24 lanes and of 16
METHODS = {"RKMK4": lm.RKMK(order=4), "Algorithm 1, Cayley": lm.CovariantVariational(lm.Cayley())}
OPPONENTS = {
    "RKMK4": ("RKMK4",),
    "Algorithm 1, Cayley": ("Algorithm 1, Cayley", "Algorithm 1, Cayley, one unknown"),
}
GOALS = {20: 0.85, 200: 0.9}


def timed(runs: dict[str, Callable[[], Any]], repetitions: int) -> dict[str, harness.Timing]:
    """Seconds of calls in turn."""
    spent: dict[str, list[float]] = {name: [] for name in runs}
    for run in runs.values():
        run()
    for _ in range(repetitions):
        for name, run in runs.items():
            begun = time.perf_counter()
            run()
            spent[name].append(time.perf_counter() - begun)
    return {name: harness.Timing(np.array(x)) for name, x in spent.items()}


def ours(
    method: lm.Method, bodies: int, steps: int, workers: int = 1, attitude: bool = False
) -> Callable[[], Any]:
    """A call of liemech."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    mu = np.random.default_rng(0).normal(size=(bodies, 3))
    start = body.state(mu, np.broadcast_to(np.eye(3), (bodies, 3, 3)) if attitude else None)
    plan = lm.Plan(
        body,
        method,
        STEP,
        every=steps,
        compiled=True,
        progress=False,
        workers=workers,
        compensated=False,
    )
    return lambda: plan.run(start, steps=steps)


def theirs(build: baseline.Baseline, name: str, steps: int, attitude: bool) -> Callable[[], Any]:
    """The same in C++: its arrays are laid out as its lanes want them, and copied before each run."""
    mu = np.ascontiguousarray(np.random.default_rng(0).normal(size=(BODIES, 3)).T)
    g = np.ascontiguousarray(np.eye(3).reshape(9, 1).repeat(BODIES, axis=1)) if attitude else None
    inertia, lanes = np.array([1.0, 1.5, 2.0]), build.lanes()

    def run() -> None:
        build.advance(
            baseline.METHODS[name],
            lanes,
            mu.copy(),
            None if g is None else g.copy(),
            inertia,
            STEP,
            steps,
        )

    return run


def main() -> None:
    out, (repetitions, _) = harness.options(__doc__, "throughput.json")
    repetitions = max(5, repetitions // 10)
    results: dict[str, Any] = {}
    build = baseline.build().get("off")
    print(f"{'method':<22}{'records':<8}{'steps':>6}{'M steps/s':>12}{'of C++':>12}{'goal':>6}")
    for name, method in METHODS.items():
        for attitude in (False, True):
            for steps, goal in GOALS.items():
                runs = {"liemech": ours(method, BODIES, steps, attitude=attitude)}
                if build is not None:
                    runs |= {
                        opponent: theirs(build, opponent, steps, attitude)
                        for opponent in OPPONENTS[name]
                    }
                found = timed(runs, repetitions)
                rate = BODIES * steps / found["liemech"].best / 1e6
                shares = {
                    other: 1.0 / found["liemech"].over(found[other])
                    for other in runs
                    if other != "liemech"
                }
                records = "mu, g" if attitude else "mu"
                results[f"{name}, {records}, {steps}"] = {"rate": rate, "of": shares, "goal": goal}
                told = " ".join(f"{x:.2f}" for x in shares.values()) or "-"
                print(
                    f"{name:<22}{records:<8}{steps:>6}{rate:>12.1f}{told:>12}{goal:>6}", flush=True
                )
    print("(of Algorithm 1 the second number is beside the C++ that solves for one unknown)\n")
    for bodies, steps in ((17, 1000), (1000, 1000), (BODIES, 20), (BODIES, 200)):
        one, two = (
            ours(METHODS["Algorithm 1, Cayley"], bodies, steps, workers) for workers in (1, 2)
        )
        found = timed({"one": one, "two": two}, repetitions)
        gain = found["one"].over(found["two"])
        results[f"two workers, {bodies} bodies, {steps} steps"] = gain
        print(
            f"two workers, {bodies:>6} bodies, {steps:>4} steps: {gain:.2f} times as fast as one",
            flush=True,
        )
    harness.write(out, results)


if __name__ == "__main__":
    main()
