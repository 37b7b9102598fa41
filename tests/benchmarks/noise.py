"""Noise on a sphere: nanoseconds a step of a body, and what is left of |mu| = 1, beside NumPy and diffrax; and
heat baths of spins beside LAMMPS: how far a mean is off at long steps.

    python tests/benchmarks/noise.py [--quick]

NumPy and diffrax step the same equation in R^3 by Heun's method, which is of the same strong order; diffrax and LAMMPS
are left out where they are missing.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import spin_peers
from sites import Exchange, Zeeman

import liemech as lm

MOMENTS, STRENGTH, H = np.array([1.0, 1.5, 2.0]), 0.3, 0.05
START = [0.6, 0.1, 0.63**0.5]


def ours(method: Any, bodies: int, steps: int) -> tuple[Callable[[], np.ndarray], str]:
    """A run of the library."""
    system = lm.Stochastic(lm.RigidBody(MOMENTS), (STRENGTH * np.eye(3)).tolist())
    start = system.state([START] * bodies)

    def run() -> np.ndarray:
        found: np.ndarray = lm.integrate(system, method, start, h=H, steps=steps, every=steps, compiled=True).mu[-1]
        return found

    return run, f"{method.name}, {method.increments}"


def numpys(bodies: int, steps: int) -> tuple[Callable[[], np.ndarray], str]:
    """Heun's method on arrays."""

    def run() -> np.ndarray:
        rng = np.random.Generator(np.random.Philox(1))
        mu = np.tile(START, (bodies, 1))
        for _ in range(steps):
            xi = STRENGTH * rng.standard_normal((bodies, 3)) * H**0.5
            first = np.cross(mu, H * mu / MOMENTS + xi)
            there = mu + first
            mu = mu + 0.5 * (first + np.cross(there, H * there / MOMENTS + xi))
        return mu

    return run, "NumPy, Heun in R^3"


def diffraxs(bodies: int, steps: int) -> tuple[Callable[[], np.ndarray], str] | None:
    """Heun's method of diffrax, compiled for all bodies."""
    try:
        import diffrax
        import jax
        import jax.numpy as jnp
    except ImportError:
        return None
    jax.config.update("jax_enable_x64", True)
    moments = jnp.array(MOMENTS)

    def hat(mu: Any) -> Any:
        return jnp.array([[0.0, -mu[2], mu[1]], [mu[2], 0.0, -mu[0]], [-mu[1], mu[0], 0.0]])

    def one(key: Any) -> Any:
        path = diffrax.UnsafeBrownianPath(shape=(3,), key=key)
        terms = diffrax.MultiTerm(
            diffrax.ODETerm(lambda t, mu, _: jnp.cross(mu, mu / moments)),
            diffrax.ControlTerm(lambda t, mu, _: STRENGTH * hat(mu), path),
        )
        return diffrax.diffeqsolve(
            terms, diffrax.Heun(), 0.0, H * steps, H, jnp.array(START), max_steps=steps + 1,
            adjoint=diffrax.DirectAdjoint(), stepsize_controller=diffrax.ConstantStepSize(),
        ).ys[-1]  # fmt: skip

    many = jax.jit(jax.vmap(one))
    keys = jax.random.split(jax.random.key(0), bodies)
    return lambda: np.asarray(many(keys)), "diffrax, Heun in R^3"


DAMPING = 0.3


def baths(
    n: int, exchange: float, field: float, temperature: float, h: float
) -> dict[str, Callable[[int], np.ndarray]]:
    """Spins of a cubic lattice after so many steps more, by the library and by LAMMPS."""
    lattice = lm.neighbours.cubic(n, n, n)
    terms = [Exchange(exchange).over(lattice)] if exchange else []
    spins = lm.LiePoissonSystem(lm.SO3() ** lattice.sites, lm.Terms(*terms, Zeeman([0.0, 0.0, field])))
    bath = lm.thermal_bath(spins, damping=DAMPING, temperature=temperature, seed=3)
    directions = np.random.default_rng(1).standard_normal((lattice.sites, 3)) + [0.0, 0.0, 1.0]
    directions /= np.linalg.norm(directions, axis=1)[:, None]

    def going_on(method: Any) -> Callable[[int], np.ndarray]:
        spins_now = lm.Plan(bath, method, h=h).stepper(bath.state(mu=directions))

        def run(steps: int) -> np.ndarray:
            spins_now.step(steps)
            found: np.ndarray = spins_now.mu
            return found

        return run

    methods = [kind(increments="three-point") for kind in (lm.WongZakai, lm.NinomiyaVictoir)]
    found = {m.name: going_on(m) for m in methods}
    if spin_peers.there("lammps"):
        found["LAMMPS, fix langevin/spin"] = spin_peers.lammps_bath(
            directions, n, h, exchange, field, DAMPING, temperature
        )
    return found


def means(quick: bool) -> None:
    """Means in equilibrium at long steps: of a paramagnet, beside Langevin's function, and of a magnet."""
    n, samples = (4, 3) if quick else (12, 200)
    cases = {
        "s_z, B = 1, T = 1/2": (0.0, 1.0, 0.5, lambda s: s[:, 2].mean()),
        "energy, J = 1, T = 1": (
            1.0, 0.0, 1.0, lambda s: -0.5 * (spin_peers.field(s, n) * s).sum(axis=1).mean(),
        ),
    }  # fmt: skip
    print("| mean | h | bath | mean, standard error | ns a spin and unit of time |\n" + "| --- " * 5 + "|")
    for case, (exchange, field, temperature, quantity) in cases.items():
        for h in (0.025, 0.05, 0.1, 0.2, 0.4):
            apart = round(2.0 / h)
            for name, run in baths(n, exchange, field, temperature, h).items():
                run(round(40.0 / h))
                begun = time.process_time()
                seen = np.array([quantity(run(apart)) for _ in range(samples)])
                ns = (time.process_time() - begun) / (samples * apart * h * n**3) * 1e9
                groups = seen[: samples // 3 * 3].reshape(3, -1) if quick else seen.reshape(20, -1)
                error = groups.mean(axis=1).std() / (len(groups) - 1) ** 0.5
                print(f"| {case} | {h} | {name} | {seen.mean():.4f} ± {error:.4f} | {ns:.0f} |")


def main(quick: bool) -> None:
    bodies, steps, rounds = (256, 20, 1) if quick else (8192, 200, 7)
    methods = [
        lm.WongZakai(),
        lm.WongZakai(increments="three-point"),
        lm.WongZakai(lm.ImplicitMidpoint(), increments="three-point"),
        lm.NinomiyaVictoir(),
        lm.NinomiyaVictoir(increments="three-point"),
    ]
    runs = [ours(method, bodies, steps) for method in methods]
    runs += [one for one in (numpys(bodies, steps), diffraxs(bodies, steps)) if one]
    least = dict.fromkeys((name for _, name in runs), float("inf"))
    off = {name: np.abs(np.linalg.norm(run(), axis=1) - 1.0).max() for run, name in runs}
    for _ in range(rounds):  # interleaved
        for run, name in runs:
            begun = time.process_time()
            run()
            least[name] = min(least[name], time.process_time() - begun)
    print("| step | ns | largest change of the length |\n| --- | --- | --- |")
    for name, seconds in least.items():
        print(f"| {name} | {seconds / bodies / steps * 1e9:.1f} | {off[name]:.0e} |")
    print()
    means(quick)


if __name__ == "__main__":
    main("--quick" in sys.argv)
