"""Time against error: a free rigid body, momentum and attitude, until t = 100, by this library and by others if they are installed.

    python tests/benchmarks/work_precision.py [--quick] [--out work_precision.json] [--figure work_precision.png] [--only NAME]

The error is the largest entry of the difference to the exact motion at the end.  The time is that of a whole call of the package,
the best of several in turn with all others; making machine code and setting up are apart.
"""

import argparse
import os

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")  # before NumPy comes

import itertools
import math
import time
import warnings
from functools import partial
from pathlib import Path
from typing import Any

import harness
import numpy as np
from peers import TIGHTEST, Contender, Problem, Result, Run, contenders, doubled, tolerances

import liemech as lm
from liemech.tableaus import dop853, explicit, flows, pairs, tsitouras, verner

MU = (0.5, 0.0, math.sqrt(0.75))
PROBLEMS = (
    Problem("J = (1, 1.5, 2)", (1.0, 1.5, 2.0), MU, 100.0),
    Problem("J = (2/3, 1, 2)", (2 / 3, 1.0, 2.0), MU, 100.0),
)
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)

TABLEAUS = {
    "RK4": explicit.RK4,
    "DP5": pairs.DORMAND_PRINCE5,
    "Tsit5": tsitouras.TSITOURAS5,
    "Butcher6": explicit.BUTCHER6,
    "Verner6": verner.VERNER6,
    "Verner7": verner.VERNER7,
    "DOP853": dop853.DOP853,
}
"""Of the Munthe-Kaas methods with fixed steps; those with an embedded method run with adaptive steps too."""


def ours() -> list[Contender]:
    """The methods of this library."""
    fixed: dict[str, tuple[Any, tuple[float, ...]]] = {}
    for name, tableau in TABLEAUS.items():
        fixed[f"RKMK {name}"] = lm.RKMK(tableau=tableau), doubled(2048 >> tableau.order, 17 - tableau.order)
    fixed["commutator-free 4"] = lm.CommutatorFree(order=4), doubled(128, 13)
    fixed["commutator-free CK4"] = lm.CommutatorFree(tableau=flows.CARPENTER_KENNEDY4), doubled(128, 13)
    fixed["variational, exp"] = lm.CovariantVariational(lm.Exponential()), doubled(512, 11)
    fixed["variational, Cayley"] = lm.CovariantVariational(lm.Cayley()), doubled(512, 11)
    found = [Contender("liemech", name, settings, partial(_steps, method=method)) for name, (method, settings) in fixed.items()]
    for name, tableau in TABLEAUS.items():
        if tableau.b_hat:
            method = lm.RKMK(tableau=tableau)
            for dense in (False, True) if name in ("Tsit5", "DOP853") else (False,):
                found.append(
                    Contender(
                        "liemech",
                        f"RKMK {name}, adaptive" + (", t_eval" if dense else ""),
                        (*tolerances(-2, -13), TIGHTEST),
                        partial(_adaptive, method=method, dense=dense),
                    )
                )
    return found


def _start(problem: Problem) -> tuple[Any, Any]:
    with warnings.catch_warnings(action="ignore", category=lm.errors.InertiaWarning):
        body = lm.RigidBody(problem.inertia)
    return body, body.state(mu=problem.mu, g=np.eye(3))


def _steps(problem: Problem, setting: float, method: Any) -> Run:
    n, (body, start) = int(setting), _start(problem)
    options: dict[str, Any] = {"h": problem.t_end / n, "steps": n, "every": n, "compiled": True, "progress": False}

    def run() -> Result:
        motion: Any = lm.integrate(body, method, start, **options)
        return motion.mu[-1], motion.g[-1]

    return run


def _adaptive(problem: Problem, tolerance: float, method: Any, dense: bool) -> Run:
    body, start = _start(problem)
    options: dict[str, Any] = {"t_end": problem.t_end, "rtol": tolerance, "atol": tolerance, "dense": dense}
    options |= {"compiled": True, "progress": False} | ({"t_eval": np.linspace(0.0, problem.t_end, 11)} if dense else {})

    def run() -> Result:
        motion: Any = lm.integrate(body, method, start, **options)
        return motion.mu[-1], motion.g[-1]

    return run


# ------------------------------------------------------------------ measuring


def curves(problem: Problem, everybody: list[Contender], repetitions: int) -> list[dict[str, Any]]:
    """For every contender the error and the time of each of its settings."""
    body, first = _start(problem)
    exact = body.exact(first, problem.t_end)
    runs: list[tuple[dict[str, Any], Run]] = []
    results: list[dict[str, Any]] = []
    for contender in everybody:
        curve: dict[str, Any] = {"package": contender.package, "method": contender.method, "set_up": 0.0, "points": []}
        results.append(curve)
        for setting in contender.settings:
            begun = time.perf_counter()
            try:
                with warnings.catch_warnings(action="ignore"):
                    run = contender.prepare(problem, setting)
                    mu, g = run()
            except Exception as error:  # of whatever kind: the package gives up at this setting
                print(f"{contender.package} {contender.method}, {setting:g}: {error}")
                continue
            curve["set_up"] = max(curve["set_up"], time.perf_counter() - begun)
            off = max(float(np.abs(mu - exact.mu).max()), float(np.abs(g - exact.g).max()))
            if not math.isfinite(off):
                continue
            point: dict[str, Any] = {"setting": setting, "error": off, "times": []}
            curve["points"].append(point)
            runs.append((point, run))
    for k in range(repetitions):
        for point, run in runs:
            if k > 2 and point["times"][0] > 0.1:  # long runs repeat themselves well enough
                continue
            for _ in range(3):
                begun = time.perf_counter()
                run()
                point["times"].append(time.perf_counter() - begun)
                if point["times"][-1] > 3e-3:
                    break
    for curve in results:
        for point in curve["points"]:
            times = point.pop("times")
            point["best"], point["median"] = min(times), float(np.median(times))
    return results


