"""Adaptive ensembles: side by side in lanes, one after another in a loop, and heyoka's batches.

    python tests/benchmarks/adaptive_ensembles.py [bodies ...]

Microseconds of a body, medians of runs in turn, only the end kept; one thread.  heyoka is of another kind, Taylor's
method without structure: its column is to the same tolerance, not to the same error.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import liemech as lm
from liemech.compiler import kernel

FEW, REPETITIONS = 100, 7
MOMENTS = np.array([1.0, 1.5, 2.0])


def cases(n: int) -> dict[str, tuple[Any, Any, Any, float, float, Any]]:
    """System, starts, method, last time, tolerance, and the equations for heyoka with their starts."""
    rng = np.random.default_rng(1)
    body, top = (lm.RigidBody(MOMENTS), lm.models.HeavyTop(MOMENTS, weight=1.0, centre=[0.0, 0.0, 1.0]))
    kepler, mu, e = lm.Kepler(), rng.normal(size=(n, 3)), rng.uniform(0.0, 0.7, size=n)
    q = np.stack([1.0 - e, 0.0 * e], axis=1)
    p = np.stack([0.0 * e, np.sqrt((1.0 + e) / (1.0 - e))], axis=1)
    order5, g = lm.RKMK(order=5), np.broadcast_to(np.eye(3), (n, 3, 3))
    return {
        "free body, mu": (body, body.state(mu=mu), order5, 20.0, 1e-6, (turning, mu)),
        "free body, mu, to 1e-10": (body, body.state(mu=mu), order5, 20.0, 1e-10, (turning, mu)),
        "free body, mu, Taylor 13": (
            body, body.state(mu=mu), lm.Taylor(order=13), 20.0, 1e-10, (turning, mu),
        ),
        "heavy top": (top, top.state(mu=mu, g=g), order5, 10.0, 1e-9, None),
        "Kepler, eccentricity to 0.7": (
            kepler, kepler.state(q=q, p=p), order5, 20.0, 1e-9, (falling, np.hstack([q, p])),
        ),
        "Kepler, Taylor 18": (
            kepler, kepler.state(q=q, p=p), lm.Taylor(order=18), 20.0, 1e-12,
            (falling, np.hstack([q, p])),
        ),
    }  # fmt: skip


def turning(hy: Any) -> list[Any]:
    """mu' = mu x J^-1 mu."""
    a, b, c = hy.make_vars("a", "b", "c")
    x, y, z = a / MOMENTS[0], b / MOMENTS[1], c / MOMENTS[2]
    return [(a, b * z - c * y), (b, c * x - a * z), (c, a * y - b * x)]


def falling(hy: Any) -> list[Any]:
    """q'' = -q / |q|^3."""
    x, y, u, v = hy.make_vars("x", "y", "u", "v")
    w = (x * x + y * y) ** -1.5
    return [(x, u), (y, v), (u, -x * w), (v, -y * w)]


def heyoka(equations: Any, starts: np.ndarray, t_end: float, tolerance: float) -> Any:
    """All bodies, a register of them at a time; None if heyoka is not installed."""
    try:
        import heyoka as hy
    except ImportError:
        return None
    width = hy.recommended_simd_size()
    columns = np.ascontiguousarray(starts[: len(starts) // width * width].T)
    ta = hy.taylor_adaptive_batch(equations(hy), columns[:, :width].copy(), tol=tolerance)

    def run() -> float:
        for i in range(0, columns.shape[1], width):
            ta.state[:] = columns[:, i : i + width]
            ta.set_time(0.0)
            ta.propagate_until(t_end)
        return columns.shape[1]

    return run


def timed(run: Callable[[], Any]) -> tuple[float, float]:
    """Seconds of a call, and of the native code in it."""
    spent, native = [0.0], kernel.Kernel.run

    def watched(self: Any, *args: Any) -> None:
        begun = time.perf_counter()
        native(self, *args)
        spent[0] += time.perf_counter() - begun

    kernel.Kernel.run = watched  # type: ignore[method-assign]
    begun = time.perf_counter()
    run()
    whole, kernel.Kernel.run = time.perf_counter() - begun, native  # type: ignore[method-assign]
    return whole, spent[0]


def measure(n: int) -> None:
    """The rows of so many bodies."""
    for name, (system, starts, method, t_end, tolerance, equations) in cases(n).items():
        plan = lm.Plan(system, method, rtol=tolerance, atol=tolerance, compiled=True, progress=False)
        few = min(n, FEW)
        singles = [lm.systems.system.member(starts, i) for i in range(few)]

        def loop(plan: Any = plan, singles: Any = singles, t_end: float = t_end) -> None:
            for start in singles:
                plan.run(start, t_end=t_end, t_eval=[t_end])

        def side_by_side(plan: Any = plan, starts: Any = starts, t_end: float = t_end) -> None:
            plan.run(starts, t_end=t_end)

        other = None if equations is None else heyoka(*equations, t_end, tolerance)
        runs = {"lanes": (side_by_side, n), "loop": (loop, few)}
        if other is not None:
            runs["heyoka"] = other, n
        found: dict[str, list[tuple[float, float]]] = {key: [] for key in runs}
        for repetition in range(REPETITIONS + 1):
            for key, (run, bodies) in runs.items():
                took = timed(run)
                if repetition:
                    found[key].append((1e6 * took[0] / bodies, 1e6 * took[1] / bodies))
        lanes, alone = (np.median(found[key], axis=0) for key in ("lanes", "loop"))
        theirs = f"{np.median(found['heyoka'], axis=0)[0]:.0f}" if other else "-"
        print(
            f"| {name} | {n} | {lanes[0]:.0f} | {lanes[1]:.0f} | {alone[0]:.0f} "
            f"| {alone[0] / lanes[0]:.1f} | {theirs} |",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bodies", type=int, nargs="*", default=[1000, 10_000])
    print(f"| motion | bodies | ensemble | its native code | loop | beside ensemble | heyoka |\n|{' --- |' * 7}")
    for n in parser.parse_args().bodies:
        measure(n)


if __name__ == "__main__":
    main()
