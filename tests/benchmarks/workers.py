"""What two workers gain: many sites of one system divided between two threads, beside C++ in one and two.

    python tests/benchmarks/workers.py [--quick] [--rounds N] [--out FILE]

Wall time in ns a site and step (of gravity, a pair and step) of whole runs that keep the last state, least of
several rounds in turn.  It means something on a machine with two processors that nothing else uses.
"""

from __future__ import annotations

import argparse
import ctypes
import functools
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import spins
from harness import table, write

import liemech as lm
from liemech.models import NBody

H = 0.05


def gains(name: str, things: float, runs: dict[int, Callable[[], Any]], rounds: int) -> list[Any]:
    """A line of the table: times with one and two workers over so many things, and their ratio."""
    least = dict.fromkeys(runs, np.inf)
    for _ in range(rounds + 1):
        for workers, run in runs.items():
            begun = time.perf_counter()
            run()
            least[workers] = min(least[workers], time.perf_counter() - begun)
    one, two = (1e9 * least[w] / things for w in (1, 2))
    return [name, one, two, one / two]


def of_spins(edge: int, work: float, rounds: int) -> list[list[Any]]:
    """Lines of spins on a cubic lattice."""
    lattice = lm.neighbours.cubic(edge, edge, edge)
    sites = lattice.sites
    system, s = spins.spins_of(lattice)
    start, lines = system.state(mu=s), []
    loop = spins.build("off")
    methods: list[tuple[Any, int]] = [
        (lm.RKMK(order=4), 12), (lm.SublatticeSplitting(order=2), 3),
        (lm.SublatticeSplitting(order=4), 15), (lm.BondSplitting(order=2), 17),
    ]  # fmt: skip
    for method, pace in methods:
        steps = max(4, int(work / pace / sites))
        plans = [lm.Plan(system, method, h=H, every=10**9, workers=w, progress=False) for w in (1, 2)]
        found = [plan.run(start, steps=3).mu for plan in plans]
        if not np.array_equal(*found):
            raise AssertionError(f"{method}: two workers have other bits than one")
        runs = {w: functools.partial(plan.run, start, steps=steps) for w, plan in enumerate(plans, 1)}
        lines.append(gains(f"cubic {edge}^3, {method!r}", sites * steps, runs, rounds))
        if isinstance(method, lm.SublatticeSplitting):
            theirs = {w: functools.partial(in_threads, loop, edge, s, steps, method, w) for w in (1, 2)}
            if not np.abs(in_threads(loop, edge, s, 3, method, 2) - found[0][-1]).max() < 1e-13:
                raise AssertionError(f"{method}: C++ and liemech differ")
            lines.append(gains("C++", sites * steps, theirs, rounds))
    return lines


def in_threads(loop: Any, edge: int, s: np.ndarray, steps: int, method: Any, threads: int) -> Any:
    """The spins after so many steps of C++ in threads."""
    found, shares = s.copy(), np.array([share for _, share in method.tableau.sequence(2)])
    places = [ctypes.c_void_p(x.ctypes.data) for x in (found, shares)]
    loop.spins_in_threads(
        ctypes.c_long(edge), places[0], ctypes.c_double(H), ctypes.c_long(steps), places[1],
        ctypes.c_long(len(shares) - 1), ctypes.c_long(threads),
    )  # fmt: skip
    return found


def of_masses(n: int, work: float, rounds: int) -> list[Any]:
    """A line of masses that all attract each other."""
    rng = np.random.default_rng(n)
    system = NBody(rng.uniform(0.5, 1.5, n) / n)
    start = system.state(3.0 * rng.normal(size=3 * n), rng.normal(size=3 * n) / n)
    pairs = n * (n - 1) // 2
    steps = max(2, int(work / 0.7 / pairs))
    plans = [lm.Plan(system, lm.StormerVerlet(), h=1e-3, every=10**9, workers=w, progress=False) for w in (1, 2)]
    if not np.array_equal(*[plan.run(start, steps=3).q for plan in plans]):
        raise AssertionError("two workers have other bits than one")
    runs = {w: functools.partial(plan.run, start, steps=steps) for w, plan in enumerate(plans, 1)}
    return gains(f"gravity, {n} masses, StormerVerlet()", pairs * steps, runs, rounds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few steps: does it run?")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--out")
    chosen = parser.parse_args()
    rounds, work = (1, 3e6) if chosen.quick else (chosen.rounds, 1e8)
    lines = of_spins(46, work, rounds)
    lines += [of_masses(n, work, rounds) for n in ((1000,) if chosen.quick else (1000, 4000))]
    table("wall time, ns, and what two workers gain", ["", "one", "two", "gain"], lines)
    if chosen.out:
        write(chosen.out, {"gains": {line[0]: line[1:] for line in lines}})


if __name__ == "__main__":
    main()