def time_for(points: list[dict[str, Any]], target: float) -> float | None:
    """Seconds to an error: on the curve of time against error between two of its points, both logarithmic; None if out of reach.

    A method whose loosest setting is already better counts with the time of that.
    """
    times = [point["best"] for point in points if point["error"] <= target]
    for a, b in itertools.pairwise(points):
        if a["error"] > target >= b["error"] > 0.0:
            part = math.log(a["error"] / target) / math.log(a["error"] / b["error"])
            times.append(a["best"] * (b["best"] / a["best"]) ** part)
    return min(times, default=None)


def winners(results: list[dict[str, Any]], packages: list[str]) -> dict[str, dict[float, tuple[float, str] | None]]:
    """For each package and error the time of its quickest method, and its name."""
    found: dict[str, dict[float, tuple[float, str] | None]] = {}
    for package in packages:
        found[package] = {}
        for target in TARGETS:
            times = [(time_for(c["points"], target), c["method"]) for c in results if c["package"] == package]
            found[package][target] = min(((t, name) for t, name in times if t is not None), default=None)
    return found


def figure(results: dict[str, list[dict[str, Any]]], path: Path) -> None:
    """Time against error, both logarithmic: one panel for each body, the lower envelope of each package drawn through."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    colours = {"liemech": "#0072b2", "heyoka": "#d55e00", "SciPy": "#009e73", "Exudyn": "#cc79a7", "Lielab": "#e69f00"}
    panels, axes = plt.subplots(1, len(results), figsize=(11, 4.6), sharey=True, layout="constrained", squeeze=False)
    for ax, (name, found) in zip(axes[0], results.items(), strict=True):
        labelled: set[str] = set()
        for curve in found:
            x, y = [p["error"] for p in curve["points"]], [1e3 * p["best"] for p in curve["points"]]
            colour = colours.get(curve["package"], "0.5")
            ax.loglog(x, y, color=colour, lw=0.6, alpha=0.45)
        errors = np.logspace(-14, 0, 141)
        for package, colour in colours.items():
            own = [c["points"] for c in found if c["package"] == package]
            best = [min((t for t in (time_for(points, e) for points in own) if t is not None), default=math.nan) for e in errors]
            if own and package not in labelled:
                ax.loglog(errors, 1e3 * np.array(best), color=colour, lw=2.2, label=package)
                labelled.add(package)
        ax.set(title=name, xlabel="error at t = 100, momentum and attitude", xlim=(1e0, 1e-14))
        ax.grid(alpha=0.3)
    axes[0][0].set_ylabel("time of a call, ms")
    axes[0][0].legend(frameon=False)
    panels.savefig(path, dpi=110)
    print(f"written: {path}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="smoke run: every third setting of one body, once")
    parser.add_argument("--only", default="", help="contenders whose package or method contains this")
    parser.add_argument("--out", type=Path, default=Path("work_precision.json"), help="where the JSON goes")
    parser.add_argument("--figure", type=Path, help="where a picture goes, if one is wanted")
    options = parser.parse_args()

    others, versions = contenders()
    everybody = [c for c in [*ours(), *others] if options.only in f"{c.package} {c.method}"]
    if options.quick:
        everybody = [Contender(c.package, c.method, c.settings[::3], c.prepare) for c in everybody]
    for package, version in versions.items():
        print(f"{package} {version or 'is not installed'}")
    packages = list(dict.fromkeys(c.package for c in everybody))
    results: dict[str, list[dict[str, Any]]] = {}
    for problem in PROBLEMS[: 1 if options.quick else None]:
        results[problem.name] = found = curves(problem, everybody, 1 if options.quick else 9)
        best = winners(found, packages)
        rows: list[list[object]] = [
            [package, *[f"{1e3 * cell[0]:.3g} ({cell[1]})" if (cell := best[package][e]) else None for e in TARGETS]]
            for package in packages
        ]
        harness.table(f"{problem.name}: ms for an error of", ["package", *[f"{e:.0e}" for e in TARGETS]], rows)
        every: list[list[object]] = [
            [c["package"], c["method"], *[1e3 * t if (t := time_for(c["points"], e)) else None for e in TARGETS], c["set_up"]]
            for c in found
        ]
        columns = ["package", "method", *[f"{e:.0e}" for e in TARGETS], "first call, s"]
        harness.table(f"{problem.name}: ms for an error of, every method", columns, every)
    harness.write(options.out, {"versions": versions, "curves": results})
    if options.figure:
        figure(results, options.figure)


if __name__ == "__main__":
    main()
