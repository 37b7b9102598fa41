"""Systems of many sites beside C++: classical spins with exchange on a ring and on cubic lattices, a
step of RKMK4; with how it grows, what a kernel costs, and what two workers gain.

    python tests/benchmarks/sites.py [--rounds 5] [--largest 100000] [--cliff FILE]

Processor time in ns a site and step, least of the rounds, which take turns; of workers wall time.
The last column is the difference from C++ after 20 steps.  `--cliff` draws instead how a step of rings
grows when the energy is a sum of terms, and when it is one formula of all spins.
"""

import argparse
import ctypes
import itertools
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import baseline
import harness
import numpy as np

import liemech as lm

SOURCE = Path(__file__).with_suffix(".cpp")
H, FIELD = 0.05, np.array([0.0, 0.0, 0.1])
WORK = 2_000_000
"""Sites times steps of one measurement, about."""


@lm.record
class Exchange(lm.Term):
    """Neighbours that turn to one side."""

    J: float

    def energy(self, a: Any, b: Any) -> float:
        return -self.J * lm.dot(a.mu, b.mu)


@lm.record
class Zeeman(lm.Term):
    """A field that is the same everywhere."""

    B: lm.Vec

    def energy(self, a: Any) -> float:
        return -lm.dot(self.B, a.mu)


@lm.record
class OneFormula(lm.Hamiltonian):
    """The same energy of a ring as a formula of all spins."""

    J: float
    B: lm.Vec

    def energy(self, mu: Any) -> float:
        n = len(mu) // 3
        total = 0.0
        for i in range(n):
            for c in range(3):
                total -= mu[3 * i + c] * (self.J * mu[3 * ((i + 1) % n) + c] + self.B[c])
        return total

    def gradient(self, mu: Any) -> Any:
        n = len(mu)
        return lm.vec(*(-self.J * (mu[i - 3] + mu[(i + 3) % n]) - self.B[i % 3] for i in range(n)))


def lattice(n: int, cubic: bool) -> tuple[Any, int, Any]:
    """The graph, the number of sites, and the table of neighbours as C++ has it; None for a ring."""
    if not cubic:
        return lm.neighbours.ring(n), n, None
    i = np.arange(n**3).reshape(n, n, n)
    near = [np.roll(i, shift, axis).ravel() for axis in range(3) for shift in (1, -1)]
    return lm.neighbours.cubic(n, n, n), n**3, np.ascontiguousarray(near)


def spins(n: int) -> np.ndarray:
    """Directions that differ by some tens of degrees."""
    s = np.random.default_rng(1).normal(size=(n, 3)) * 0.3 + [0.0, 0.0, 1.0]
    return s / np.linalg.norm(s, axis=1)[:, None]


def opponents() -> dict[str, Any]:
    """The C++ of `sites.cpp`, without and with contraction; empty without g++."""
    names = {"off": "C++", "fast": "C++ contracted"}
    found = {names[mode]: library for mode, library in baseline.libraries(SOURCE).items()}
    return found


def theirs(library: Any, table: Any, s: np.ndarray, steps: int) -> np.ndarray:
    """The spins after so many steps of C++."""
    after = s.copy()
    pointer = lambda x: None if x is None else x.ctypes.data_as(ctypes.c_void_p)  # noqa: E731
    library.rkmk4(
        ctypes.c_size_t(len(s)), ctypes.c_int(0 if table is None else len(table)), pointer(table),
        pointer(after), pointer(FIELD), ctypes.c_double(H), ctypes.c_long(steps),
    )  # fmt: skip
    return after


def seconds(work: Callable[[], Any], clock: Callable[[], float]) -> float:
    """The time of a call."""
    begun = clock()
    work()
    return clock() - begun


