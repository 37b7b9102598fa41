"""The way back through runs of many spins: what J^T w and the derivatives by all couplings cost over the run itself,
and how much memory they take, as curves in the number of sites and of steps.

    python tests/benchmarks/adjoint.py [--quick] [--picture FILE]

The motion is chaotic, and J grows; long runs have short steps, so that it does not overflow. Processor time, the least
of some rounds, run and way back in turn.  Memory is the peak of what Python and NumPy allocate.
"""

from __future__ import annotations

import sys
import time
import tracemalloc
from typing import Any

import numpy as np

import liemech as lm
from liemech.rooms.derivatives.of_sites.adjoint import BackwardRun


@lm.record
class Exchange(lm.Term):
    """Heisenberg's energy of two neighbours."""

    J: float

    def energy(self, a: Any, b: Any) -> float:
        return -self.J * lm.dot(a.mu, b.mu)


METHODS = [lm.RKMK(order=4), lm.SublatticeSplitting()]


def measured(method: Any, n: int, steps: int, rounds: int) -> dict[str, float]:
    """Of a ring of spins: nanoseconds a site and step, and ratios to that."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    couplings = lm.each(1.0 + 0.1 * rng.normal(size=n))
    terms = lm.Terms(Exchange(couplings).over(lm.neighbours.ring(n)))
    spins = lm.LiePoissonSystem(lm.SO3() ** n, terms)
    start, w = spins.state(mu=directions), rng.normal(size=3 * n)
    plan = lm.Plan(spins, method, h=min(0.02, 20.0 / steps), every=steps, compiled=True, progress=False)
    first = plan._sites.started(plan, start)
    ways = {
        "run": lambda: plan.run(start, steps=steps),
        "J v": lambda: plan.tangent(start, steps=steps, along=w),
        "J^T w": lambda: BackwardRun(plan._sites, first, steps, 0.0).back({steps: w}),
        "couplings": lambda: BackwardRun(plan._sites, first, steps, 0.0, ("J",)).back({steps: w}),
    }
    found = {}
    for name in ways:  # compiles, and tells the memory
        ways[name]()
        tracemalloc.start()
        ways[name]()
        found[f"memory of {name}"] = tracemalloc.get_traced_memory()[1] / 1e6
        tracemalloc.stop()
    least = dict.fromkeys(ways, float("inf"))
    for _ in range(rounds):
        for name, way in ways.items():
            begun = time.process_time()
            way()
            least[name] = min(least[name], time.process_time() - begun)
    found["ns"] = least["run"] / n / steps * 1e9
    return found | {name: x / least["run"] for name, x in least.items()}


HEAD = (
    "| method | sites | steps | run, ns a site and step | J v | J^T w | J^T w and all couplings "
    "| MB of the run | of J^T w | and couplings |"
)
COLUMNS = ("ns", "J v", "J^T w", "couplings", "memory of run", "memory of J^T w", "memory of couplings")


def main(quick: bool, picture: str | None) -> None:
    sizes = [100, 1000] if quick else [100, 1000, 10_000, 100_000]
    lengths = [10, 100] if quick else [10, 100, 1000, 10_000, 100_000]
    work = 1e4 if quick else 2e6
    print(HEAD + "\n|" + " --- |" * 10)
    kept: list[Any] = []
    for method in METHODS[: 1 if quick else 2]:
        cases = [(n, max(10, int(work / n)) if n < 1e5 else 60) for n in sizes]
        cases += [(200, steps) for steps in lengths]
        for n, steps in cases:
            found = measured(method, n, steps, 1 if quick or n * steps > 1e7 else 3)
            kept.append((method.name, n, steps, found))
            cells = " | ".join(f"{found[name]:.{1 if found[name] < 100 else 0}f}" for name in COLUMNS)
            print(f"| {method.name} | {n} | {steps} | {cells} |", flush=True)
    if picture:
        drawn(kept, picture)


def drawn(kept: list[Any], picture: str) -> None:
    """The curves: full for J^T w, dashed with all couplings."""
    figure, axes = lm.plots.subplots(2, 2, figsize=(9.0, 5.6), sharey="row", sharex="col")
    for column, (what, label) in enumerate(((1, "sites $N$"), (2, "steps $n$ of 200 sites"))):
        for k, name in enumerate(dict.fromkeys(row[0] for row in kept)):
            own = [r for r in kept if r[0] == name and ((r[1] == 200) is bool(column))]
            x = [r[what] for r in own]
            style = {"marker": "os"[k], "markersize": 4.5, "color": lm.plots.COLORS[k]}
            for row, before in enumerate(("", "memory of ")):
                for one, dashes in (("J^T w", "-"), ("couplings", "--")):
                    words = f"{name}, {'$J^T w$' if dashes == '-' else 'and all couplings'}"
                    y = [r[3][before + one] for r in own]
                    axes[row, column].loglog(x, y, dashes, label=words, **style)
        axes[1, column].set_xlabel(label)
    axes[0, 0].set_ylabel("time over that of the run")
    axes[1, 0].set_ylabel("memory (MB)")
    named = axes[0, 0].get_legend_handles_labels()
    figure.legend(*named, loc="outside upper center", ncols=2, frameon=False, fontsize=8.5)
    lm.plots.save(figure, picture)


if __name__ == "__main__":
    named = sys.argv.index("--picture") + 1 if "--picture" in sys.argv else None
    main("--quick" in sys.argv, sys.argv[named] if named else None)
