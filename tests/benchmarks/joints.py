"""What a step of Lie-RATTLE costs in native code, and how long that takes to make: a body with a fixed point, chains.

    python tests/benchmarks/joints.py [--long 1000]

With `--long` chains of up to so many rods in plain Python, and the power of the number of rods with which the time of a
step grows.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import liemech as lm


def cost(system: lm.System, method: lm.Method, start: lm.State, steps: int = 10_000) -> tuple[float, float]:
    """Processor time: seconds until the first steps are made, and nanoseconds a step, the least of five."""
    options = {"h": 0.01, "compiled": True, "progress": False}
    begun = time.process_time()
    lm.integrate(system, method, start, steps=10, every=10, **options)
    made, times = time.process_time() - begun, []
    for _ in range(5):
        begun = time.process_time()
        lm.integrate(system, method, start, steps=steps, every=steps, **options)
        times.append(time.process_time() - begun)
    return made, min(times) / steps * 1e9


def hanging(count: int) -> tuple[lm.joints.Linkage, lm.State]:
    """A chain, bent, at rest."""
    chain, poses, end = lm.joints.chain(count), np.tile(np.eye(4), (count, 1, 1)), np.zeros(3)
    for b in range(count):
        R = np.array(lm.SO3().exp([0.2 * b, 0.7, 0.1]))
        poses[b, :3, :3], poses[b, :3, 3], end = R, end - 0.5 * R[:, 2], end - R[:, 2]
    return chain, chain.assembled(poses)


def long_chains(most: int) -> None:
    """Processor time of starts and steps in plain Python."""
    method, h, counts, steps = lm.LieRATTLE(), 0.002, [], []
    print(f"{'rods':>6}{'start, s':>10}{'step, s':>9}{'a rod, ms':>11}")
    for count in (n for n in (8, 16, 32, 64, 125, 250, 500, 1000, 2000) if n <= most):
        begun = time.process_time()
        chain, start = hanging(count)
        made = time.process_time()
        memory = method.start(chain, start, h)
        spent = []
        for n in range(2):
            at = time.process_time()
            memory = method.step(chain, n * h, memory, h)
            spent.append(time.process_time() - at)
        counts, steps = [*counts, count], [*steps, min(spent)]
        print(f"{count:6}{made - begun:10.2f}{steps[-1]:9.3f}{1e3 * steps[-1] / count:11.2f}", flush=True)
    half = len(counts) // 2
    slope = np.polyfit(np.log(counts[half:]), np.log(steps[half:]), 1)[0]
    print(f"from {counts[half]} rods on a step costs their number to the power {slope:.2f}")


def main() -> None:
    """Print the tables of docs/proof/costs.md, joints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="smoke run: one joint, and short chains")
    parser.add_argument("--long", type=int, metavar="N", help="chains of up to N rods in plain Python, nothing else")
    chosen = parser.parse_args()
    if chosen.long is not None or chosen.quick:
        long_chains(chosen.long or 32)
    if chosen.long is not None:
        return
    moments, mass, centre = np.array([1.0, 1.5, 0.7]), 2.0, np.array([0.3, 0.1, 0.4])
    about_point = np.diag(moments) + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    top = lm.models.HeavyTop(about_point, mass * 9.81, centre)
    body = lm.joints.Linkage([lm.joints.Link(mass, moments)], [lm.joints.BallJoint(0, None, -centre)], 9.81)
    w, pose = np.array([0.3, 0.6, 1.1]), np.eye(4)
    pose[:3, 3] = centre
    start = body.assembled([pose], [[*w, *np.cross(w, centre)]])
    rows = [
        ("LieVerlet, heavy top", top, lm.LieVerlet(), top.state(about_point @ w, np.eye(3))),
        ("LieRATTLE, fixed point", body, lm.LieRATTLE(), start),
        ("LieRATTLE(Cayley()), fixed point", body, lm.LieRATTLE(lm.Cayley()), start),
        *[(f"LieRATTLE, chain({n})", chain, lm.LieRATTLE(), begun) for n in (2, 3) for chain, begun in (hanging(n),)],
    ]
    for name, system, method, begun in rows[:2] if chosen.quick else rows:
        made, step = cost(system, method, begun)
        print(f"{name:36}{step:8.0f} ns a step {made:6.1f} s to compile", flush=True)


if __name__ == "__main__":
    main()
