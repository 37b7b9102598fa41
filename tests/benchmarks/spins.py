"""Heisenberg spins on a ring and on cubic lattices: splittings against C++ loops of the same steps.

    python tests/benchmarks/spins.py [--quick] [--large] [--out FILE]

Figures are nanoseconds of processor time per site and step of whole runs that keep the last state, the
least of several rounds in turn.  Ours is compensated, and not ("plain"), as runs are by default.  C++
is built with and without contraction of products and sums.
"""

import argparse
import ctypes
import functools
import itertools
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from baseline import FLAGS
from harness import table, write

import liemech as lm
from liemech.formulas.classes.records import records_in
from liemech.formulas.sites import EIGHT, SiteTable
from liemech.rooms.sites.parts_of_spins import Sublattices

SOURCE = Path(__file__).with_name("spins.cpp")


@lm.record
class Exchange(lm.Term):
    J: float

    def energy(self, a: Any, b: Any) -> float:
        return -self.J * lm.dot(a.mu, b.mu)


def build(contract: str) -> Any:
    """The loops of `spins.cpp`, compiled for this processor."""
    path = Path(tempfile.mkdtemp()) / f"spins-{contract}.so"
    command = ["g++", *FLAGS, f"-ffp-contract={contract}", str(SOURCE), "-o", str(path)]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(path))


def stepped(loop: Any, n: int, cubic: bool, s: np.ndarray, h: float, steps: int, method: Any) -> np.ndarray:
    """The spins after so many steps in C++."""
    found, bonds = s.copy(), isinstance(method, lm.BondSplitting)
    turns = method.tableau.sequence(6 if bonds and cubic else 2)
    shares, colours = np.array([share for _, share in turns]), np.array([k for k, _ in turns])
    pointer = [ctypes.c_void_p(x.ctypes.data) for x in (found, shares, colours)]
    (loop.bonds if bonds else loop.spins)(
        ctypes.c_long(n), ctypes.c_int(cubic), pointer[0], ctypes.c_double(h), ctypes.c_long(steps),
        pointer[1], *pointer[2:] * bonds, ctypes.c_long(len(shares) - 1),
    )  # fmt: skip
    return found


def tabled(loop: Any, system: Any) -> Callable[..., np.ndarray]:
    """C++ by tables of neighbours, eight sites side by side, of a cubic lattice with even edges: a function of
    spins, h, steps and method.  Exchange has J = 1.
    """
    motions = Sublattices(system.hamiltonian)
    places = motions.places
    (table,) = records_in(motions.of_site(places)[0], SiteTable)
    (_, first), (_, last) = places.ranges
    order, ends = places.sites.astype(np.int64), np.array([first, last])
    numbers = table.numbers.astype(np.int32).reshape(6, -1)
    rows = np.ascontiguousarray(numbers[:, :last])
    reach = np.ascontiguousarray(table.reach.array.view(np.int32).reshape(6, -1)[:, : last // EIGHT])

    def run(s: np.ndarray, h: float, steps: int, method: Any) -> np.ndarray:
        shares = np.array([share for _, share in method.tableau.sequence(2)])
        found = s.copy()
        arrays = found, order, ends, rows, reach, shares
        at = [ctypes.c_void_p(x.ctypes.data) for x in arrays]
        loop.tabled(
            at[0], ctypes.c_long(last), *at[1:5], ctypes.c_double(h), ctypes.c_long(steps), at[5],
            ctypes.c_long(len(shares) - 1),
        )  # fmt: skip
        return found

    return run


def spins_of(lattice: Any) -> tuple[Any, np.ndarray]:
    """A system and directions, about half of them along one axis."""
    s = 0.5 * np.random.default_rng(1).normal(size=(lattice.sites, 3)) + [0.0, 0.0, 1.0]
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    return lm.LiePoissonSystem(lm.SO3() ** lattice.sites, lm.Terms(Exchange(1.0).over(lattice))), s


def least(runs: dict[str, Callable[[], Any]], rounds: int) -> dict[str, float]:
    """The least processor time of each, in turn."""
    found = dict.fromkeys(runs, np.inf)
    for _ in range(rounds):
        for name, run in runs.items():
            begun = time.process_time()
            run()
            found[name] = min(found[name], time.process_time() - begun)
    return found


def pace(chosen: Any) -> dict[str, Any]:
    """Nanoseconds per site and step."""
    loops = {f"C++, {how}": build(how) for how in ("off", "fast")}
    near = lm.neighbours
    cases: list[Any] = [
        ("ring 10^3", near.ring(1000), 1000, False),
        ("ring 10^4", near.ring(10_000), 10_000, False),
        ("cubic 10^3", near.cubic(10, 10, 10), 10, True),
        ("cubic 22^3", near.cubic(22, 22, 22), 22, True),
        ("cubic 46^3", near.cubic(46, 46, 46), 46, True),
    ]
    if chosen.large:
        cases.append(("cubic 100^3", near.cubic(100, 100, 100), 100, True))
    kept: dict[str, Any] = {}
    lines = []
    for name, lattice, n, cubic in cases:
        system, s = spins_of(lattice)
        start = system.state(mu=s)
        for kind, order in itertools.product((lm.SublatticeSplitting, lm.BondSplitting), (2, 4)):
            method, h = kind(order), 0.05
            steps = max(50, (4_000_000 if chosen.quick else 20_000_000) // lattice.sites)
            plans = {
                key: lm.Plan(system, method, h=h, every=steps, compensated=c, progress=False)
                for key, c in (("ours", True), ("plain", None))
            }
            ours = plans["plain"].run(start, steps=20).mu[-1]
            theirs = stepped(loops["C++, off"], n, cubic, s, h, 20, method)
            if not np.abs(ours - theirs).max() < 1e-13:
                raise AssertionError(f"{name}: C++ and liemech differ by {np.abs(ours - theirs).max()}")
            given = n, cubic, s, h, steps, method
            runs: dict[str, Any] = {key: functools.partial(p.run, start, steps=steps) for key, p in plans.items()} | {
                key: functools.partial(stepped, f, *given) for key, f in loops.items()
            }
            for run in runs.values():
                run()
            times = least(runs, 3 if chosen.quick else 7)
            ns = {key: 1e9 * t / lattice.sites / steps for key, t in times.items()}
            kept[f"{name}, {method!r}"] = ns
            lines.append([f"{name}, {method!r}", *ns.values(), ns["plain"] / ns["C++, off"]])
    columns = ["", "liemech", "plain", "C++", "contracted", "plain / C++"]
    table("nanoseconds per site and step of splittings", columns, lines)
    return kept


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--large", action="store_true", help="10^6 spins too")
    parser.add_argument("--out")
    chosen = parser.parse_args()
    kept = {"pace": pace(chosen)}
    if chosen.out:
        write(chosen.out, kept)


if __name__ == "__main__":
    main()
