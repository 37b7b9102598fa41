"""Gravity of all pairs beside C++ and REBOUND: a step for 10 to 1000 bodies, and ten planets to a given accuracy.

    python tests/benchmarks/gravity.py [--rounds 7] [--figure FILE] [--out gravity.json]

Processor time, least of the rounds, which take turns; "plain" is without compensated sums, as C++ is. Without REBOUND
its columns are missing, and ten planets have no opponent.
"""

import argparse
import ctypes
import importlib
import importlib.util
import itertools
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import baseline
import harness
import numpy as np

import liemech as lm
from liemech.tableaus import SPLITTINGS

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


def ours(m: np.ndarray, q: np.ndarray, v: np.ndarray, method: Any, h: float, **options: Any) -> Any:
    """Steps of the library: a function of their number that gives the places at the end."""
    system = lm.models.NBody(m)
    start = system.state(q.ravel(), (m[:, None] * v).ravel())
    plan = lm.Plan(system, method, h=h, every=10**9, compiled=True, progress=False, **options)
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
    """Microseconds a step, of so many steps that the call does not count."""
    steps = {}
    for name, run in runs.items():
        run(2)
        n, spent = 2, 0.0
        while spent < 0.25 * DURATION:
            n *= 4
            begun = time.process_time()
            run(n)
            spent = time.process_time() - begun
        steps[name] = max(2, int(n * DURATION / spent))
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
            runs["plain"] = ours(m, q, v, method, h, compensated=False)
            runs |= {f"C++ {k}": theirs(call, m, q, v, method, h) for k, call in rivals.items()}
            if rivals:
                a, b = runs["liemech"](20), runs["C++ off"](20)
                assert np.abs(a - b).max() < 1e-13, "the two do not compute the same"
            if rebound and title == "leapfrog":
                sim = simulation(rebound, m, q, v)
                sim.integrator, sim.dt = "leapfrog", h
                runs["REBOUND"] = sim.steps
            found = least(runs, rounds)
            names = "liemech", "plain", "C++ off", "C++ fast", "REBOUND"
            own, plain, *others = columns = [found.get(name) for name in names]
            ratios = [None if x is None else y / x for x in others[:1] for y in (plain, own)]
            ratios += [None if x is None else own / x for x in others[1:]]
            rows.append([title, n, *columns, *ratios])
    return rows


def ours_in_pairs(m: np.ndarray, q: np.ndarray, v: np.ndarray, tableau: Any, h: float) -> Callable[[int], np.ndarray]:
    """Steps of the library of Kepler motions about the star and the perturbation in turn."""
    system = lm.models.PlanetarySystem(m)
    start = system.state_of(q, m[:, None] * v)
    method = lm.Splitting(tableau=tableau)
    plan = lm.Plan(system, method, h=h, every=10**9, compiled=True, progress=False)
    return lambda steps: system.bodies(plan.run(start, steps=steps).y[-1])[0].reshape(-1, 3)


def contenders(rebound: Any, t_end: float) -> dict[str, Callable[[float], Callable[[], Any]]]:
    """By name: of a number of steps, or a tolerance, a run that gives the places at the end."""
    star = planets()

    def at_once(make: Any, what: Any) -> Any:
        def prepared(steps: float) -> Callable[[], Any]:
            run = make(*star, what, t_end / int(steps))
            return lambda: run(int(steps))

        return prepared

    def theirs(name: str, **settings: Any) -> Any:
        def prepared(steps: float) -> Callable[[], Any]:
            def run() -> np.ndarray:
                sim = simulation(rebound, *star)
                sim.integrator = name
                for key, value in settings.items():
                    setattr(sim.integrator, key, value)
                if name == "ias15":
                    sim.integrator.epsilon = steps
                    sim.integrate(t_end)
                else:
                    sim.dt = t_end / int(steps)
                    sim.steps(int(steps))
                    sim.synchronize()
                return places(sim)

            return run

        return prepared

    found = {f"liemech, order {k}": at_once(ours, lm.Splitting(order=k)) for k in (4, 6, 8)}
    found["liemech, (10, 6, 4)"] = at_once(ours_in_pairs, SPLITTINGS["ABA (10, 6, 4)"])
    if rebound:
        found["REBOUND, IAS15"] = theirs("ias15")
        found["REBOUND, WHFast"] = theirs("whfast", safe_mode=0)
        found["REBOUND, SABA(10, 6, 4)"] = theirs("saba10,6,4", safe_mode=0)
        found["REBOUND, leapfrog"] = theirs("leapfrog")
    return found


