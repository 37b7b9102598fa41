"""Large groups of matrices: the free body of SO(n) by the isospectral midpoint beside C++ and a loop of NumPy's, RKMK,
and ideal flow on the sphere; time of a step, of compiling, and the products of matrices that a step takes.

    python tests/benchmarks/large_groups.py [--quick] [--rounds 5] [--out large_groups.json]

Processor time, least of the rounds, which take turns; BLAS on one thread.  Without g++ the columns of C++ are missing.
"""

import argparse
import ctypes
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import baseline
import numpy as np

import liemech as lm
from liemech.formulas.blas import one_thread
from liemech.integrators.free_body import isospectral_matrices

SOURCE = Path(__file__).with_suffix(".cpp")
DURATION = 0.15
"""Seconds of one measurement, about."""


def opponents() -> dict[str, Any]:
    """The C++ of `large_groups.cpp`, without and with contraction; empty without g++."""
    array = np.ctypeslib.ndpointer(np.float64, flags="C")
    found = {}
    for contraction, library in baseline.libraries(SOURCE).items():
        call = library.midpoint
        call.argtypes = [ctypes.c_long, array, array, ctypes.c_double, ctypes.c_long]
        call.restype = ctypes.c_double
        found[contraction] = call
    return found


def body(n: int) -> tuple[Any, np.ndarray, np.ndarray]:
    """A body of SO(n) with moments J_ij = l_i + l_j, its momentum, and 1/J as a matrix."""
    rng = np.random.default_rng(n)
    mass = rng.uniform(0.5, 1.5, n)
    i, j = np.triu_indices(n, 1)
    mu = rng.normal(size=len(i)) / np.sqrt(n)
    inverse = 1.0 / (mass[:, None] + mass)
    return lm.LiePoissonSystem(lm.SO(n), lm.KineticEnergy(mass[i] + mass[j])), mu, inverse


def numpys(w: np.ndarray, inverse: np.ndarray, h: float, steps: int) -> np.ndarray:
    """The same method as a loop of NumPy's; guesses from the last three momenta."""
    last = before = w
    for s in range(steps):
        m = 1.875 * w - 1.25 * last + 0.375 * before if s > 1 else 1.5 * w - 0.5 * last
        before, last, change = last, w, np.inf
        for k in range(60):
            p = (0.5 * h) * (inverse * m)
            pw = p @ m
            pwp = pw @ p
            new = w - (pw - pw.T) + 0.5 * (pwp - pwp.T)
            d, size = np.linalg.norm(new - m), np.linalg.norm(new)
            m = new
            if d <= 2.2e-16 * size or (k and 16 * d * d / change <= 2.2e-16 * size):
                break
            change = d
        w = w - 2.0 * (pw - pw.T)
    return w


def least(runs: dict[str, Callable[[int], Any]], rounds: int) -> dict[str, float]:
    """Seconds of a step, of runs that take turns; what a run costs beside its steps is taken off."""

    def spent(run: Callable[[int], Any], steps: int) -> float:
        begun = time.process_time()
        run(steps)
        return time.process_time() - begun

    counts, found = {}, {name: ([np.inf], [np.inf]) for name in runs}
    for name, run in runs.items():
        spent(run, 2)
        counts[name] = max(20, int(10 * DURATION / max(spent(run, 12) - spent(run, 2), 1e-5)))
    for _ in range(rounds):
        for name, run in runs.items():
            for times, steps in zip(found[name], (2, 2 + counts[name]), strict=True):
                times[0] = min(times[0], spent(run, steps))
    return {name: (many[0] - few[0]) / counts[name] for name, (few, many) in found.items()}


def sweeps(system: Any, start: Any, h: float, steps: int = 30) -> float:
    """How often a step computes its matrices anew, after the first ones."""
    count, sweep = [0], isospectral_matrices.midpoint_sweep

    def counted(*args: Any) -> Any:
        count[0] += 1
        return sweep(*args)

    isospectral_matrices.midpoint_sweep = counted
    try:
        plan = lm.Plan(system, lm.Isospectral(2), h=h, compiled=False, progress=False)
        begun = plan.run(start, steps=10)
        count[0] = 0
        plan.resume(begun, steps=steps)
    finally:
        isospectral_matrices.midpoint_sweep = sweep
    return count[0] / steps


