"""The outer Solar System over a million years beside REBOUND: time and energy of the same methods at the same step.

    python tests/benchmarks/planets.py [--years 1e6] [--out planets.json]

REBOUND's WHFast and SABA integrators take steps of the same kind in the same coordinates; without REBOUND its rows are
missing.
"""

import argparse
import importlib
import importlib.util
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import harness
import numpy as np

import liemech as lm
from liemech.tableaus import SPLITTINGS, STRANG

YEAR = 365.25  # days
SAMPLES = 400
SYSTEM, START = lm.models.PlanetarySystem.outer_solar_system()
BODIES, BEGIN = lm.models.NBody.outer_solar_system()

METHODS: dict[str, tuple[Any, float, str]] = {
    "Wisdom and Holman, 200 d": (STRANG.exchanged, 200.0, "whfast"),
    "the same, kick first, 200 d": (STRANG, 200.0, "whfast"),
    "Wisdom and Holman, 50 d": (STRANG.exchanged, 50.0, "whfast"),
    "(8, 2), 200 d": (SPLITTINGS["SABA (8, 2)"], 200.0, "saba4"),
    "(10, 6, 4), 400 d": (SPLITTINGS["ABA (10, 6, 4)"], 400.0, "saba10,6,4"),
}
"""Of each row the tableau here, the step, and what REBOUND 5 calls the method.  Its SABA 4 has four
stages: order (8, 2).
"""


def errors(energies: np.ndarray) -> tuple[float, float]:
    """The largest relative error of the energy, and how much larger it is in the second half than in the first."""
    change = np.abs(energies / energies[0] - 1.0)
    half = len(change) // 2
    return float(change.max()), float(change[half:].max() / change[1:half].max())


def ours(tableau: Any, h: float, steps: int) -> tuple[float, np.ndarray]:
    plan = lm.Plan(SYSTEM, lm.Splitting(tableau=tableau), h=h, every=steps // SAMPLES, compiled=True, progress=False)
    plan.run(START, steps=2 * (steps // SAMPLES))  # compiled
    begin = time.perf_counter()
    run = plan.run(START, steps=steps)
    spent = time.perf_counter() - begin
    q, p = SYSTEM.bodies(run.y)
    return spent, np.asarray(BODIES.energy(q, p))


def theirs(rebound: Any, name: str, h: float, steps: int) -> tuple[float, np.ndarray]:
    simulation = rebound.Simulation()
    simulation.G = float(BODIES.gravity)
    q, p = np.array(BEGIN.q).reshape(-1, 3), np.array(BEGIN.p).reshape(-1, 3)
    for mass, place, momentum in zip(BODIES.masses, q, p, strict=True):
        x, v = place.tolist(), (momentum / mass).tolist()
        simulation.add(m=mass, x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2])
    simulation.move_to_com()
    simulation.integrator, simulation.dt = name, h
    simulation.integrator.safe_mode = 0  # half drifts of neighbouring steps are one
    energies, spent = [simulation.energy()], 0.0
    for _ in range(SAMPLES):
        begin = time.perf_counter()
        simulation.steps(steps // SAMPLES)
        simulation.synchronize()
        spent += time.perf_counter() - begin
        energies.append(simulation.energy())
    return spent, np.array(energies)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--years", type=float, default=1e6, help="how long")
    parser.add_argument("--out", type=Path, default=Path("planets.json"), help="where the JSON goes")
    options = parser.parse_args()

    there = importlib.util.find_spec("rebound") is not None
    rebound = importlib.import_module("rebound") if there else None
    print(f"REBOUND {rebound.__version__}" if rebound else "REBOUND is not installed: pip install rebound")
    rows: list[dict[str, Any]] = []
    for name, (tableau, h, other) in METHODS.items():
        steps = max(1, round(options.years * YEAR / h / SAMPLES)) * SAMPLES
        runs: dict[str, Callable[[], tuple[float, np.ndarray]]] = {
            "liemech": lambda t=tableau, h=h, n=steps: ours(t, h, n)
        }
        if rebound:
            runs["REBOUND"] = lambda w=other, h=h, n=steps: theirs(rebound, w, h, n)
        for package, run in runs.items():
            spent, energies = run()
            error, growth = errors(energies)
            rows.append(
                {
                    "method": name,
                    "package": package,
                    "s": spent,
                    "us a step": 1e6 * spent / steps,
                    "error": error,
                    "growth": growth,
                }
            )
    harness.table(
        f"the outer Solar System, {options.years:g} years: time, and the largest relative error of the energy",
        ["method", "package", "s", "us a step", "error", "second half over first"],
        [[*list(row.values())[:4], f"{row['error']:.1e}", row["growth"]] for row in rows],
    )
    harness.write(options.out, {"years": options.years, "rows": rows})


if __name__ == "__main__":
    main()