def to_an_accuracy(rebound: Any, rounds: int, t_end: float = 60.0) -> dict[str, list[list[float]]]:
    """Ten planets: by method its steps (of IAS15 the tolerance), the error of the places at the end, and milliseconds."""
    fine = ours(*planets(), lm.Splitting(order=8), t_end / 16000)(16000)
    found: dict[str, list[list[float]]] = {}
    for name, prepare in contenders(rebound, t_end).items():
        settings: list[float] = [round(100 * 2 ** (0.5 * k)) for k in range(17)]
        settings = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-9] if "IAS15" in name else settings
        for setting in settings if rounds > 1 else settings[2:4]:
            run, spent = prepare(setting), np.inf
            error = float(np.abs(run() - fine).max())
            for _ in range(rounds):
                begun = time.process_time()
                run()
                spent = min(spent, time.process_time() - begun)
            own = found.setdefault(name, [])
            if error < 1.0:
                own.append([setting, error, 1e3 * spent])
            if setting > 1.0 and (error < 1e-14 or (len(own) > 1 and error > 0.7 * own[-2][1])):
                break  # the rest is rounding
    return found


def milliseconds(rows: list[list[float]], error: float) -> float:
    """To this error, between two runs on a line in logarithms; nan beyond them."""
    for (_, e, t), (_, f, u) in itertools.pairwise(rows):
        if f <= error < e:
            return float(np.exp(np.log(t) + np.log(e / error) / np.log(e / f) * np.log(u / t)))
    return float(rows[0][2]) if rows[0][1] <= error else float("nan")


def figure(curves: dict[str, list[list[float]]], path: Path) -> None:
    """Work over error."""
    picture, ax = lm.plots.subplots(figsize=(8.0, 4.6))
    lm.plots.work_precision(
        {name: tuple(np.array(rows).T[1:]) for name, rows in curves.items()},
        ax=ax,
        xlabel="largest error of a place after 9.5 orbits of the first planet",
        ylabel="processor time (ms)",
    )
    for line in ax.lines:
        if str(line.get_label()).startswith("REBOUND"):
            line.set(linestyle="--", alpha=0.8)
    ax.axvline(1e-11, color="0.6", lw=0.8)
    ax.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    lm.plots.save(picture, path)
    print(f"written: {path}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=7, help="how often each is measured")
    parser.add_argument("--out", type=Path, default=None, help="where the JSON goes")
    parser.add_argument("--quick", action="store_true", help="one round of each: does it run?")
    parser.add_argument("--figure", type=Path, help="where the picture of ten planets goes")
    options = parser.parse_args()
    options.rounds = 1 if options.quick else options.rounds
    there = importlib.util.find_spec("rebound") is not None
    rebound = importlib.import_module("rebound") if there else None
    steps = a_step(rebound, options.rounds)
    columns = ["method", "bodies", "liemech", "plain", "C++ off", "C++ fast", "REBOUND",
               "plain over off", "over off", "over fast", "over REBOUND"]  # fmt: skip
    harness.table("Gravity of all pairs, microseconds a step", columns, steps)
    accurate = to_an_accuracy(rebound, options.rounds)
    errors = 1e-5, 1e-8, 1e-11, 1e-13
    rows = [[name, *(milliseconds(own, e) for e in errors)] for name, own in accurate.items()]
    title = "A star and nine planets, time 60: ms to an error"
    harness.table(title, ["", *(f"{e:g}" for e in errors)], rows)
    if options.figure:
        figure(accurate, options.figure)
    if options.out:
        about = {"machine": harness.machine(), "steps": steps, "accurate": accurate}
        options.out.write_text(json.dumps(about, indent=1) + "\n")


if __name__ == "__main__":
    main()
