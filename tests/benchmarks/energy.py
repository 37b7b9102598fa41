"""Energy and Casimirs of a free rigid body and of a heavy top until t = 10^5, by this library and by others that are
installed.

    python tests/benchmarks/energy.py [--quick] [--out energy.json] [--figure energy.png] [--errors
    1e-3 1e-6] [--only NAME]

Every method runs at the loosest of its settings with which momentum and attitude come out with such an error at the
time of `work_precision.py`, t = 100 of the free body and t = 10 of the top.  An error at a time is the largest of some
between half of it and it, relative to the value at the start.
"""

import argparse
import os

# before NumPy comes
os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

import dataclasses
import itertools
import time
import warnings
from pathlib import Path
from typing import Any

import harness
import numpy as np
import peers
from ours import ours, reference
from peers import Contender, Problem, Result
from problems import BODY, TOP
from work_precision import COLOURS

import liemech as lm

ENDS = (1e3, 10**3.5, 1e4, 10**4.5, 1e5)
UNIT = 100.0  # samples are at multiples of it, a whole number of steps with every setting
CHOSEN = (
    "liemech, symplectic Algorithm 1, exp",
    "liemech, symplectic Algorithm 1, Cayley",
    "liemech, symplectic Algorithm 1, exp, composed to 4",
    "liemech, symplectic Lie-Verlet, exp",
    "liemech, symplectic Lie-Verlet, Cayley",
    "liemech, symplectic Lie-Verlet, exp, composed to 4",
    "liemech, symplectic Hamilton-Jacobi 4, exp",
    "liemech, symplectic Hamilton-Jacobi 6, exp",
    "liemech, symplectic Galerkin 6",
    "liemech, symplectic kicks and exact drifts, order 4",
    "liemech, symplectic kicks and exact drifts, order 6",
    "liemech, symplectic exact",
    "liemech RKMK RK4",
    "liemech RKMK DOP853",
    "liemech Taylor 12",
    "liemech Taylor 12, se(3)*",
    "heyoka Taylor",
    "SciPy DOP853, Numba",
    "Exudyn RK44",
    "Exudyn RK67",
    "Lielab RKMK RKV98r",
)


def windows(end: float) -> dict[float, list[float]]:
    """For each of the ends five times at most, between half of it and it."""
    found = {}
    for last in (e for e in ENDS if e <= end):
        first, final = np.floor(0.5 * last / UNIT) + 1, np.round(last / UNIT)
        found[last] = [UNIT * float(k) for k in np.unique(np.round(np.linspace(first, final, 5)))]
    return found


def setting_for(contender: Contender, problem: Problem, error: float) -> float | None:
    """The loosest setting with an error as small."""
    exact = reference(problem)
    for setting in contender.settings:
        try:
            end = contender.prepare(problem, setting)()[-1]
        except Exception:  # of whatever kind: the package gives up at this setting
            continue
        if max(float(np.abs(a - b).max()) for a, b in zip(end, exact, strict=True)) <= error:
            return setting
    return None


def constants(problem: Problem, state: Result) -> tuple[float, np.ndarray]:
    """Energy, and the Casimirs: |mu|^2 of a free body; |Gamma|^2 and mu . Gamma of a top, Gamma = g^T e3."""
    mu, g = state
    energy = 0.5 * mu @ (mu / np.array(problem.inertia)) + g[2] @ np.array(problem.load)
    return float(energy), np.array([g[2] @ g[2], mu @ g[2]] if problem.heavy else [mu @ mu])


def long_run(contender: Contender, problem: Problem, setting: float, end: float) -> dict[str, Any]:
    """Relative errors of energy and Casimirs, and how far the attitude is from the group, at each
    of the ends; and seconds.
    """
    groups = windows(end)
    times = sorted({t for group in groups.values() for t in group})
    run = contender.prepare(dataclasses.replace(problem, times=tuple(times)), setting)
    begun = time.process_time()
    states = dict(zip(times, run(), strict=True))
    seconds = time.process_time() - begun
    energy, casimirs = constants(problem, peers.result(problem.start))
    found: dict[str, Any] = {"seconds": seconds, "energy": {}, "casimirs": {}, "group": {}}
    for last, group in groups.items():
        kept = [constants(problem, states[t]) for t in group]
        found["energy"][last] = max(abs(e - energy) for e, _ in kept) / abs(energy)
        found["casimirs"][last] = max(float(np.abs((c - casimirs) / casimirs).max()) for _, c in kept)
        found["group"][last] = max(float(np.abs(states[t][1].T @ states[t][1] - np.eye(3)).max()) for t in group)
    return found


