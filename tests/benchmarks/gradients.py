"""Gradients of long runs: their cost over that of the run, their memory, and diffrax beside them.

    python tests/benchmarks/gradients.py [--quick]

Ratios of processor time, least of some rounds.  diffrax, if it is installed, takes as many fixed steps of
its Tsit5 (six new stages) in double precision with its recursive checkpoints, where ours are RKMK4, and for the
chain Stormer-Verlet; give it one core with `taskset -c 0`.
"""

from __future__ import annotations

import argparse
import functools
import resource
import time
import tracemalloc
import warnings
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

import liemech as lm

METHOD = lm.RKMK(order=4)


@lm.record
class Driven(lm.Force):
    """A torque of time."""

    torque: lm.PiecewisePolynomial

    def covector(self, t: Any, xi: Any, g: Any) -> Any:
        return self.torque(t)


@lm.record
class Pendulums(lm.SeparableSystem):
    """Ten pendulums in a row, each tied to the next."""

    degrees: ClassVar[int] = 10
    spring: float

    def kinetic(self, p: Any) -> Any:
        return 0.5 * lm.dot(p, p)

    def potential(self, q: Any) -> Any:
        total = 0.0
        for i in range(10):
            total = total + 1.0 - lm.formulas.cos(q[i])
        for i in range(9):
            total = total + 0.5 * self.spring * (q[i + 1] - q[i]) ** 2
        return total


def least(function: Callable[[], Any], rounds: int) -> float:
    """The least processor time of some rounds, after one that compiles."""
    function()
    found = []
    for _ in range(rounds):
        begun = time.process_time()
        function()
        found.append(time.process_time() - begun)
    return min(found)


def of_attitude(state: Any) -> Any:
    return lm.dot(state.mu, lm.vec(1.0, 2.0, 3.0)) + state.g[0][1]


def body() -> tuple[Any, Any, Any]:
    """A free body: plan, start, loss."""
    free = lm.RigidBody([1.0, 1.5, 2.0])
    return lm.Plan(free, METHOD, h=0.01), free.state(mu=[0.5, 0.1, 0.8], g=np.eye(3)), of_attitude


def top() -> tuple[Any, Any, Any]:
    """A heavy top."""
    heavy = lm.models.HeavyTop(inertia=[1.0, 1.0, 0.5], weight=1.0, centre=[0.0, 0.0, 1.0])
    start = heavy.state(mu=[0.2, 0.0, 2.0], g=lm.SO3().exp([0.4, 0.0, 0.0]))
    return lm.Plan(heavy, METHOD, h=0.01), start, of_attitude


