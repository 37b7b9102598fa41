"""Time transformations on Kepler's ellipse with e = 0.9: steps beside plain C, a thousand periods
beside heyoka if it is there.

    python tests/benchmarks/time_transformations.py [--quick] [--out results.json]
"""

import ctypes
import importlib
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import baseline
import harness
import numpy as np
from stepping import Native, agreeing, measure

import liemech as lm
from liemech.rooms.fictive_time.clocked import Clocked
from liemech.tableaus import KAHAN_LI8, STRANG, SplittingTableau

SOURCE = Path(__file__).with_name("time_transformations.c")
KEPLER = lm.Kepler()
ORBIT = KEPLER.pericentre(0.9)
PERIODS = 1000
POWER = lm.time_scales.DistancePower(1.5)
LOGARITHMIC, POWERS = lm.LogarithmicHamiltonian(KEPLER), lm.TimeTransformed(KEPLER, POWER)

VERLET, EIGHT = STRANG.exchanged, SplittingTableau.of(KAHAN_LI8).exchanged
CONTROLLED = lm.ReversibleController(lm.StormerVerlet(), POWER)
STEPS = {
    "logarithmic, Verlet": ("logarithmic", VERLET, LOGARITHMIC, lm.Splitting(tableau=VERLET), 0.01),
    "logarithmic, Kahan-Li 8": ("logarithmic", EIGHT, LOGARITHMIC, lm.Splitting(tableau=EIGHT), 0.3),
    "adaptive Verlet": ("adaptive", VERLET, POWERS, lm.AdaptiveVerlet(), 0.01),
    "reversible controller": ("controlled", VERLET, Clocked(KEPLER, POWER), CONTROLLED, 0.01),
}


class C:
    """The C of a step, compiled for its coefficients."""

    def __init__(self, library: Any, name: str, start: Any, h: float) -> None:
        self.advance, self.h = getattr(library, f"advance_{name}"), ctypes.c_double(h)
        self.start = np.array([x for part in start.parts.values() for x in np.ravel(np.array(part))])

    def __call__(self, steps: int) -> np.ndarray:
        state = self.start.copy()
        self.advance(ctypes.c_void_p(state.ctypes.data), ctypes.c_double(POWER.power), self.h, ctypes.c_long(steps))
        return state


def library(tableau: SplittingTableau, contraction: str, folder: Path) -> Any:
    """The C of a tableau; None without a compiler."""
    rows = {"KICKS": baseline.listed(tableau.kicks), "DRIFTS": baseline.listed(tableau.drifts)}
    return baseline.plain_c(SOURCE, {"STAGES": len(tableau.drifts), **rows}, contraction, folder)


