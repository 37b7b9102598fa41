"""What a step of Lie-RATTLE costs in native code, and how long that takes to make: a body with a fixed point, chains."""

from __future__ import annotations

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


def hanging(count: int) -> tuple[lm.Linkage, lm.State]:
    """A chain, bent, at rest."""
    chain, poses, end = lm.chain(count), np.tile(np.eye(4), (count, 1, 1)), np.zeros(3)
    for b in range(count):
        R = np.array(lm.SO3().exp([0.2 * b, 0.7, 0.1]))
        poses[b, :3, :3], poses[b, :3, 3], end = R, end - 0.5 * R[:, 2], end - R[:, 2]
    return chain, chain.assembled(poses)


def main() -> None:
    """Print the table of docs/joints.md."""
    moments, mass, centre = np.array([1.0, 1.5, 0.7]), 2.0, np.array([0.3, 0.1, 0.4])
    about_point = np.diag(moments) + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    top = lm.HeavyTop(about_point, mass * 9.81, centre)
    body = lm.Linkage([lm.Link(mass, moments)], [lm.FixedPoint(0, -centre)], 9.81)
    w, pose = np.array([0.3, 0.6, 1.1]), np.eye(4)
    pose[:3, 3] = centre
    start = body.assembled([pose], [[*w, *np.cross(w, centre)]])
    rows = [
        ("LieVerlet, heavy top", top, lm.LieVerlet(), top.state(about_point @ w, np.eye(3))),
        ("LieRATTLE, fixed point", body, lm.LieRATTLE(), start),
        ("LieRATTLE(Cayley()), fixed point", body, lm.LieRATTLE(lm.Cayley()), start),
        *[(f"LieRATTLE, chain({n})", chain, lm.LieRATTLE(), begun) for n in (2, 3) for chain, begun in (hanging(n),)],
    ]
    for name, system, method, begun in rows:
        made, step = cost(system, method, begun)
        print(f"{name:36}{step:8.0f} ns a step {made:6.1f} s to compile", flush=True)


if __name__ == "__main__":
    main()