def measured(n: int, cubic: bool, rounds: int, libraries: dict[str, Any]) -> list[str]:
    """A row of the table."""
    graph, sites, table = lattice(n, cubic)
    terms = lm.Terms(Exchange(1.0).over(graph), Zeeman(FIELD))
    system = lm.LiePoissonSystem(lm.SO3() ** sites, terms)
    s, steps = spins(sites), max(4, WORK // sites)
    start = system.state(mu=s)
    plans = {w: lm.Plan(system, lm.RKMK(order=4), h=H, every=10**9, workers=w) for w in (1, 2)}
    begun = time.perf_counter()
    first = plans[1].run(start, steps=20)
    made = time.perf_counter() - begun
    ways: dict[str, Any] = {"ours": (lambda: plans[1].run(start, steps=steps), time.process_time)}
    for name, library in libraries.items():
        ways[name] = (lambda library=library: theirs(library, table, s, steps), time.process_time)
    for w in (1, 2):
        ways[f"{w}"] = (lambda w=w: plans[w].run(start, steps=steps), time.perf_counter)
    least = dict.fromkeys(ways, float("inf"))
    for _ in range(rounds):
        for name, (work, clock) in ways.items():
            least[name] = min(least[name], 1e9 * seconds(work, clock) / steps / sites)
    off = [np.abs(theirs(x, table, s, 20) - first.mu[-1]).max() for x in libraries.values()]
    return [
        f"{'cubic' if cubic else 'ring'} {sites}",
        *(f"{least[name]:.1f}" for name in ("ours", *libraries)),
        f"{least['1'] / least['2']:.2f}",
        f"{made:.2f}",
        f"{max(off):.0e}" if off else "",
    ]


def grown(energy: Callable[[int], Any], n: int, steps: int) -> float:
    """ns a site and step of a ring, when native code is there if there is to be any."""
    system = lm.LiePoissonSystem(lm.SO3() ** n, energy(n))
    plan = lm.Plan(system, lm.RKMK(order=4), h=H, every=10**9, progress=False)
    start = system.state(mu=spins(n))
    plan.run(start, steps=steps)
    spent = [seconds(lambda: plan.run(start, steps=steps), time.process_time) for _ in range(3)]
    return 1e9 * min(spent) / steps / n


def cliff(path: Path, quick: bool) -> None:
    """Draw the time of a step over the number of spins, as terms and as one formula."""
    terms = lambda n: lm.Terms(Exchange(1.0).over(lm.neighbours.ring(n)), Zeeman(FIELD))  # noqa: E731
    whole = lambda n: OneFormula(1.0, FIELD)  # noqa: E731
    sizes = [6, 32, 128] if quick else [6, 10, 16, 32, 64, 128, 256, 512]
    formula = [grown(whole, n, 200_000 // n if n <= 32 else 4) for n in sizes]
    larger = [] if quick else [1024, 4096, 2**14, 2**16, 2**18, 2**20]
    summed = [grown(terms, n, max(4, WORK // n)) for n in sizes + larger]
    harness.table(
        "A ring, ns a spin and step",
        ["spins", "terms", "one formula"],
        list(itertools.zip_longest(sizes + larger, summed, formula, fillvalue="")),
    )
    picture, ax = lm.plots.subplots(figsize=(7.0, 4.2))
    ax.loglog(sizes, formula, "o-", label="one formula of all spins")
    ax.loglog(sizes + larger, summed, "s-", label="a sum of terms over a graph")
    ax.set(xlabel="spins on a ring", ylabel="ns a spin and step of RKMK4")
    ax.text(10.0, 2.0 * max(formula[:3]), "written out", fontsize=8)
    ax.text(sizes[-1], 0.5 * formula[-1], "plain Python", fontsize=8, ha="center")
    ax.legend(fontsize=8, loc="center right", frameon=False)
    lm.plots.save(picture, path)
    print(f"written: {path}")


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--largest", type=int, default=100_000)
    parser.add_argument("--quick", action="store_true", help="a thousand spins: does it run?")
    parser.add_argument("--cliff", type=Path, help="where the picture of growth goes")
    given = parser.parse_args()
    if given.cliff:
        cliff(given.cliff, given.quick)
        return
    if given.quick:
        given.rounds, given.largest = 1, 1000
    libraries = opponents()
    head = ["spins", "ours", *libraries, "gain of two workers", "first run, s", "difference"]
    print("| " + " | ".join(head) + " |")
    print("|" + " --- |" * len(head))
    cases = [(n, False) for n in (100, 1000, 10_000, 100_000, 1_000_000)]
    cases += [(n, True) for n in (10, 22, 46)]
    for n, cubic in cases:
        if (n**3 if cubic else n) <= given.largest:
            row = measured(n, cubic, given.rounds, libraries)
            print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