def figure(results: list[dict[str, Any]], path: Path) -> None:
    """Energy error against time, both logarithmic: a row for each error at the short time, a column for each problem."""
    from matplotlib.lines import Line2D

    problems, errors = (list(dict.fromkeys(r[key] for r in results)) for key in ("problem", "error"))
    size = 5.2 * len(problems), 4.2 * len(errors)
    picture, axes = lm.plots.subplots(len(errors), len(problems), figsize=size, sharex=True, sharey=True, squeeze=False)
    for ax, (error, problem) in zip(axes.ravel(), itertools.product(errors, problems), strict=True):
        all_here = [r for r in results if (r["problem"], r["error"]) == (problem, error)]
        # null in a file
        shown = [r for r in all_here if np.isfinite(np.array([*r["energy"].values()], dtype=float)).all()]
        for r, height in zip(shown, spread([[*r["energy"].values()][-1] for r in shown]), strict=True):
            t, e = [float(x) for x in r["energy"]], [*r["energy"].values()]
            ax.loglog(t, e, "o-", ms=3, lw=1.4, color=COLOURS[r["package"]])
            ax.annotate(r["method"], (1.2 * t[-1], height), fontsize=6.5, va="center", color=COLOURS[r["package"]])
        ax.set(title=f"{problem}, {error:g} at the short time", xlim=(8e2, 2e6), ylim=(1e-16, 1e2))
    for ax in axes[:, 0]:
        ax.set_ylabel("relative error of the energy")
    for ax in axes[-1]:
        ax.set_xlabel("time")
    handles = [Line2D([], [], color=c, label=p) for p, c in COLOURS.items() if any(r["package"] == p for r in results)]
    axes[0][-1].legend(handles=handles, frameon=False, fontsize=8, loc="lower left")
    lm.plots.save(picture, path)
    print(f"written: {path}")


def spread(heights: list[float], gap: float = 0.4) -> list[float]:
    """The heights of labels, moved upwards in the logarithm until they are a gap apart."""
    places: dict[int, float] = {}
    for k in sorted(range(len(heights)), key=lambda k: heights[k]):
        places[k] = max(np.log10(heights[k]), max(places.values(), default=-20.0) + gap)
    return [float(10.0 ** places[k]) for k in range(len(heights))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="smoke run: until t = 10^3, for one error")
    parser.add_argument(
        "--errors", type=float, nargs="+", default=[1e-3, 1e-6], help="of momentum and attitude at the short time"
    )
    parser.add_argument("--only", default="", help="contenders whose package or method contains this")
    parser.add_argument("--out", type=Path, default=Path("energy.json"), help="where the JSON goes")
    parser.add_argument("--figure", type=Path, help="where a picture goes, if one is wanted")
    options = parser.parse_args()

    others, versions = peers.contenders()
    results: list[dict[str, Any]] = []
    for problem in (BODY, TOP):
        everybody = {f"{c.package} {c.method}": c for c in [*ours(problem), *others]}
        for error in options.errors[: 1 if options.quick else None]:
            rows: list[list[object]] = []
            for name in (n for n in CHOSEN if n in everybody and options.only in n):
                with warnings.catch_warnings(action="ignore"):
                    setting = setting_for(everybody[name], problem, error)
                    if setting is None:
                        print(f"{name} does not reach {error:g}")
                        continue
                    found = long_run(everybody[name], problem, setting, 1e3 if options.quick else 1e5)
                package, method = everybody[name].package, everybody[name].method
                row = {"problem": problem.name.split(",")[0], "error": error, "package": package, "method": method}
                results.append({**row, "setting": setting, **found})
                energies = list(found["energy"].values())[::2]
                rows.append(
                    [package, method, f"{setting:g}", *[f"{x:.1e}" for x in energies]]
                    + [f"{list(found[kind].values())[-1]:.1e}" for kind in ("casimirs", "group")]
                    + [found["seconds"]]
                )
            ends = [f"energy, {e:g}" for e in list(windows(1e3 if options.quick else 1e5))[::2]]
            columns = ["package", "method", "setting", *ends, "Casimirs", "group", "s"]
            harness.table(f"{problem.name}, an error of {error:g} there; relative errors at later times", columns, rows)
    harness.write(options.out, {"versions": versions, "runs": results})
    if options.figure:
        figure(results, options.figure)


if __name__ == "__main__":
    main()
