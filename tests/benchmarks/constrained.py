"""Constrained systems: a step of RATTLE beside plain C of the same step; time to error on the
spherical pendulum, beside heyoka.

    python tests/benchmarks/constrained.py [--quick] [--out results.json]
"""

import ctypes
import functools
import importlib
import itertools
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

SOURCE = Path(__file__).with_name("constrained.c")
SPHERE, CHAIN = (lm.SphericalPendulum(gravity=9.81), lm.models.ChainPendulum([1.0, 0.5], [1.0, 0.8], 9.81, dimension=2))
SWINGING = SPHERE.state([0.6, 0.0, -0.8], [0.4, 1.5, 0.3])
HANGING = CHAIN.consistent(
    CHAIN.hanging([np.sin(0.9), -np.cos(0.9), -np.sin(0.4), -np.cos(0.4)]), [0.2, 0.2, 0.5, -0.05]
)
PARAMETERS = {"sphere": [1.0, 1.0, 9.81], "closed": [1.0, 1.0, 9.81], "chain": [1.0, 0.5, 1.0, 0.8, 9.81]}
T_END, OUTPUTS, GOALS = 50.0, 100, (1e-3, 1e-6, 1e-9)
METHODS = {
    "RATTLE": lm.RATTLE(),
    "RATTLE, order 4": lm.Composition(lm.RATTLE(), order=4),
    "RATTLE, order 6": lm.Composition(lm.RATTLE(), order=6),
    "RATTLE, order 8": lm.Composition(lm.RATTLE(), order=8),
    "Lobatto 4": lm.LobattoPair(order=4),
    "Lobatto 6": lm.LobattoPair(order=6),
    "geodesics, order 2": lm.GeodesicSplitting(),
    "geodesics, order 4": lm.GeodesicSplitting(order=4),
    "geodesics, order 6": lm.GeodesicSplitting(order=6),
    "geodesics, order 8": lm.GeodesicSplitting(order=8),
}


class C:
    """A C function that makes steps, from a start."""

    def __init__(self, library: Any, name: str, system: Any, start: Any, h: float) -> None:
        self.advance, self.h = getattr(library, f"advance_{name}"), ctypes.c_double(h)
        self.start = np.array([*start.q, *start.p])
        self.arrays = [np.array(PARAMETERS[name]), np.array(system.multipliers(start.q, start.p))]

    def __call__(self, steps: int) -> np.ndarray:
        state = self.start.copy()
        parameters, guess = (ctypes.c_void_p(a.ctypes.data) for a in self.arrays)
        self.advance(ctypes.c_void_p(state.ctypes.data), parameters, self.h, ctypes.c_long(steps), guess)
        return state


def compiled(contraction: str, folder: Path, checked: bool = False) -> Any:
    """The C of both systems, with the checks of the library or without; None without a compiler."""
    return baseline.plain_c(SOURCE, {"CHECKED": int(checked)}, contraction, folder)


def steps_beside_c(repetitions: int, duration: float) -> list[dict[str, Any]]:
    """ns a step: liemech, and C without and with its checks, without and with fused multiply-add."""
    rows = []
    cases = (
        ("sphere", SPHERE, SWINGING, "sphere"),
        ("sphere, closed form", SPHERE, SWINGING, "closed"),
        ("chain", CHAIN, HANGING, "chain"),
    )
    with tempfile.TemporaryDirectory() as folder:
        for title, system, start, name in cases:
            runs: dict[str, Any] = {"liemech": Native(system, lm.RATTLE(), start, 0.01)}
            for checked, contraction in itertools.product((True, False), ("off", "fast")):
                library = compiled(contraction, Path(folder), checked)
                if library is not None:
                    same = ", checks" if checked else ""
                    runs[f"C {contraction}{same}"] = C(library, name, system, start, 0.01)
            agreeing(runs, 1e-12)
            times = measure(runs, repetitions, duration)
            ratios = {key: times["liemech"].over(t) for key, t in times.items() if key != "liemech"}
            rows.append({"system": title, "ns": {key: t.best for key, t in times.items()}, "ratios": ratios})
    columns = ["RATTLE on", *rows[0]["ns"], *[f"ratio {key}" for key in rows[0]["ratios"]]]
    harness.table(
        "a step beside C: ns, best", columns, [[r["system"], *r["ns"].values(), *r["ratios"].values()] for r in rows]
    )
    return rows


