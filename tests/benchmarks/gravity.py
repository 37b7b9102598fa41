"""Gravity of all pairs beside C++ and REBOUND: a step for 10 to 1000 bodies, and ten planets to a
given accuracy.

    python tests/benchmarks/gravity.py [--rounds 7] [--out gravity.json]

Processor time, least of the rounds, which take turns.  Without REBOUND its columns are missing, and
ten planets have no opponent.
"""

import argparse
import ctypes
import importlib
import importlib.util
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import baseline
import harness
import numpy as np

import liemech as lm

SOURCE = Path(__file__).with_suffix(".cpp")
SIZES = (10, 32, 100, 1000)
METHODS: dict[str, Any] = {"leapfrog": lm.StormerVerlet(), "order 8": lm.Splitting(order=8)}
DURATION = 0.15
"""Seconds of one measurement, about."""


def swarm(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Masses 1/n, places and velocities of a cloud."""
    rng = np.random.default_rng(n)
    return np.full(n, 1.0 / n), rng.normal(size=(n, 3)), 0.3 * rng.normal(size=(n, 3))


def planets() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A star and nine planets on nearly circular orbits, each 1.4 times as large as the last."""
    rng = np.random.default_rng(5)
    m = np.r_[1.0, 10.0 ** rng.uniform(-6.0, -4.0, 9)]
    a = np.r_[0.0, 1.4 ** np.arange(9)]
    phase, tilt = rng.uniform(0.0, 2.0 * np.pi, 10), rng.normal(0.0, 0.02, 10)
    q = a[:, None] * np.column_stack([np.cos(phase), np.sin(phase), tilt])
    speed = np.where(a > 0.0, 1.02 / np.sqrt(np.maximum(a, 1.0)), 0.0)
    v = speed[:, None] * np.column_stack([-np.sin(phase), np.cos(phase), 0.0 * phase])
    return m, q - m @ q / m.sum(), v - m @ v / m.sum()


def opponents() -> dict[str, Any]:
    """The C++ of `gravity.cpp`, without and with contraction; empty without g++."""
    array = np.ctypeslib.ndpointer(np.float64, flags="C")
    found = {}
    for contraction, library in baseline.libraries(SOURCE).items():
        call = library.gravity
        call.argtypes = [ctypes.c_long, array, array, array, ctypes.c_double, ctypes.c_long,
                         ctypes.c_long, array, array]  # fmt: skip
        found[contraction] = call
    return found


def ours(m: np.ndarray, q: np.ndarray, v: np.ndarray, method: Any, h: float) -> Any:
    """Steps of the library: a function of their number that gives the places at the end."""
    system = lm.models.NBody(m)
    start = system.state(q.ravel(), (m[:, None] * v).ravel())
    plan = lm.Plan(system, method, h=h, every=10**9, compiled=True, progress=False)
    return lambda steps: plan.run(start, steps=steps).q[-1].reshape(-1, 3)


def theirs(call: Any, m: np.ndarray, q: np.ndarray, v: np.ndarray, method: Any, h: float) -> Any:
    """The same in C++."""
    if isinstance(method, lm.StormerVerlet):
        kicks, drifts = np.array([0.5, 0.5]), np.array([1.0])
    else:
        kicks, drifts = np.array(method.tableau.kicks), np.array(method.tableau.drifts)

    def run(steps: int) -> np.ndarray:
        x, u = q.copy(), v.copy()
        call(len(m), m, x, u, h, steps, len(drifts), kicks, drifts)
        return x

    return run


def simulation(rebound: Any, m: np.ndarray, q: np.ndarray, v: np.ndarray) -> Any:
    """The bodies in REBOUND."""
    found = rebound.Simulation()
    for mass, x, u in zip(m, q, v, strict=True):
        found.add(m=mass, x=x[0], y=x[1], z=x[2], vx=u[0], vy=u[1], vz=u[2])
    return found


def places(sim: Any) -> np.ndarray:
    return np.array([[p.x, p.y, p.z] for p in sim.particles])


def least(runs: dict[str, Callable[[int], Any]], rounds: int) -> dict[str, float]:
    """Microseconds a step."""
    steps = {}
    for name, run in runs.items():
        run(2)
        begun = time.process_time()
        run(2)
        steps[name] = max(2, int(2 * DURATION / max(time.process_time() - begun, 1e-5)))
        begun = time.process_time()
        run(steps[name])
        steps[name] = max(2, int(steps[name] * DURATION / max(time.process_time() - begun, 1e-5)))
    found = dict.fromkeys(runs, np.inf)
    for _ in range(rounds):
        for name, run in runs.items():
            begun = time.process_time()
            run(steps[name])
            found[name] = min(found[name], (time.process_time() - begun) / steps[name] * 1e6)
    return found


def a_step(rebound: Any, rounds: int) -> list[list[Any]]:
    rows, rivals = [], opponents()
    for title, method in METHODS.items():
        for n in SIZES:
            m, q, v = swarm(n)
            h = 1e-5
            runs = {"liemech": ours(m, q, v, method, h)}
            runs |= {f"C++ {k}": theirs(call, m, q, v, method, h) for k, call in rivals.items()}
            if rivals:
                a, b = runs["liemech"](20), runs["C++ off"](20)
                assert np.abs(a - b).max() < 1e-13, "the two do not compute the same"
            if rebound and title == "leapfrog":
                sim = simulation(rebound, m, q, v)
                sim.integrator, sim.dt = "leapfrog", h
                runs["REBOUND"] = sim.steps
            found = least(runs, rounds)
            own = found["liemech"]
            columns = [found.get(name) for name in ("liemech", "C++ off", "C++ fast", "REBOUND")]
            ratios = [None if x is None else own / x for x in columns[1:]]
            rows.append([title, n, *columns, *ratios])
    return rows


def to_an_accuracy(rebound: Any, rounds: int, t_end: float = 60.0) -> list[list[Any]]:
    """Ten planets: error of the places at the end, and milliseconds."""
    m, q, v = planets()
    rows: list[list[Any]] = []
    fine = ours(m, q, v, lm.Splitting(order=8), t_end / 16000)(16000)

    def add(name: str, run: Callable[[], np.ndarray]) -> None:
        error, spent = float(np.abs(run() - fine).max()), np.inf
        for _ in range(rounds):
            begun = time.process_time()
            run()
            spent = min(spent, time.process_time() - begun)
        rows.append([name, error, 1e3 * spent])

    for steps in (400, 600, 800, 1200):
        run = ours(m, q, v, lm.Splitting(order=8), t_end / steps)
        add(f"liemech, order 8, {steps} steps", lambda run=run, steps=steps: run(steps))
    if rebound:

        def ias15() -> np.ndarray:
            sim = simulation(rebound, m, q, v)
            sim.integrator = "ias15"
            sim.integrate(t_end)
            return places(sim)

        add("REBOUND, IAS15", ias15)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=7, help="how often each is measured")
    parser.add_argument("--out", type=Path, default=None, help="where the JSON goes")
    parser.add_argument("--quick", action="store_true", help="one round of each: does it run?")
    options = parser.parse_args()
    options.rounds = 1 if options.quick else options.rounds
    there = importlib.util.find_spec("rebound") is not None
    rebound = importlib.import_module("rebound") if there else None
    steps = a_step(rebound, options.rounds)
    columns = ["method", "bodies", "liemech", "C++ off", "C++ fast", "REBOUND",
               "over off", "over fast", "over REBOUND"]  # fmt: skip
    harness.table("Gravity of all pairs, microseconds a step", columns, steps)
    accurate = to_an_accuracy(rebound, options.rounds)
    rows = [[name, f"{error:.1e}", ms] for name, error, ms in accurate]
    harness.table("A star and nine planets, time 60", ["", "error", "ms"], rows)
    if options.out:
        about = {"machine": harness.machine(), "steps": steps, "accurate": accurate}
        options.out.write_text(json.dumps(about, indent=1) + "\n")


if __name__ == "__main__":
    main()
