"""What a call costs beside the steps it makes: microseconds of Python around native code.

    python tests/benchmarks/calls.py [--quick] [--out results.json]

Each line is the least of many repetitions: what the machine needs when nothing else runs.
"""

import timeit
from collections.abc import Callable
from typing import Any

import harness
import numpy as np

import liemech as lm


def least(call: Callable[[], Any], repeat: int) -> float:
    """Microseconds of a call."""
    call()
    return min(timeit.repeat(call, number=3, repeat=repeat)) / 3 * 1e6


def main() -> None:
    out, (repetitions, _) = harness.options(__doc__, "calls.json")
    repeat = 100 * repetitions
    body, method = lm.RigidBody([1.0, 1.5, 2.0]), lm.RKMK(order=4)
    start = body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
    plan = lm.Plan(body, method, 0.1, compiled=True)
    carry, run = plan.begin(start), plan.run(start, steps=400)
    adaptive = lm.Plan(body, lm.RKMK(order=5), rtol=1e-9, compiled=True)
    times = np.linspace(0.0, 20.0, 201)
    calls: dict[str, tuple[Callable[[], Any], float]] = {
        "plan.step, 200 steps": (lambda: plan.step(carry, 200), 0.0),
        "plan.step, one step": (lambda: plan.step(carry), 3.0),
        "plan.run, 200 steps and samples": (lambda: plan.run(start, steps=200), 10.0),
        "the same, and its t, mu, g": (
            lambda: (run := plan.run(start, steps=200), run.t, run.mu, run.g),
            0.0,
        ),
        "integrate, the same": (
            lambda: lm.integrate(body, method, start, h=0.1, steps=200, compiled=True),
            30.0,
        ),
        "integrate, a new body": (
            lambda: lm.integrate(lm.RigidBody([1.0, 1.5, 2.0]), method, start, h=0.1, steps=200),
            0.0,
        ),
        "plan.run, adaptive to t = 10": (lambda: adaptive.run(start, t_end=10.0), 0.0),
        "the same, only the end": (lambda: adaptive.run(start, t_end=10.0, t_eval=[10.0]), 0.0),
        "RigidBody(...)": (lambda: lm.RigidBody([1.0, 1.5, 2.0]), 5.0),
        "body.state(mu, g)": (lambda: body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3)), 5.0),
        "body.exact, 201 times": (lambda: body.exact(start, times), 60.0),
        "run.drift, 400 samples": (run.drift, 1000.0),
        "ExactMoserVeselov.of": (lambda: lm.ExactMoserVeselov.of(body, start, 0.1), 100.0),
    }
    results = {}
    native = None
    print(f"{'call':<36}{'us':>10}{'beyond the steps':>20}{'goal':>8}")
    for name, (call, goal) in calls.items():
        spent = least(call, max(5, int(min(repeat, 2e5 / max(1.0, least(call, 3))))))
        native = spent if native is None else native
        beyond = spent - native if goal in (10.0, 30.0) else spent
        results[name] = {"us": spent, "beyond": beyond, "goal": goal}
        print(f"{name:<36}{spent:>10.1f}{beyond:>20.1f}{goal or '':>8}")
    harness.write(out, results)


if __name__ == "__main__":
    main()
