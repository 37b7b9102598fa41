"""Ensembles of few bodies, bodies with parameters of their own, and `import liemech`: processor time,
median and least of many rounds, and what was wanted.

    python tests/benchmarks/small_ensembles.py [--quick]
"""

import argparse
import statistics
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import calls
import numpy as np

import liemech as lm

IMPORT = """
import time, numpy
begun = time.process_time()
import liemech
print(time.process_time() - begun)
"""


def spent(call: Callable[[], Any], rounds: int, times: int = 1) -> list[float]:
    """Seconds of processor time of a call in each round of so many calls."""
    call()
    found = []
    for _ in range(rounds):
        begun = time.process_time()
        for _ in range(times):
            call()
        found.append((time.process_time() - begun) / times)
    return found


def plan(system: Any, method: Any, **options: Any) -> lm.Plan:
    return lm.Plan(system, method, compiled=True, progress=False, **options)


def free_bodies(rounds: int) -> Iterator[tuple[str, list[float], float, str, str]]:
    """256 bodies with an inertia each, to t = 20, by methods that end within 2e-9 of the exact motion."""
    bodies = [lm.RigidBody([1.0, 1.5, 2.0 + 0.4 * i / 256]) for i in range(256)]
    mu = np.random.default_rng(1).normal(size=(256, 3))
    mu /= np.linalg.norm(mu, axis=1)[:, None]
    start = bodies[0].state(mu=mu)
    exact = [b.exact(b.state(mu=m), 20.0).mu for b, m in zip(bodies, mu, strict=True)]
    adaptive = {"rtol": 1e-9}, {"t_end": 20.0, "t_eval": [20.0]}
    fixed = {"h": 20.0 / 60, "every": 60}, {"steps": 60}
    for name, method, (options, span) in (
        ("Taylor 12, adaptive, rtol 1e-9", lm.Taylor(12), adaptive),
        ("Taylor 10, 60 steps", lm.Taylor(10), fixed),
        ("exact flow, one step", lm.ExactFreeBody(), ({"h": 20.0}, {"steps": 1})),
    ):
        prepared = plan(bodies, method, **options)
        error = np.abs(prepared.run(start, **span).mu[-1] - exact).max()
        assert error < 2e-9, (name, error)
        found = spent(lambda prepared=prepared, span=span: prepared.run(start, **span), rounds)
        yield f"256 inertias to t = 20, {name}, error {error:.0e}", found, 1e3, "ms", "0.55"


def table(rounds: int) -> Iterator[tuple[str, list[float], float, str, str]]:
    """Name, seconds, the factor of the unit, the unit, what was wanted."""
    few, many = calls.many(16), calls.many(5000)
    for name, system in ("one inertia", calls.BODY), ("an inertia each", calls.bodies(16)):
        run = plan(system, calls.RKMK4, h=0.1, every=20).run
        found = spent(lambda run=run: run(few, steps=20), rounds, 50)
        yield (f"16 bodies, {name}, 20 steps of RKMK4, a body and step", found, 1e9 / 320, "ns", "270")
    yield from free_bodies(rounds)
    yield ("5000 gyrostats in a field, made", spent(lambda: calls.gyrostats(5000), 5), 1.0, "s", "0.5")
    gyrostats, inertias = calls.gyrostats(5000), calls.bodies(5000)
    several = lm.each(np.array([body.inertia for body in inertias]))
    by_array = lm.LiePoissonSystem(lm.SO3(), lm.KineticEnergy(several))
    for name, own, one in (
        ("5000 inertias by a list", inertias, calls.BODY),
        ("5000 inertias by an array", by_array, calls.BODY),
        ("5000 gyrostats by a list", gyrostats, gyrostats[0]),
    ):
        runs = [plan(system, calls.RKMK4, h=0.1, every=20).run for system in (own, one)]
        ratios = []
        for _ in range(rounds):  # in turn
            (x,), (y,) = (spent(lambda run=run: run(many, steps=20), 1) for run in runs)
            ratios.append(x / y)
        yield f"{name}, 20 steps, beside one for all", ratios, 1.0, "times", "2"
    fresh = [sys.executable, "-c", IMPORT]
    loads = [float(subprocess.run(fresh, capture_output=True, check=True).stdout) for _ in range(5)]
    yield "`import liemech` beside NumPy", loads, 1e3, "ms", "25"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few rounds: rough numbers")
    rounds = 5 if parser.parse_args().quick else 41
    warnings.simplefilter("ignore", lm.errors.InertiaWarning)
    print("| | median | least | wanted |\n| --- | --- | --- | --- |")
    for name, found, factor, unit, wanted in table(rounds):
        median, least = factor * statistics.median(found), factor * min(found)
        print(f"| {name} | {median:.2g} {unit} | {least:.2g} | {wanted} |", flush=True)


if __name__ == "__main__":
    main()