def steps_beside_c(repetitions: int, duration: float) -> list[dict[str, Any]]:
    """ns a step: liemech with ordinary and with compensated sums, and C without and with fused multiply-add."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for row, (name, tableau, system, method, h) in STEPS.items():
            start = system.extended(ORBIT, 0.0)
            runs: dict[str, Any] = {"liemech": Native(system, method, start, h)}
            for contraction in ("off", "fast"):
                built = library(tableau, contraction, Path(folder))
                if built is not None:
                    runs[f"C {contraction}"] = C(built, name, start, h)
            agreeing(runs, 1e-11)
            runs["compensated"] = Native(system, method, start, h, compensate=None)
            times = measure(runs, repetitions, duration)
            rows.append(
                {
                    "step": row,
                    "ns": {key: timing.best for key, timing in times.items()},
                    "ratios": {key: times["liemech"].over(t) for key, t in times.items() if key.startswith("C")},
                }
            )
    columns = ["step", *rows[0]["ns"], *[f"ratio {key}" for key in rows[0]["ratios"]]]
    harness.table(
        "a step beside C: ns, best, wanted: at most 1.1 times C without contraction",
        columns,
        [[r["step"], *r["ns"].values(), *r["ratios"].values()] for r in rows],
    )
    return rows


# ------------------------------------------------------------------ a thousand periods


def best(run: Callable[[], np.ndarray], repetitions: int) -> tuple[float, float]:
    """Seconds of a call, the best one, and the error of the place."""
    spent = []
    for _ in range(repetitions):
        begin = time.perf_counter()
        end = run()
        spent.append(time.perf_counter() - begin)
    return min(spent), float(np.abs(end - np.array(ORBIT.q)).max())


def ours(system: Any, method: lm.Method, h: float, compensated: bool | None) -> Callable[[], np.ndarray]:
    def run() -> np.ndarray:
        t_end = 2.0 * np.pi * PERIODS
        options = {"every": 10**9, "compiled": True, "progress": False, "compensated": compensated}
        return lm.integrate(system, method, ORBIT, h=h, t_end=t_end, **options).q[-1]  # type: ignore[arg-type]

    return run


def heyoka(tolerance: float) -> Callable[[], np.ndarray]:
    hy: Any = importlib.import_module("heyoka")
    x, y, u, v = hy.make_vars("x", "y", "u", "v")
    pull = (x * x + y * y) ** -1.5
    start = [*ORBIT.q, *ORBIT.p]
    integrator = hy.taylor_adaptive([(x, u), (y, v), (u, -x * pull), (v, -y * pull)], start, tol=tolerance)

    def run() -> np.ndarray:
        integrator.time = 0.0
        integrator.state[:] = start
        integrator.propagate_until(2.0 * np.pi * PERIODS)
        return integrator.state[:2].copy()

    return run


COARSE = {
    "logarithmic, Kahan-Li 8": (LOGARITHMIC, lm.Splitting(tableau=EIGHT), None),
    "the same, ordinary sums": (LOGARITHMIC, lm.Splitting(tableau=EIGHT), False),
    "Kahan-Li 8 of adaptive Verlet": (POWERS, lm.Composition(lm.AdaptiveVerlet(), order=8), None),
    "controller of Splitting(order=8)": (KEPLER, lm.ReversibleController(lm.Splitting(order=8), POWER), None),
    "Splitting(order=8), fixed steps": (KEPLER, lm.Splitting(order=8), None),
}


def equal_steps(h: float) -> Callable[[], np.ndarray]:
    steps = round(2.0 * np.pi * PERIODS / h)

    def run() -> np.ndarray:
        h = 2.0 * np.pi * PERIODS / steps
        options = {"every": steps, "compiled": True, "progress": False}
        return lm.integrate(KEPLER, lm.Splitting(order=8), ORBIT, h=h, steps=steps, **options).q[-1]  # type: ignore[arg-type]

    return run


def thousand_periods(repetitions: int, quick: bool) -> list[dict[str, Any]]:
    """The fastest call of each that is within 1e-3 and 1e-6 of the place after a thousand periods."""
    curves: dict[str, list[tuple[float, float]]] = {}
    ratio = 0.5 if quick else 0.84
    for name, (system, method, compensated) in COARSE.items():
        alone = name.endswith("fixed steps")
        h, curve = (0.02 if alone else 1.2), []
        while not curve or (min(e for _, e in curve) > 1e-6 and len(curve) < 24):
            run = equal_steps(h) if alone else ours(system, method, h, compensated)
            try:
                run()  # compile
                curve.append(best(run, 1 if alone else repetitions))
            except lm.errors.IntegrationFailure:
                pass  # the step is too large
            h *= ratio
            if quick and alone and curve:
                break
        curves[name] = curve
    try:
        tolerances = 10.0 ** -np.arange(7, 16, 1.0 if quick else 0.25)
        curves["heyoka"] = [best(heyoka(tolerance), repetitions) for tolerance in tolerances]
    except ImportError:
        print("\nheyoka is not installed here")
    rows = []
    for name, curve in curves.items():
        within = {goal: [t for t, e in curve if e <= goal] for goal in (1e-3, 1e-6)}
        rows.append(
            {"method": name, "ms": {f"{g:g}": 1e3 * min(t) if t else None for g, t in within.items()}, "curve": curve}
        )
    harness.table(
        f"{PERIODS} periods, ms of a call within 1e-3 and 1e-6 of the place",
        ["method", "1e-3", "1e-6"],
        [[r["method"], *r["ms"].values()] for r in rows],
    )
    return rows


def main() -> None:
    out, timing = harness.options(__doc__, "time_transformations_benchmark.json")
    quick = timing[0] < 100
    harness.write(out, {"steps": steps_beside_c(*timing), "periods": thousand_periods(2 if quick else 9, quick)})


if __name__ == "__main__":
    main()
