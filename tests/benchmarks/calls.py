"""What a call costs beside the steps it makes: microseconds of Python around native code.

    python tests/benchmarks/calls.py [--quick] [--out results.json]

Each line is the least of many repetitions: what the machine needs when nothing else runs.  `beyond`
leaves out what native code takes, which is clocked by itself.
"""

import math
import time
import timeit
from collections.abc import Callable
from typing import Any

import harness
import numpy as np

import liemech as lm
from liemech.compiler import kernel


def least(call: Callable[[], Any], repeat: int) -> float:
    """Microseconds of a call."""
    call()
    return min(timeit.repeat(call, number=3, repeat=repeat)) / 3 * 1e6


PARTS = ("mu",), ("mu", "g")

WARM = 1.5
"""Seconds of this process after which native code that is made when it pays is there."""


def in_native_code(call: Callable[[], Any]) -> float:
    """Microseconds of a call that are native code."""
    kernels, spent = [(k, k.call) for k in kernel.alive()], [0.0]

    def timed(run: Callable[[bytes], None]) -> Callable[[bytes], None]:
        def call(block: bytes) -> None:
            begun = time.perf_counter()
            run(block)
            spent[0] += time.perf_counter() - begun

        return call

    for k, run in kernels:
        k.call = timed(run)
    least = math.inf
    for _ in range(200):
        spent[0] = 0.0
        call()
        least = min(least, spent[0])
    for k, run in kernels:
        k.call = run
    return 1e6 * least


def main() -> None:
    out, (repetitions, _) = harness.options(__doc__, "calls.json")
    repeat = 100 * repetitions
    body, method = lm.RigidBody([1.0, 1.5, 2.0]), lm.RKMK(order=4)
    start = body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
    plan = lm.Plan(body, method, 0.1, compiled=True)
    carry, run, stepper = plan.begin(start), plan.run(start, steps=400), plan.stepper(start)
    adaptive = lm.Plan(body, lm.RKMK(order=5), rtol=1e-9, compiled=True)
    times = np.linspace(0.0, 20.0, 201)
    end, ten = np.array([10.0]), np.linspace(0.0, 10.0, 11)
    sampled = lm.Plan(body, lm.RKMK(order=5), rtol=1e-9, record=("mu", "g"), compiled=True)
    parts = [lm.Plan(body, method, 0.1, record=names, compiled=True) for names in PARTS]
    pendulum, splitting = lm.SphericalPendulum(), lm.KickDrift(order=6)
    top = lm.models.HeavyTop([1.0, 1.2, 0.6], 1.0, [0.0, 0.0, 0.5])
    spun = top.state(mu=[0.1, 0.2, 3.0], g=np.eye(3))
    kicked = lm.Plan(top, splitting, 0.05, compiled=True)
    swing = pendulum.state([1.0, 0.0, 0.0], [0.0, 0.5, 0.3])
    held = lm.Plan(pendulum, lm.RATTLE(), 0.05, compiled=True)
    orbit = lm.Kepler()
    fall = orbit.state([0.1, 0.0], [0.0, 19.0**0.5])
    controlled = lm.ReversibleController(lm.Splitting(order=8), lm.time_scales.DistancePower(1.5))
    fictive = lm.Plan(orbit, controlled, 0.1, compiled=True)
    series = lm.Plan(orbit, lm.Taylor(18), rtol=1e-9, atol=1e-9, record=("q", "p"), compiled=True)
    grid = np.linspace(0.0, 60.0, 11)
    calls: dict[str, tuple[Callable[[], Any], float]] = {
        "plan.step, 200 steps": (lambda: plan.step(carry, 200), 0.0),
        "plan.step, one step": (lambda: plan.step(carry), 0.0),
        "stepper.step, one step": (stepper.step, 3.0),
        "the same, and its mu": (lambda: (stepper.step(), stepper.mu), 3.0),
        "plan.run, 200 steps and samples": (lambda: plan.run(start, steps=200), 10.0),
        "the same, and its t, mu, g": (
            lambda: (run := plan.run(start, steps=200), run.t, run.mu, run.g),
            0.0,
        ),
        "record=('mu',), and its mu": (lambda: parts[0].run(start, steps=200).mu, 10.0),
        "record=('mu', 'g'), and both": (
            lambda: (run := parts[1].run(start, steps=200), run.mu, run.g),
            10.0,
        ),
        "a new start": (
            lambda: plan.run(body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3)), steps=200),
            0.0,
        ),
        "a heavy top, kicks and drifts": (lambda: kicked.run(spun, steps=20), 0.0),
        "a pendulum, RATTLE": (lambda: held.run(swing, steps=20), 0.0),
        "integrate, the same": (
            lambda: lm.integrate(body, method, start, h=0.1, steps=200, compiled=True),
            30.0,
        ),
        "integrate, a new body": (
            lambda: lm.integrate(lm.RigidBody([1.0, 1.5, 2.0]), method, start, h=0.1, steps=200),
            0.0,
        ),
        "plan.run, adaptive to t = 10": (lambda: adaptive.run(start, t_end=10.0), 0.0),
        "the same, only the end": (lambda: sampled.run(start, t_end=10.0, t_eval=end).mu, 30.0),
        "the same at eleven times": (lambda: sampled.run(start, t_end=10.0, t_eval=ten).mu, 30.0),
        "Kepler, Taylor 18, adaptive": (lambda: series.run(fall, t_end=60.0, t_eval=grid).q, 0.0),
        "Kepler in fictive time": (lambda: fictive.run(fall, t_end=60.0, t_eval=grid).q, 0.0),
        "RigidBody(...)": (lambda: lm.RigidBody([1.0, 1.5, 2.0]), 5.0),
        "body.state(mu, g)": (lambda: body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3)), 5.0),
        "body.exact, 201 times": (lambda: body.exact(start, times), 60.0),
        "run.drift, 400 samples": (run.drift, 1000.0),
        "ExactMoserVeselov.of": (lambda: lm.ExactMoserVeselov.of(body, start, 0.1), 100.0),
    }
    results = {}
    print(f"{'call':<36}{'us':>10}{'beyond the steps':>20}{'goal':>8}")
    for name, (call, goal) in calls.items():
        begun = time.process_time()
        while time.process_time() - begun < WARM:
            call()
        beyond = least(call, max(5, int(min(repeat, 2e5 / max(1.0, least(call, 3))))))
        spent, steps = beyond, in_native_code(call)
        beyond -= steps
        results[name] = {"us": spent, "beyond": beyond, "goal": goal}
        print(f"{name:<36}{spent:>10.1f}{beyond:>20.1f}{goal or '':>8}")
    harness.write(out, results)


if __name__ == "__main__":
    main()
