"""Heisenberg spins on a cubic lattice, 1000 by default: the error in a direction at T = 2 over the time that it takes,
for methods of this library, C++ and other programs, in one picture.

    python tests/benchmarks/spins_to_an_error.py [--quick] [--side 10] [--rounds 5] [--figure FILE] [--out FILE]

Times are processor time of one thread, the least of the rounds, of runs that are prepared and keep the
last state.  LAMMPS, Spirit and SciPy are left out where they are not installed.
"""

import argparse
import os

# before NumPy comes
os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import spin_peers
from harness import table, write
from spins import build, least, spins_of, stepped, tabled

import liemech as lm

ERROR, T = 1e-4, 2.0
STEPS = [round(2 ** (0.5 * k)) for k in range(4, 23)]
"""Numbers of steps, 4 to 2048."""

Prepared = Callable[[], np.ndarray]


def contenders(s: np.ndarray, system: Any, n: int) -> dict[str, Callable[[int], Prepared]]:
    """By name: a run of so many steps, prepared."""

    def ours(method: Any) -> Callable[[int], Prepared]:
        def prepared(steps: int) -> Prepared:
            plan = lm.Plan(system, method, h=T / steps, every=steps, progress=False)
            start = system.state(mu=s)
            return lambda: np.asarray(plan.run(start, steps=steps).mu[-1])

        return prepared

    loop = build("off")

    def cpp(order: int) -> Callable[[int], Prepared]:
        method = lm.SublatticeSplitting(order)
        return lambda steps: lambda: stepped(loop, n, True, s, T / steps, steps, method)

    found = {f"liemech, sublattices, order {k}": ours(lm.SublatticeSplitting(k)) for k in (2, 4, 6, 8)}
    found |= {f"liemech, RKMK {k}": ours(lm.RKMK(k)) for k in (4, 5, 8)}
    found |= {"liemech, commutator-free 4": ours(lm.CommutatorFree())}
    found |= {f"C++, sublattices, order {k}": cpp(k) for k in (2, 4)}
    quick, fourth = tabled(build("fast"), system), lm.SublatticeSplitting(4)
    found["C++, eight sites at once, order 4"] = lambda steps: lambda: quick(s, T / steps, steps, fourth)
    if spin_peers.there("lammps"):
        found["LAMMPS, nve/spin"] = lambda steps: spin_peers.lammps_spin(s, n, T, steps)
    for solver in ("SIB", "DEPONDT", "HEUN", "RK4") if spin_peers.there("spirit") else ():
        run = spin_peers.spirit_solver(solver)
        found[f"Spirit, {solver}"] = lambda steps, run=run: run(s, n, T, steps)
    if spin_peers.there("scipy"):
        found["SciPy, DOP853"] = lambda steps: spin_peers.scipy_dop853(s, n, T, 10.0 / steps**3)
    return found


def curve(prepare: Callable[[int], Prepared], exact: np.ndarray, rounds: int) -> list[list[float]]:
    """Steps, error and seconds, until errors are far smaller or no longer fall."""
    rows: list[list[float]] = []
    for steps in STEPS:
        try:
            run = prepare(steps)
            error = float(np.abs(run() - exact).max())
        except lm.errors.LiemechError:
            continue
        if not error < 1.0:
            continue
        seconds = least({"": run}, rounds)[""]
        if seconds < 5e-3:
            seconds = min(seconds, least({"": run}, 8 * rounds)[""])
        rows.append([steps, error, seconds])
        if error < 1e-3 * ERROR or (len(rows) > 3 and error > 0.9 * rows[-2][1]) or seconds > 3.0:
            break
    return rows


def time_to(rows: list[list[float]]) -> float:
    """Seconds to the error that is wanted, between two runs on a line in logarithms."""
    for (_, e, t), (_, f, u) in itertools.pairwise(rows):
        if f <= ERROR < e:
            part = np.log(e / ERROR) / np.log(e / f)
            return float(np.exp(np.log(t) + part * np.log(u / t)))
    return float(rows[0][2]) if rows and rows[0][1] <= ERROR else float("nan")


def figure(results: dict[str, Any], path: Path) -> None:
    from matplotlib import colormaps

    picture, ax = lm.plots.subplots(figsize=(8.0, 5.6))
    marks = {"liemech": "o-", "C++": "x--", "LAMMPS": "s:", "Spirit": "^:", "SciPy": "d:"}
    maps = {"liemech": "viridis", "C++": "gray", "LAMMPS": "Reds_r", "Spirit": "autumn", "SciPy": "RdPu_r"}
    colours: dict[str, Any] = {}
    for program, map_ in maps.items():
        own = [name for name in results if name.startswith(program)]
        shades = colormaps[map_](np.linspace(0.1, 0.85 if program != "C++" else 0.5, len(own)))
        colours |= dict(zip(own, shades, strict=True))
    for name, r in results.items():
        _, error, seconds = np.array(r["rows"]).T
        style = marks[name.split(",")[0]]
        ax.loglog(1e3 * seconds, error, style, ms=4, lw=1.4, color=colours[name], label=name)
    ax.axhline(ERROR, color="0.6", lw=0.8)
    ax.set(xlabel="processor time (ms)", ylabel="largest error of a direction at T = 2")
    ax.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    lm.plots.save(picture, path)
    print(f"written: {path}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a few steps: does it run?")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--side", type=int, default=10, help="of the lattice, an even number")
    chosen = parser.parse_args()
    n = chosen.side
    if chosen.quick:
        del STEPS[6:]
        chosen.rounds = 1
    system, s = spins_of(lm.neighbours.cubic(n, n, n))
    names = contenders(s, system, n)
    exact = names["liemech, sublattices, order 8"](400)()
    results: dict[str, Any] = {}
    for name, prepare in names.items():
        rows = curve(prepare, exact, chosen.rounds)
        if rows:
            results[name] = {"rows": rows, "ms": 1e3 * time_to(rows)}
    best = min(r["ms"] for r in results.values() if r["ms"] > 0.0) if not chosen.quick else 1.0
    lines = [[name, r["ms"], r["ms"] / best] for name, r in results.items()]
    lines.sort(key=lambda line: (not line[1] > 0.0, line[1]))
    table(f"to an error of {ERROR:g} at T = {T:g}, cubic {n}^3", ["", "ms", "ratio"], lines)
    if chosen.figure:
        figure(results, chosen.figure)
    if chosen.out:
        write(chosen.out, results)


if __name__ == "__main__":
    main()
