"""Time against error: free rigid bodies and a heavy top, momentum and attitude, by this library and
by others that are installed.

    python tests/benchmarks/work_precision.py [--quick] [--out work_precision.json] [--figure
    work_precision.png] [--only NAME]

The error is the largest entry of the difference to the exact motion at the end.  The time is that
of a whole call of the package, prepared where it can be, the best of several in turn with all
others; making machine code and setting up are apart.
"""

import argparse
import os

# before NumPy comes
os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

import itertools
import math
import time
import warnings
from pathlib import Path
from typing import Any

import harness
import numpy as np
import peers
from ours import ours, reference
from peers import Contender, Problem, Run
from problems import PROBLEMS

import liemech as lm

TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
COLOURS = {
    "liemech": "#0072b2",
    "liemech, symplectic": "#5a3fe0",
    "heyoka": "#d55e00",
    "SciPy": "#009e73",
    "Exudyn": "#7b1e5b",
    "Lielab": "#5c4a12",
}


# ------------------------------------------------------------------ measuring


def curves(problem: Problem, everybody: list[Contender], repetitions: int) -> list[dict[str, Any]]:
    """For every contender the error and the time of each of its settings."""
    exact_mu, exact_g = reference(problem)
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
                    mu, g = run()[-1]
            except Exception as error:  # of whatever kind: the package gives up at this setting
                print(f"{contender.package} {contender.method}, {setting:g}: {error}")
                continue
            curve["set_up"] = max(curve["set_up"], time.perf_counter() - begun)
            off = max(float(np.abs(mu - exact_mu).max()), float(np.abs(g - exact_g).max()))
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
    """Seconds to an error: on the curve of time against error between two of its points, both
    logarithmic; None if out of reach.

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
    """Time against error, both logarithmic: one panel for each problem, the lower envelope of each
    package drawn through.
    """
    size = 5.2 * len(results), 4.6
    panels, axes = lm.plots.subplots(1, len(results), figsize=size, sharey=True, squeeze=False)
    for ax, (name, found) in zip(axes[0], results.items(), strict=True):
        for curve in found:
            x, y = [p["error"] for p in curve["points"]], [1e3 * p["best"] for p in curve["points"]]
            ax.loglog(x, y, color=COLOURS[curve["package"]], lw=0.6, alpha=0.45)
        errors = np.logspace(-14, 0, 141)
        for package, colour in COLOURS.items():
            own = [c["points"] for c in found if c["package"] == package]
            best = [
                min((t for t in (time_for(points, e) for points in own) if t is not None), default=math.nan)
                for e in errors
            ]
            if own:
                ax.loglog(errors, 1e3 * np.array(best), color=colour, lw=2.2, label=package)
        ax.set(title=name, xlabel="error of momentum and attitude at the end", xlim=(1e0, 1e-14))
    axes[0][0].set_ylabel("time of a call (ms)")
    lm.plots.legend(axes[0][-1], loc="upper right", ncols=2)
    lm.plots.save(panels, path)
    print(f"written: {path}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="smoke run: every third method and setting, once")
    parser.add_argument("--only", default="", help="contenders whose package or method contains this")
    parser.add_argument("--out", type=Path, default=Path("work_precision.json"), help="where the JSON goes")
    parser.add_argument("--figure", type=Path, help="where a picture goes, if one is wanted")
    options = parser.parse_args()

    others, versions = peers.contenders()
    for package, version in versions.items():
        print(f"{package} {version or 'is not installed'}")
    results: dict[str, list[dict[str, Any]]] = {}
    for problem in PROBLEMS:
        everybody = [c for c in [*ours(problem), *others] if options.only in f"{c.package} {c.method}"]
        if options.quick:
            everybody = [Contender(c.package, c.method, c.settings[::3], c.prepare) for c in everybody[::3]]
        packages = list(dict.fromkeys(c.package for c in everybody))
        results[problem.name] = found = curves(problem, everybody, 1 if options.quick else 9)
        best = winners(found, packages)
        rows: list[list[object]] = [
            [package, *[f"{1e3 * cell[0]:.3g} ({cell[1]})" if (cell := best[package][e]) else None for e in TARGETS]]
            for package in packages
        ]
        harness.table(f"{problem.name}: ms for an error of", ["package", *[f"{e:.0e}" for e in TARGETS]], rows)
        every: list[list[object]] = [
            [
                c["package"],
                c["method"],
                *[1e3 * t if (t := time_for(c["points"], e)) else None for e in TARGETS],
                c["set_up"],
            ]
            for c in found
        ]
        columns = ["package", "method", *[f"{e:.0e}" for e in TARGETS], "first call, s"]
        harness.table(f"{problem.name}: ms for an error of, every method", columns, every)
    harness.write(options.out, {"versions": versions, "curves": results})
    if options.figure:
        figure(results, options.figure)


if __name__ == "__main__":
    main()
