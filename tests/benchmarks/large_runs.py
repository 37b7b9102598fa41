"""Large runs: 10^8 steps of a body, 10^6 bodies, 10^4 calls, Ctrl-C in each of them, and what a tangent map costs.

    python tests/benchmarks/large_runs.py

Times are those of the processor, for machines that do other things too; ratios count.
"""

from __future__ import annotations

import os
import resource
import signal
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import liemech as lm

BODY = lm.RigidBody([1.0, 1.5, 2.0])
START = BODY.state(mu=[0.5, 0.0, 0.75**0.5])
MANY = BODY.state(mu=np.random.default_rng(0).normal(size=(10**6, 3)))
ALGORITHM_1: Any = dict(h=0.05, compiled=True, progress=False)


def megabytes() -> float:
    """The largest memory so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def seconds(run: Callable[[], Any], times: int = 1) -> float:
    """The least time of the processor that some runs took."""
    found = []
    for _ in range(times):
        begun = time.process_time()
        run()
        found.append(time.process_time() - begun)
    return min(found)


def one_body() -> None:
    plan = lm.Plan(BODY, lm.CovariantVariational(lm.Cayley()), every=10**6, **ALGORITHM_1)
    short, before = seconds(lambda: plan.run(START, steps=10**6), 7) / 1e6, megabytes()
    long = seconds(lambda: plan.run(START, steps=10**8)) / 1e8
    told = f"{1e9 * short:.1f} ns a step in 10^6 steps, {1e9 * long:.1f} in 10^8, ratio {long / short:.3f}"
    print(f"one body: {told}; memory {before:.0f} MB before, {megabytes():.0f} after", flush=True)


def many_calls() -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=4), **ALGORITHM_1)
    plan.run(START, steps=20)
    took = seconds(lambda: [plan.run(START, steps=20) for _ in range(10**4)])
    print(f"10^4 calls of plan.run, 20 steps: {took / 1e-2:.0f} us each")


def many_bodies() -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=4), every=100, **ALGORITHM_1)
    plan.run(BODY.state(mu=MANY.mu[:100]), steps=100)
    before = megabytes()
    took = seconds(lambda: plan.run(MANY, steps=100))
    told = f"{took:.1f} s, {1e8 / took / 1e6:.0f} M body-steps a second"
    print(f"10^6 bodies x 100 steps: {told}; {megabytes() - before:.0f} MB more")


def interrupted() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)  # shells ignore it in the background
    quick: Any = dict(compiled=True, progress=False)
    slow: Any = dict(compiled=False, progress=False)
    some, kepler = BODY.state(mu=MANY.mu[:1000]), lm.Kepler()
    planet = kepler.state(q=[0.6, 0.0], p=[0.0, 1.4])
    exact = lm.Plan(BODY, lm.CovariantVariational(lm.Cayley()), 0.05, every=10**6, **quick)
    rkmk = lm.Plan(BODY, lm.RKMK(order=4), 0.05, every=10**5, **quick)
    adaptive = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-9, **quick)
    controller = lm.ReversibleController(lm.StormerVerlet(), sigma=lm.time_scales.DistancePower(1.5))
    clocked = lm.Plan(kepler, controller, 0.01, every=10**5, **quick)
    times, product = np.linspace(0.0, 5e6, 1000), [("product", lambda t, s: s.mu[0] * s.mu[1])]
    runs: dict[str, Callable[[], Any]] = {
        "one body": lambda: exact.run(START, steps=10**10),
        "10^6 bodies": lambda: rkmk.run(MANY, steps=10**5),
        "10^6 bodies, 2 threads": lambda: rkmk.replace(workers=2).run(MANY, steps=10**5),
        "energies": lambda: rkmk.replace(record="energy").run(START, steps=10**9),
        "a function": lambda: rkmk.replace(record=product, every=1).run(START, steps=10**9),
        "t_eval": lambda: exact.run(START, steps=10**8, t_eval=times),
        "events": lambda: exact.replace(events=lambda t, s: s.mu[0]).run(START, steps=10**8),
        "tangent map": lambda: exact.tangent(START, steps=10**9),
        "plain Python": lambda: exact.replace(every=1, **slow).run(START, steps=10**8),
        "adaptive": lambda: adaptive.run(START, t_end=1e8, t_eval=[0.0, 1e8]),
        "adaptive, all steps": lambda: adaptive.run(START, t_end=1e8),
        "adaptive, a function": lambda: adaptive.replace(record=product).run(START, t_end=1e8),
        "adaptive, events": lambda: adaptive.replace(events=lambda t, s: s.mu[0]).run(START, t_end=1e7),
        "adaptive, 1000 bodies": lambda: adaptive.run(some, t_end=1e6),
        "adaptive, plain": lambda: adaptive.replace(**slow).run(START, t_end=1e7),
        "fictive time": lambda: clocked.run(planet, steps=10**9),
        "fictive time, t_end": lambda: clocked.run(planet, t_end=1e8),
    }  # fmt: skip
    for name, run in runs.items():
        sent: list[float] = []

        def press(sent: list[float] = sent) -> None:
            sent.append(time.perf_counter())
            os.kill(os.getpid(), signal.SIGINT)

        timer = threading.Timer(3.0, press)
        timer.start()
        try:
            run()
        except KeyboardInterrupt as stopped:  # before the first step one without a trajectory
            later = time.perf_counter() - sent[0]
            samples = len(getattr(stopped, "trajectory", ()))
            print(f"Ctrl-C, {name}: {later:.2f} s later {samples} samples", flush=True)
        else:
            timer.cancel()
            print(f"Ctrl-C, {name}: the run came to its end before")


def tangents() -> None:
    print("| motion | directions n | tangent map | n + 1 runs, one by one | n + 1 runs, an ensemble |")
    print("| --- | --- | --- | --- | --- |")
    top: Any = lm.models.HeavyTop([1.0, 1.0, 0.5], 1.0, [0.0, 0.0, 1.0])
    kepler = lm.Kepler()
    for name, system, method, start in (
        ("free body, RKMK4", BODY, lm.RKMK(order=4), BODY.state(mu=[0.5, 0.1, 0.8], g=np.eye(3))),
        ("heavy top, RKMK4", top, lm.RKMK(order=4), top.state(mu=[0.1, 0.2, 2.0], g=np.eye(3))),
        ("Kepler, Stormer-Verlet", kepler, lm.StormerVerlet(), kepler.state(q=[0.6, 0.0], p=[0.0, 1.4])),
        (
            "free body, Algorithm 1",
            BODY,
            lm.CovariantVariational(lm.Cayley()),
            BODY.state(mu=[0.5, 0.1, 0.8], g=np.eye(3)),
        ),
    ):
        plan, steps = lm.Plan(system, method, every=10**4, **ALGORITHM_1), 10**4
        n = plan.tangent(start, steps=1).tangent["start"].shape[-1]
        several = type(start)(*(None if x is None else np.array([x] * (n + 1)) for x in start.parts.values()))
        took = [
            seconds(run, 5)
            for run in (
                lambda: plan.tangent(start, steps=steps),  # noqa: B023
                lambda: plan.run(start, steps=steps),  # noqa: B023
                lambda: plan.run(several, steps=steps),  # noqa: B023
            )
        ]
        alone = took[1] * (n + 1)
        beside = f"{took[0] / alone:.2f} of it | {took[0] / took[2]:.2f} of it"
        print(f"| {name} | {n} | {1e9 * took[0] / steps:.0f} ns a step | {beside} |", flush=True)


if __name__ == "__main__":
    one_body()
    many_calls()
    many_bodies()
    tangents()
    interrupted()