def driven(values: int, steps: int) -> tuple[Any, Any, Any]:
    """A body whose torque is held over equal times; so many numbers, small enough for regular motion."""
    many = -(-values // 3)
    torque = 1e-4 * np.sin(np.arange(3.0 * many)).reshape(many, 3)
    table = lm.PiecewisePolynomial.constant(np.linspace(0.0, 0.01 * steps, many + 1), torque, outside="hold")
    whole = lm.MechanicalSystem(lm.RigidBody([1.0, 1.5, 2.0]), lm.NoPotential(), load=Driven(table))
    start = whole.state(mu=[0.5, 0.1, 0.8], g=np.eye(3))
    return lm.Plan(whole, METHOD, h=0.01), start, of_attitude


def memory(function: Callable[[], Any]) -> tuple[float, float]:
    """The largest memory of Python's and NumPy's objects while a function runs, and the growth of that of
    the process, in kB.
    """
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    tracemalloc.start()
    function()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1024.0, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before


def table(quick: bool) -> None:
    """Cost and memory against the number of steps and of parameters."""
    rounds = 1 if quick else 5
    print(f"{'':28} {'steps':>9} {'run, ms':>9} {'gradient / run':>15} {'kB':>7} {'RSS, kB':>8} {'growth':>8}")
    cases: list[tuple[str, Any, list[str], int]] = []
    for steps in (10**4, 10**5) if quick else (10**4, 10**5, 10**6, 10**7):
        cases.append(("body, by start", body(), ["start"], steps))
    last = 10**5 if quick else 10**6
    cases.append(("body, by start and inertia", body(), ["start", "inertia"], last))
    cases.append(("top, by start and weight", top(), ["start", "weight"], last))
    for values in (12, 99, 999, 9999):
        by = ["start", "torque.values"]
        cases.append((f"body, by {values} torques", driven(values, last), by, last))
    for name, (plan, start, loss), by, steps in cases:
        ends = plan.replace(every=steps)

        def backwards(plan: Any = plan, start: Any = start, loss: Any = loss, by: Any = by, steps: Any = steps) -> Any:
            return plan.gradient(loss, start, steps=steps, by=by)

        forwards = least(lambda ends=ends, start=start, steps=steps: ends.run(start, steps=steps), rounds)
        ratio = least(backwards, rounds) / forwards
        peak, grown = memory(backwards)
        print(
            f"{name:28} {steps:9d} {1e3 * forwards:9.2f} {ratio:15.2f} {peak:7.0f} {grown:8.0f} "
            f"{backwards().growth:8.1e}",
            flush=True,
        )


def chain() -> tuple[Any, Any, Any]:
    """The row of pendulums."""
    row = Pendulums(2.0)
    start = row.state(q=np.linspace(0.1, 0.5, 10), p=np.zeros(10))
    return lm.Plan(row, lm.StormerVerlet(), h=0.01), start, lambda s: s.q[0] * s.q[0] + s.p[1]


# ------------------------------------------------------------------ diffrax


def peers(quick: bool) -> None:
    """The gradient of the same losses by diffrax."""
    try:
        import diffrax
        import jax
        import jax.numpy as jnp
    except ImportError:
        print("diffrax is not installed")
        return
    jax.config.update("jax_enable_x64", True)
    inertia = jnp.array([1.0, 1.5, 2.0])
    own = jnp.array([1.0, 1.0, 0.5])

    def hat(w: Any) -> Any:
        return jnp.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])

    def free_body(t: Any, y: Any, args: Any) -> Any:
        mu, g = y[:3], y[3:].reshape(3, 3)
        w = mu / inertia
        return jnp.concatenate([jnp.cross(mu, w), (g @ hat(w)).ravel()])

    def heavy_top(t: Any, y: Any, args: Any) -> Any:
        mu, g = y[:3], y[3:].reshape(3, 3)
        w = mu / own
        torque = jnp.cross(g.T @ jnp.array([0.0, 0.0, 1.0]), jnp.array([0.0, 0.0, 1.0]))
        return jnp.concatenate([jnp.cross(mu, w) + torque, (g @ hat(w)).ravel()])

    def row(t: Any, y: Any, args: Any) -> Any:
        q, p = y[:10], y[10:]
        pull = 2.0 * jnp.diff(q)
        force = -jnp.sin(q) + jnp.append(pull, 0.0) - jnp.append(0.0, pull)
        return jnp.concatenate([p, force])

    def turned(y: Any) -> Any:
        return y[:3] @ jnp.array([1.0, 2.0, 3.0]) + y[4]

    steps = 2000 if quick else 20000
    eye = np.eye(3).ravel()
    tilt = np.array(lm.SO3().exp([0.4, 0.0, 0.0])).ravel()
    cases = (
        ("free body", free_body, np.concatenate([[0.5, 0.1, 0.8], eye]), turned, body()),
        ("heavy top", heavy_top, np.concatenate([[0.2, 0.0, 2.0], tilt]), turned, top()),
        ("chain of ten", row, np.concatenate([np.linspace(0.1, 0.5, 10), np.zeros(10)]),
         lambda y: y[0] ** 2 + y[11], chain()),
    )  # fmt: skip
    print(f"\n{steps} steps by the start: {'ours, us a step':>16} {'diffrax':>9} {'ratio':>7} {'values differ':>14}")
    tables = diffrax.Tsit5()
    for name, field, y0, loss, (plan, start, own_loss) in cases:

        def value(y: Any, field: Any = field, loss: Any = loss) -> Any:
            found = diffrax.diffeqsolve(
                diffrax.ODETerm(field), tables, 0.0, 0.01 * steps, 0.01, y,
                saveat=diffrax.SaveAt(t1=True), max_steps=steps + 1,
                adjoint=diffrax.RecursiveCheckpointAdjoint(),
            )  # fmt: skip
            return loss(found.ys[0])

        compiled, begin = jax.jit(jax.value_and_grad(value)), jnp.asarray(y0)
        of_them = functools.partial(compiled, begin)
        of_us = functools.partial(plan.gradient, own_loss, start, steps=steps)
        theirs = least(lambda of=of_them: jax.block_until_ready(of()), 2 if quick else 3) / steps
        ours = least(of_us, 3) / steps
        off = abs(float(of_them()[0]) - of_us().value)
        print(f"{name:28} {1e6 * ours:13.3f} {1e6 * theirs:9.3f} {theirs / ours:7.1f} {off:14.1e}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore", lm.errors.GradientWarning)
    table(given.quick)
    peers(given.quick)