def runner(system: Any, method: Any, start: Any, h: float) -> tuple[Callable[[int], Any], float]:
    """A run of so many steps in native code, and the seconds that it took to compile."""
    plan = lm.Plan(system, method, h=h, every=10**9, compiled=True, progress=False)
    begun = time.process_time()
    plan.run(start, steps=1)
    made = time.process_time() - begun
    return lambda steps: plan.run(start, steps=steps), made


def bodies(sizes: tuple[int, ...], rounds: int) -> list[dict[str, Any]]:
    """The free body of SO(n)."""
    found, h, cpp = [], 0.1, opponents()
    for n in sizes:
        system, mu, inverse = body(n)
        start, w = system.state(mu=mu), np.asarray(system.group.algebra.hat(mu))
        ours, made = runner(system, lm.Isospectral(2), start, h)
        four, _ = runner(system, lm.Isospectral(4), start, h)
        rkmk, rkmk_made = runner(system, lm.RKMK(order=4), start, h)
        runs = {"ours": ours, "order 4": four, "RKMK4": rkmk}
        runs["NumPy"] = lambda steps, w=w, inverse=inverse: numpys(w, inverse, h, steps)
        for name, call in cpp.items():
            runs[f"C++ {name}"] = lambda steps, call=call, n=n, w=w, inverse=inverse: call(
                n, w.copy(), inverse, h, steps
            )
        with one_thread():
            times = least(runs, rounds)
        row = {"n": n, "compile": made, "compile RKMK4": rkmk_made} | times
        row["sweeps"] = sweeps(system, start, h)
        found.append(row)
        shown = "  ".join(f"{k} {1e6 * t:9.2f}" for k, t in times.items())
        over = row["ours"] / row["C++ fast"] if cpp else np.nan
        print(
            f"SO({n:<3}) us a step: {shown}; {2 * row['sweeps']:.1f} products; ours/C++ {over:.2f}, "
            f"ours/NumPy {row['ours'] / row['NumPy']:.2f}; compiled in {made:.1f} s, RKMK4 {rkmk_made:.1f} s",
            flush=True,
        )
    return found


def flows(sizes: tuple[int, ...], rounds: int) -> list[dict[str, Any]]:
    """Ideal flow on the sphere: eddies of degrees 2 to 10."""
    found = []
    for n in sizes:
        sphere, rng = lm.models.ZeitlinSphere(n), np.random.default_rng(1)
        eddies = {(l, m): rng.normal() / l for l in range(2, 11) for m in range(-l, l + 1)}
        start, h = sphere.from_harmonics(eddies), 0.5 * sphere.hbar
        ours, made = runner(sphere, lm.Isospectral(2), start, h)
        a, b = (rng.normal(size=(n, n)) + 1j * rng.normal(size=(n, n)) for _ in range(2))
        out = np.empty_like(a)
        runs: dict[str, Any] = {"ours": ours}
        runs["product"] = lambda steps, a=a, b=b, out=out: [np.matmul(a, b, out=out) for _ in range(steps)]
        with one_thread():
            times = least(runs, rounds)
        products = 2 * sweeps(sphere, start, h, 10)
        found.append({"n": n, "compile": made, "products": products} | times)
        print(
            f"su({n:<3}) ms a step: ours {1e3 * times['ours']:8.3f}, {products:.1f} products, one alone in NumPy "
            f"{1e3 * times['product']:.3f}: a step is {times['ours'] / times['product']:.1f} of them; compiled in {made:.1f} s",
            flush=True,
        )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="small sizes, two rounds")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    rounds = 2 if asked.quick else asked.rounds
    found = {
        "bodies": bodies((14, 16) if asked.quick else (14, 16, 32, 64), rounds),
        "flows": flows((16, 32) if asked.quick else (32, 64, 128, 256), rounds),
    }
    if asked.out:
        asked.out.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
