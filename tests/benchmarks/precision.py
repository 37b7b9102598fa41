"""What 31 digits cost: a step in numbers of two doubles beside one in ordinary numbers.

python tests/benchmarks/precision.py [--quick] [--out results.json]
"""

import statistics
import time
from typing import Any

import harness
import numpy as np

import liemech as lm

BODY, TOP = (lm.RigidBody([1.0, 1.6, 2.3]), lm.models.LagrangeTop(transverse=1.0, axial=0.5, weight=1.0, length=1.0))
GALAXY, ROD = lm.models.HenonHeiles(), lm.SphericalPendulum()
SCENES = {
    "free body, momentum": (BODY, BODY.state([0.3, 0.8, -0.5]), 0.1),
    "free body, attitude too": (BODY, BODY.state([0.3, 0.8, -0.5], np.eye(3)), 0.1),
    "Lagrange top": (TOP, TOP.state([0.1, 0.2, 1.5], lm.SO3().exp([0.3, 0.0, 0.0])), 0.02),
    "galaxy": (GALAXY, GALAXY.state([0.0, 0.1], [0.5, 0.0]), 0.1),
    "rod": (ROD, ROD.state([0.0, 0.0, -1.0], [0.4, 1.5, 0.0]), 0.05),
}
CASES = [
    *((lm.CovariantVariational(r), name) for r in (lm.Cayley(), lm.Exponential()) for name in list(SCENES)[:2]),
    (lm.RKMK(4), "free body, momentum"),
    (lm.LieVerlet(lm.Cayley()), "Lagrange top"),
    (lm.StormerVerlet(), "galaxy"),
    (lm.Splitting(order=8), "galaxy"),
    (lm.RATTLE(), "rod"),
]


def measured(method: lm.Method, scene: str, repetitions: int, duration: float) -> dict[str, Any]:
    """A row: nanoseconds of the processor a step in both kinds of numbers, medians, and the median
    of their ratios, taken in turn.
    """
    system, start, h = SCENES[scene]
    seconds: dict[str, list[float]] = {"double": [], "double-double": []}
    plans, counts = {}, {}
    for digits in seconds:
        plans[digits] = plan = lm.Plan(system, method, h, every=10**9, precision=digits, compiled=True, progress=False)
        plan.run(start, steps=10)
        counts[digits] = 1000
        while (spent := spent_on(plan, start, counts[digits])) < duration:
            counts[digits] = int(counts[digits] * max(2.0, 1.2 * duration / max(spent, 1e-6)))
    for _ in range(repetitions):
        for digits, plan in plans.items():
            n = counts[digits]
            seconds[digits].append(spent_on(plan, start, n) / n)
    ratios = [b / a for a, b in zip(*seconds.values(), strict=True)]
    times = {digits: 1e9 * statistics.median(x) for digits, x in seconds.items()}
    return {"method": method.name, "scene": scene, "ratio": statistics.median(ratios), **times}


def spent_on(plan: lm.Plan, start: Any, steps: int) -> float:
    """Seconds of the processor for a run: others on the machine do not count."""
    begun = time.thread_time()
    plan.run(start, steps=steps)
    return time.thread_time() - begun


def main() -> None:
    out, (repetitions, _) = harness.options(__doc__, "precision_benchmark.json")
    duration = 0.02  # a call takes as long as hundreds of steps
    chosen = CASES if repetitions > 15 else CASES[:1]
    rows = [measured(method, scene, min(repetitions, 25), duration) for method, scene in chosen]
    harness.table(
        "ns a step",
        ["method", "scene", "double", "double-double", "ratio"],
        [
            [r["method"], r["scene"], f"{r['double']:.0f}", f"{r['double-double']:.0f}", f"{r['ratio']:.1f}"]
            for r in rows
        ],
    )
    harness.write(out, {"steps": rows})


if __name__ == "__main__":
    main()
