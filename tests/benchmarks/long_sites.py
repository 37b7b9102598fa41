"""10^6 steps of many bodies: do energies and Casimirs keep their place?

    python tests/benchmarks/long_sites.py [spins] [water] [--steps 1000000] [--minutes 30]
        [--out long_sites.json]

spins : the sublattice splitting on a cubic lattice of 1000 spins, whose energy and lengths it keeps to
rounding.  water : rigid molecules, a drop in open space, 216 by default; what is told is the line through the
energies of blocks, with its standard error, and that of the modified energy, which tells a drift from a mean
of the error that changes with the state of the drop.  With --figure both are drawn.  A case ends after so many
minutes at the latest, and says how far it came.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from harness import table, write
from spins import spins_of
from water import EV, SPC, drop, warmed

import liemech as lm

sys.path.insert(0, str(Path(__file__).parents[1]))

import shadow

PIECES = 200
"""Pieces of a run, each with some samples."""

SHORT = 0.001
"""The longest step, in ps, from which modified energies are found directly."""


def pieces(plan: Any, start: Any, steps: int, minutes: float) -> Iterator[tuple[int, Any]]:
    """A run, piece by piece, and how many steps there have been."""
    begun, each = time.monotonic(), steps // PIECES
    run = plan.run(start, steps=each)
    yield each, run
    for k in range(2, PIECES + 1):
        if time.monotonic() - begun > 60.0 * minutes:
            return
        run = plan.resume(run, steps=each)
        yield k * each, run


def growth(n: np.ndarray, error: np.ndarray) -> float:
    """The power of n with which an error grows."""
    seen = error > 0.0
    return float(np.polyfit(np.log(n[seen]), np.log(error[seen]), 1)[0]) if seen.sum() > 2 else 0.0


def lengths_and_energy(order: int, compensated: bool, steps: int, minutes: float) -> dict[str, Any]:
    """Relative errors of the energy and of the square of every spin, in the course of a run."""
    system, s = spins_of(lm.neighbours.cubic(10, 10, 10))
    h = 0.05 * order
    plan = lm.Plan(
        system, lm.SublatticeSplitting(order), h=h, every=steps // PIECES, compensated=compensated, progress=False
    )
    start = system.state(mu=s)
    first, squares = float(system.energy(start.mu)), (s**2).sum(axis=1)
    rows, begun = [], time.process_time()
    for n, run in pieces(plan, start, steps, minutes):
        mu = np.asarray(run.mu[-1])
        off = (mu**2).sum(axis=1) / squares - 1.0
        energy = float(system.energy(mu)) / first - 1.0
        rows.append([n, energy, np.sqrt(np.mean(off**2)), np.abs(off).max(), off.mean()])
    n, energy, rms, most, mean = np.array(rows).T
    return {
        "order": order,
        "compensated": compensated,
        "steps": int(n[-1]),
        "minutes": (time.process_time() - begun) / 60.0,
        "energy, rms": float(np.sqrt(np.mean(energy**2))),
        "energy, end": float(energy[-1]),
        "squares, rms": float(rms[-1]),
        "squares, most": float(most[-1]),
        "squares, mean": float(mean[-1]),
        "power": growth(n, rms),
    }


def line(t: np.ndarray, means: Any) -> tuple[float, float]:
    """The slope of a line through means of blocks, and its standard error."""
    if len(means) < 4:
        return 0.0, 0.0
    (slope, _), covariance = np.polyfit(t, means, 1, cov=True)
    return float(slope), float(np.sqrt(covariance[0, 0]))


def energy_of_water(order: int, h: float, steps: int, minutes: float, side: int, kelvin: float) -> dict[str, Any]:
    """The trend of the energy, from means of blocks, and its standard error, in eV/ns."""
    system, start = drop(side)
    start = warmed(system, start, kelvin)
    method = lm.KickDrift(order=order)
    plan = lm.Plan(system, method, h=h, every=max(1, steps // PIECES // 10), progress=False)
    means, spread, begun = [], [], time.process_time()
    ends: list[list[Any]] = []
    for n, run in pieces(plan, start, steps, minutes):  # noqa: B007
        energies = np.asarray(run.energy)[1:] / EV
        means.append(energies.mean())
        spread.append(energies.std())
        ends.append([energies[-1], run.mu[-1], run.g[-1]])
    spent = (time.process_time() - begun) / 60.0
    t = np.arange(1, len(means) + 1) / len(means) * n * h * 1e-3  # ns
    energies, mu, g = map(np.array, zip(*ends, strict=True))
    beyond = shadow.beyond(system, method, h, SPC.moments, SHORT)
    modified = energies + beyond(mu, g) / EV
    kinetic = 0.5 * (mu**2 / np.array(SPC.moments)).sum(axis=(1, 2)) / EV
    slope, error = line(t, means)
    other, its = line(t, modified)
    return {
        "order": order,
        "h, fs": 1e3 * h,
        "kelvin": kelvin,
        "steps": n,
        "minutes": spent,
        "fluctuation, eV": float(np.sqrt(np.mean(np.square(spread)))),
        "trend, eV/ns": slope,
        "its error": error,
        "modified: fluctuation": float(np.std(modified)),
        "trend": other,
        "error": its,
        "series": [x.tolist() for x in (t, np.array(means), modified, kinetic)],
    }


def picture(path: Path, rows: list[dict[str, Any]]) -> None:
    """Energies and modified energies in the course of runs, from their starts, over kinetic energies."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, len(rows), figsize=(4.2 * len(rows), 5.0), sharex="col", squeeze=False, dpi=200)
    for (above, below), row in zip(axes.T, rows, strict=True):
        t, energy, modified, kinetic = map(np.array, row["series"])
        unit = 10.0 ** np.floor(np.log10(np.ptp(energy)))
        above.plot(t, (energy - energy[0]) / unit, color="tab:red", lw=1.0, label="energy, block means")
        above.plot(t, (modified - modified[0]) / unit, color="tab:blue", lw=1.4, label="modified energy")
        above.set_title(f"order {row['order']}, {row['h, fs']:g} fs, {row['kelvin']:g} K", fontsize=10)
        above.set_ylabel(f"change, {unit:.0e} eV")
        below.plot(t, kinetic, color="0.4", lw=0.8)
        below.set_ylabel("kinetic energy, eV")
        below.set_xlabel("t, ns")
    axes[0, 0].legend(fontsize=8, frameon=False)
    figure.tight_layout()
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", default=["spins", "water"], metavar="case")
    parser.add_argument("--steps", type=int, default=10**6)
    parser.add_argument("--minutes", type=float, default=30.0, help="of each case")
    parser.add_argument("--order", type=int, default=2, help="of the steps of water")
    parser.add_argument("--step", type=float, default=1.0, help="of water, in fs")
    parser.add_argument("--kelvin", type=float, default=300.0, help="of the drop at the start")
    parser.add_argument("--side", type=int, default=6, help="of the drop, in molecules")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--figure", type=Path, help="of the runs in --also, and this one, of water")
    parser.add_argument("--also", type=Path, nargs="*", default=[], help="files of --out")
    parser.add_argument("--quick", action="store_true", help="1000 steps: does it run?")
    chosen = parser.parse_args()
    side = 3 if chosen.quick else chosen.side
    chosen.steps = 1000 if chosen.quick else chosen.steps
    kept: dict[str, Any] = {}
    if "spins" in chosen.cases:
        kept["spins"] = [
            lengths_and_energy(order, compensated, chosen.steps, chosen.minutes)
            for order in (2, 4)
            for compensated in (False, True)
        ]
    if "water" in chosen.cases:
        given = chosen.order, 1e-3 * chosen.step, chosen.steps, chosen.minutes, side, chosen.kelvin
        kept["water"] = [energy_of_water(*given)]
    for name, rows in kept.items():
        columns = [c for c in rows[0] if c != "series"]
        shown = [[f"{r[c]:.3g}" if type(r[c]) is float else r[c] for c in columns] for r in rows]
        table(name, columns, shown)
    if chosen.figure:
        others = [json.loads(path.read_text())["water"] for path in chosen.also]
        picture(chosen.figure, [row for rows in (*others, kept.get("water", [])) for row in rows])
    if chosen.out:
        write(chosen.out, kept)


if __name__ == "__main__":
    main()
