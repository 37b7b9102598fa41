"""Ideal flow on the sphere: order 4 beside order 2 by processor time to the same energy error, Casimirs after many
steps, products of matrices a step for N = 32 to 1024, and quflow beside, where that package can be imported.

    python tests/benchmarks/ideal_flow.py [--quick] [--only orders casimirs products quflow] [--out ideal_flow.json]

Processor time, least of the rounds, which take turns; BLAS on one thread.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import large_groups
import numpy as np

import liemech as lm
from liemech.formulas.blas import one_thread


def eddies(sphere: Any) -> Any:
    """Eddies of degrees 2 to 10 that fall off like 1/l."""
    rng = np.random.default_rng(1)
    return {(l, m): rng.normal() / l for l in range(2, 11) for m in range(-l, l + 1)}


def energy_errors(sphere: Any, start: Any, order: int, h: float, t_end: float, rounds: int) -> tuple[float, float]:
    """The largest error of the energy, and the least processor time, of a run."""
    steps = max(1, round(t_end / h))
    method = lm.Isospectral(order)
    plan = lm.Plan(sphere, method, h=t_end / steps, every=max(1, steps // 40), progress=False, compiled=True)
    run = plan.run(start, steps=steps)
    quiet = lm.Plan(sphere, method, h=t_end / steps, every=10**9, progress=False, compiled=True)
    least = np.inf
    for _ in range(rounds):
        begun = time.process_time()
        quiet.run(start, steps=steps)
        least = min(least, time.process_time() - begun)
    return float(np.abs(run.energy / run.energy[0] - 1.0).max()), least


def orders(n: int, t_end: float, rounds: int, halvings: int) -> list[dict[str, Any]]:
    """The curve of time over error of orders 2, 4 and 6, and how much faster the others are than order 2."""
    sphere = lm.models.ZeitlinSphere(n)
    start, found = sphere.from_harmonics(eddies(sphere)), []
    curves: dict[int, list[tuple[float, float]]] = {2: [], 4: [], 6: []}
    for order, curve in curves.items():
        for k in range(halvings):
            h = (0.8 if order == 2 else 1.6) * sphere.hbar / 2**k
            try:
                error, seconds = energy_errors(sphere, start, order, h, t_end, rounds)
            except lm.errors.NoConvergence:
                continue
            curve.append((error, seconds))
            row = {"n": n, "order": order, "h/hbar": h / sphere.hbar, "energy error": error}
            found.append(row | {"seconds": seconds})
            made = f"h = {h / sphere.hbar:5.3f} hbar: energy error {error:.1e}, {seconds:7.3f} s"
            print(f"su({n}) order {order}, {made}", flush=True)
    for error, seconds in curves[2]:
        told = []
        for order in (4, 6):
            e, s = (np.log(np.array(column)) for column in zip(*curves[order]))
            by_error = np.argsort(e)
            inside = e.min() <= np.log(error) <= e.max()
            at = np.exp(np.interp(np.log(error), e[by_error], s[by_error]))
            most = "" if inside else " or more" if np.log(error) > e.max() else " or less"
            told.append(f"order {order} {seconds / at:5.2f}{most}")
        print(f"su({n}) at energy error {error:.1e} times faster than order 2: {', '.join(told)}")
    return found


def casimirs(n: int, steps: int) -> dict[str, Any]:
    """The relative changes of all eigenvalues and moments, and their slope over the run."""
    sphere = lm.models.ZeitlinSphere(n)
    start = sphere.from_harmonics(eddies(sphere))
    run = lm.integrate(
        sphere, lm.Isospectral(2), start, h=0.5 * sphere.hbar, steps=steps, every=steps // 50,
        compiled=True, progress=False,
    )  # fmt: skip
    levels, moments = sphere.levels(run.mu), sphere.moments(run.mu, (2, 3, 4, 6, 8))
    change = np.abs(levels - levels[0]).max(axis=1) / np.abs(levels[0]).max()
    scale = np.array([4 * np.pi / n * np.sum(np.abs(levels[0]) ** k) for k in (2, 3, 4, 6, 8)])
    off = (moments - moments[0]) / scale
    slope, spread = np.polyfit(run.t, off, 1)[0] * run.t[-1], off.std(axis=0)
    found = {
        "n": n, "steps": steps, "eigenvalues": float(change.max()), "moments": float(np.abs(off).max()),
        "trend": float(np.abs(slope).max()), "scatter": float(spread.max()),
        "angular momentum": float(np.abs(sphere.angular_momentum(run.mu)).max()),
    }  # fmt: skip
    print(
        f"su({n}) after {steps} steps, relative: eigenvalues {found['eigenvalues']:.1e}, moments 2 to 8 "
        f"{found['moments']:.1e} (line through them rises by {found['trend']:.1e}, scatter {found['scatter']:.1e}), energy "
        f"within {np.ptp(run.energy) / run.energy[0]:.1e}, halves {np.ptp(run.energy[:26]) / run.energy[0]:.1e} "
        f"and {np.ptp(run.energy[26:]) / run.energy[0]:.1e}",
        flush=True,
    )
    return found


def products(n: int) -> dict[str, Any]:
    """Products of matrices a step of the midpoint, of three lengths of the step, and milliseconds."""
    sphere = lm.models.ZeitlinSphere(n)
    start, found = sphere.from_harmonics(eddies(sphere)), {"n": n}
    for share in (0.25, 0.5, 1.0):
        h = share * sphere.hbar
        found[f"products at {share} hbar"] = 2 * large_groups.sweeps(sphere, start, h, 10 if n < 512 else 3)
    plan = lm.Plan(sphere, lm.Isospectral(2), h=0.5 * sphere.hbar, every=10**9, progress=False, compiled=True)
    begun = time.process_time()
    run = plan.run(start, steps=8)
    found["compile"] = time.process_time() - begun
    steps = max(4, int(2e6 / n**2)) if n < 512 else 4
    begun = time.process_time()
    plan.resume(run, steps=steps)
    found["ms a step"] = 1e3 * (time.process_time() - begun) / steps
    print("  ".join(f"{k} {v:.4g}" for k, v in found.items()), flush=True)
    return found


def beside_quflow(n: int, rounds: int) -> dict[str, Any]:
    """A step of ours and of quflow's isospectral midpoint on the same flow, both to rounding and quflow by its
    own tolerance; energies and the motion itself beside each other.
    """
    import quflow
    from quflow.integrators.isospectral import isomp_fixedpoint
    from quflow.quantization import mat2shr, shr2mat

    sphere = lm.models.ZeitlinSphere(n)
    given, h, unit = eddies(sphere), 0.5 * sphere.hbar, -1.0 / np.sqrt(4.0 * np.pi)
    start, row = sphere.from_harmonics(given), np.zeros(n * n)
    for (l, m), a in given.items():
        row[l * l + l + m] = a
    w = shr2mat(row, N=n)
    theirs = {
        "quflow": lambda steps, **o: isomp_fixedpoint(w.copy(), unit * h, steps=steps, **o),
        "quflow, to rounding": lambda steps: isomp_fixedpoint(w.copy(), unit * h, steps=steps, compsum=True, maxit=40),
    }
    own, _ = large_groups.runner(sphere, lm.Isospectral(2), start, h)
    mu = np.array(start.mu)
    run = lm.integrate(sphere, lm.Isospectral(2), start, h=h, steps=20, every=20, progress=False)
    a, back = sphere.harmonics(run.mu[-1]), mat2shr(theirs["quflow, to rounding"](20))
    apart = max(abs(back[l * l + l + m] - a[l, n - 1 + m]) for l in range(n) for m in range(-l, l + 1))
    energies = abs(quflow.energy_euler(w) / sphere.energy(mu) - 1.0)
    stats: dict[str, Any] = {}
    theirs["quflow"](20, stats=stats)
    with one_thread():
        times = large_groups.least({"ours": own} | theirs, rounds)
    found = {"n": n, "apart": float(apart), "energies apart": float(energies)} | times
    told = "  ".join(f"{k} {1e3 * t:8.3f}" for k, t in times.items())
    print(
        f"su({n}) ms a step: {told}; ours/quflow {times['ours'] / times['quflow']:.2f}, to rounding "
        f"{times['ours'] / times['quflow, to rounding']:.2f}; energies differ by {energies:.0e}, after 20 "
        f"steps harmonics by {apart:.0e}",
        flush=True,
    )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="small sizes, few steps")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", nargs="*", default=["orders", "casimirs", "products", "quflow"])
    parser.add_argument("--sizes", type=int, nargs="*")
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    quick, rounds, found = asked.quick, asked.rounds, {}
    if "orders" in asked.only:
        sizes = asked.sizes or ((16,) if quick else (64, 128))
        found["orders"] = [orders(n, 0.5 if quick else 2.0, rounds, 3 if quick else 5) for n in sizes]
    if "casimirs" in asked.only:
        sizes = asked.sizes or ((16,) if quick else (32, 64))
        found["casimirs"] = [casimirs(n, 1000 if quick else 100_000) for n in sizes]
    if "products" in asked.only:
        sizes = asked.sizes or ((16, 32) if quick else (32, 64, 128, 256, 512, 1024))
        found["products"] = [products(n) for n in sizes]
    if "quflow" in asked.only:
        try:
            import quflow  # noqa: F401
        except ImportError as missing:
            print(f"quflow is not here: {missing}")
        else:
            sizes = asked.sizes or ((32,) if quick else (32, 64, 128, 256))
            found["quflow"] = [beside_quflow(n, rounds) for n in sizes]
    if asked.out:
        asked.out.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