def time_to_error(repetitions: int) -> list[dict[str, Any]]:
    """The least time to T = 50 with 100 outputs whose positions err by less than 1e-3, 1e-6, 1e-9: of a prepared run,
    and of its native steps alone; processor time, so that other processes count little.
    """
    fine = lm.integrate(
        SPHERE, METHODS["geodesics, order 8"], SWINGING, h=T_END / 8000, steps=8000, every=80, progress=False
    )
    rows = []
    for name, method in METHODS.items():
        found: dict[float, tuple[float, float] | None] = dict.fromkeys(GOALS)
        for doublings in np.arange(0.0, 9.0, 0.25):
            every = max(1, round(2.0**doublings))
            steps = OUTPUTS * every
            options: dict[str, Any] = {
                "h": T_END / steps,
                "steps": steps,
                "every": every,
                "compiled": True,
                "progress": False,
            }
            try:
                run = lm.integrate(SPHERE, method, SWINGING, **options)
            except lm.errors.IntegrationFailure:
                continue
            error = np.abs(run.q - fine.q).max()
            wanted = [goal for goal, best in found.items() if best is None and error <= goal]
            if not wanted:
                continue
            plan = lm.Plan(SPHERE, method, h=T_END / steps, every=every, compiled=True, progress=False)
            native = Native(SPHERE, method, SWINGING, T_END / steps, None)
            call = least(functools.partial(plan.run, SWINGING, steps=steps), repetitions)
            alone = least(functools.partial(native, steps), repetitions) - least(
                functools.partial(native, 1), repetitions
            )
            found |= dict.fromkeys(wanted, (call, alone))
        for i, what in enumerate(("call", "steps")):
            rows.append(
                {"method": f"{name}, {what}", "us": {f"{goal:.0e}": best and best[i] for goal, best in found.items()}}
            )
    rows += heyoka(fine.q, repetitions)
    columns = ["method", *rows[0]["us"]]
    harness.table(
        "time to error, T = 50, us with 100 outputs", columns, [[r["method"], *r["us"].values()] for r in rows]
    )
    return rows


def least(run: Callable[[], Any], repetitions: int) -> float:
    """The least processor time of a call, us."""
    spent = []
    for _ in range(repetitions):
        begin = time.process_time()
        run()
        spent.append(1e6 * (time.process_time() - begin))
    return min(spent)


def heyoka(exact: np.ndarray, repetitions: int) -> list[dict[str, Any]]:
    """The reduced equation by a compiled Taylor method, if it is installed."""
    try:
        hy: Any = importlib.import_module("heyoka")
    except ImportError:
        return []
    q, v, g = hy.make_vars("x", "y", "z"), hy.make_vars("u", "v", "w"), SPHERE.gravity
    tension = v[0] ** 2 + v[1] ** 2 + v[2] ** 2 - g * q[2]
    equations = [*zip(q, v), *((v[i], -tension * q[i] - (g if i == 2 else 0.0)) for i in range(3))]
    start, grid = np.array([*SWINGING.q, *SWINGING.p]), np.linspace(0.0, T_END, OUTPUTS + 1)
    found: dict[float, float | None] = dict.fromkeys(GOALS)
    for tolerance in 10.0 ** -np.arange(1.0, 16.0, 0.5):
        taylor, ends = hy.taylor_adaptive(equations, start, tol=tolerance), []

        def run(taylor: Any = taylor, ends: list[Any] = ends) -> None:
            taylor.time, taylor.state[:] = 0.0, start
            ends[:] = [taylor.propagate_grid(grid)[-1]]

        spent = least(run, repetitions)
        error = np.abs(ends[0][:, :3] - exact).max()
        for goal, best in found.items():
            if error <= goal and (best is None or spent < best):
                found[goal] = spent
    return [{"method": f"heyoka {hy.__version__}", "us": {f"{goal:.0e}": best for goal, best in found.items()}}]


def main() -> None:
    out, timing = harness.options(__doc__, "constrained_benchmark.json")
    harness.write(out, {"steps": steps_beside_c(*timing), "time to error": time_to_error(timing[0])})


if __name__ == "__main__":
    main()
