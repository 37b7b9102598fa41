"""Cost of compiling: seconds of translation and of LLVM for methods on systems, cold, instructions given to LLVM, and
ns a step.

    python tests/benchmarks/compile_time.py [--quick] [--only TEXT] [--no-steps] [--out
    results.json]

Times are of the processor, so other work on the machine changes them by tens of percent, not by multiples.  Each case
runs in a process of its own, which is ended after `--limit` seconds.  A dagger marks a time beyond its goal.
"""

import argparse
import json
import os
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from stepping import plan_of

import liemech as lm
from liemech.compiler import kernel
from liemech.compiler.machine import llvm
from liemech.formulas import sqrt
from liemech.integrators.taylor import Taylor
from liemech.rooms.fictive_time.clocked import Clocked
from liemech.simulation.compiled.prepared import Steps
from liemech.simulation.runs.equal import StraightRun

LIMIT = {"cold": 4.0, "SO(16)": 10.0}
"""Seconds that a cold compilation may take: by default, and for the group named."""


# ------------------------------------------------------------------ formulas of a user


@lm.record
class Palindrome(lm.Retraction):
    """Six exponentials: the symmetric coordinates of the second kind."""

    def tau(self, group: Any, xi: lm.Vec) -> Any:
        g = group.identity()
        for i in (0, 1, 2, 2, 1, 0):
            g = group.compose(g, group.exp(lm.vec(*[0.5 * xi[k] if k == i else 0.0 for k in range(group.dim)])))
        return g


@lm.record
class Euler(lm.Retraction):
    """Five exponentials, nothing but `tau`."""

    def tau(self, group: Any, xi: lm.Vec) -> Any:
        a, b = group.exp(lm.vec(0.5 * xi[0], 0.0, 0.0)), group.exp(lm.vec(0.0, 0.5 * xi[1], 0.0))
        return a @ b @ group.exp(lm.vec(0.0, 0.0, xi[2])) @ b @ a


@lm.record
class Polar(lm.Retraction):
    """The orthogonal factor of 1 + hat(xi), by eight steps of Newton's iteration."""

    def tau(self, group: Any, xi: lm.Vec) -> Any:
        g = group.identity() + group.algebra.hat(xi)
        for _ in range(8):
            a, b, c = g.T
            bc = lm.cross(b, c)
            g = 0.5 * (g + (1.0 / lm.dot(a, bc)) * lm.mat(bc, lm.cross(c, a), lm.cross(a, b)).T)
        return g


@lm.record
class Bodies(lm.HamiltonianSystem):
    """Three bodies that attract each other in space: 18 dimensions, forces by differentiation."""

    degrees: ClassVar[int] = 9
    masses: lm.Vec

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        total = 0.0
        for i in range(3):
            for k in range(3):
                total = total + p[3 * i + k] * p[3 * i + k] / (2.0 * self.masses[i])
            for j in range(i):
                d2 = 0.0
                for k in range(3):
                    d2 = d2 + (q[3 * i + k] - q[3 * j + k]) ** 2
                total = total - self.masses[i] * self.masses[j] / sqrt(d2)
        return total


# ------------------------------------------------------------------ cases

Case = tuple[Any, Any, Any, float] | Callable[[], Any]
"""A system, a method, a start and the step; or a run of another kind, of which only the compilation is measured."""
COVARIANT = {"Cayley": lm.CovariantVariational(lm.Cayley()), "exp": lm.CovariantVariational(lm.Exponential())}


def body(method: Any, lanes: bool = False) -> Case:
    system = lm.RigidBody([1.0, 1.5, 2.0])
    mu = np.array([0.5, 0.1, 0.75**0.5])
    return system, method, _start(system, mu, np.eye(3), lanes), 0.1


def top(method: Any, lanes: bool = False) -> Case:
    system = lm.models.HeavyTop([1.0, 1.5, 2.0], 1.0, [0.18, 0.0, 0.24])
    return system, method, _start(system, np.array([0.5, 0.1, 0.75**0.5]), np.eye(3), lanes), 0.1


def kirchhoff(method: Any, lanes: bool = False) -> Case:
    system = lm.models.KirchhoffBody([1.0, 1.5, 2.0, 1.0, 2.0, 1.5])
    return (system, method, _start(system, np.array([0.5, 0.1, 0.8, 0.1, 0.2, 0.3]), np.eye(4), lanes), 0.05)


def on(group: Any, method: Any, lanes: bool = False) -> Case:
    system = lm.LiePoissonSystem(group, lm.KineticEnergy(np.linspace(1.0, 2.0, group.dim)))
    mu = np.cos(np.arange(group.dim)) / group.dim**0.5
    return system, method, _start(system, mu, np.array(group.identity()), lanes), 0.05


def three_bodies(method: Any, lanes: bool = False) -> Case:
    system = Bodies([1.0, 0.5, 0.3])
    q = np.array([0.0, 0.0, 0.0, 1.0, 0.1, 0.0, 0.0, 2.0, 0.3])
    p = np.array([0.0, 0.0, 0.1, 0.0, 0.4, 0.0, 0.1, 0.0, 0.0])
    if lanes:
        q, p = (np.tile(x, (kernel.lanes(), 1)) for x in (q, p))
    return system, method, system.state(q, p), 0.001


def chain(method: Any, links: int = 2, lanes: bool = False) -> Case:
    """A pendulum of rods on ball joints."""
    half, places = np.array([0.0, 0.0, 0.5]), np.tile(np.eye(4), (links, 1, 1))
    places[:, 2, 3] = -0.5 - np.arange(links)
    joints = [lm.joints.BallJoint(k, k - 1 if k else None, half, -half if k else 0.0 * half) for k in range(links)]
    system = lm.joints.Linkage([lm.joints.Link(1.0, [0.1, 0.1, 0.05])] * links, joints, 9.81)
    start = system.assembled(places, np.full((links, 6), 0.1))
    return system, method, _start(system, np.array(start.mu), np.array(start.g), lanes), 0.01


def planets(method: Any, lanes: bool = False) -> Case:
    system, start = lm.models.PlanetarySystem.outer_solar_system()
    if lanes:
        start = system.state(np.tile(np.array(start.y), (kernel.lanes(), 1)))
    return system, method, start, 100.0


def run(case: Case, tangent: bool = False, **options: Any) -> Case:
    """The same with other options of `integrate`, or the tangent map of the motion."""
    assert isinstance(case, tuple)
    system, method, start, h = case
    if tangent:
        return lambda: lm.Plan(system, method, h, compiled=True, progress=False).tangent(start, steps=2)
    steps = {} if "t_end" in options else {"h": h, "steps": 2}
    return lambda: lm.integrate(system, method, start, **steps, **options, compiled=True, progress=False)


def satellite(method: Any, lanes: bool = False, clocked: bool = True) -> Case:
    """On an eccentric orbit, with steps by its distance."""
    system = lm.models.OrbitingBody([1e-4, 1.5e-4, 2e-4], mass=1.0, attraction=1.0)
    circle = system.circular_orbit(0.3)
    controlled = lm.ReversibleController(method, lambda g: (g[9] * g[9] + g[10] * g[10] + g[11] * g[11]) ** 0.75)
    if not clocked:
        return (system, controlled, _start(system, np.array(circle.mu), np.array(circle.g), lanes), 0.05)
    start = _start(system, np.array(circle.mu), np.array(circle.g), lanes)
    extended = Clocked(system, controlled.sigma.bound(system, start))
    return extended, controlled, extended.extended(start, 0.0), 0.05


def _start(system: Any, mu: np.ndarray, g: np.ndarray, lanes: bool) -> Any:
    if lanes:
        mu, g = (np.tile(x, (kernel.lanes(), *[1] * x.ndim)) for x in (mu, g))
    return system.state(mu=mu, g=g)


CASES: dict[str, Callable[[], Case]] = {
    "RKMK4, body": lambda: body(lm.RKMK(order=4)),
    "RKMK4, body, lanes": lambda: body(lm.RKMK(order=4), True),
    "RKMK8, body": lambda: body(lm.RKMK(order=8)),
    "RKMK8, top, lanes": lambda: top(lm.RKMK(order=8), True),
    "Composition 4 of Cayley, body": lambda: body(lm.Composition(COVARIANT["Cayley"])),
    "Composition 4 of exp, body": lambda: body(lm.Composition(COVARIANT["exp"])),
    "Composition 8 of Cayley, body": lambda: body(lm.Composition(COVARIANT["Cayley"], order=8)),
    "Composition 8 of Cayley, body, lanes": lambda: body(lm.Composition(COVARIANT["Cayley"], order=8), True),
    "Composition 8 of exp, body": lambda: body(lm.Composition(COVARIANT["exp"], order=8)),
    "Composition 8 of exp, body, lanes": lambda: body(lm.Composition(COVARIANT["exp"], order=8), True),
    "Composition 8 of exp, SE(3)": lambda: kirchhoff(lm.Composition(COVARIANT["exp"], order=8)),
    "Composition 8 of Cayley, SE(3), lanes": lambda: kirchhoff(lm.Composition(COVARIANT["Cayley"], order=8), True),
    "Composition 8 of exp, SE(3), lanes": lambda: kirchhoff(lm.Composition(COVARIANT["exp"], order=8), True),
    "RKMK4, SO(5)": lambda: on(lm.SO(5), lm.RKMK(order=4)),
    "RKMK4, SO(10)": lambda: on(lm.SO(10), lm.RKMK(order=4)),
    "RKMK4, SO(10), lanes": lambda: on(lm.SO(10), lm.RKMK(order=4), True),
    "RKMK4, SU(5)": lambda: on(lm.SU(5), lm.RKMK(order=4)),
    "RKMK4, SO(16)": lambda: on(lm.SO(16), lm.RKMK(order=4)),
    "Algorithm 1, SO(6)": lambda: on(lm.SO(6), COVARIANT["exp"]),
    "Galerkin 4, exp": lambda: body(lm.GalerkinVariational(order=4)),
    "Galerkin 8, exp": lambda: body(lm.GalerkinVariational(order=8)),
    "Galerkin 4, tau only": lambda: body(lm.GalerkinVariational(order=4, retraction=Euler())),
    "Galerkin 4, tau only, lanes": lambda: body(lm.GalerkinVariational(order=4, retraction=Euler()), True),
    "Galerkin 6, tau only": lambda: body(lm.GalerkinVariational(order=6, retraction=Euler())),
    "Algorithm 1, six exponentials": lambda: body(lm.CovariantVariational(Palindrome())),
    "Algorithm 1, six exponentials, lanes": lambda: body(lm.CovariantVariational(Palindrome()), True),
    "Algorithm 1, polar": lambda: body(lm.CovariantVariational(Polar())),
    "Algorithm 1, polar, lanes": lambda: body(lm.CovariantVariational(Polar()), True),
    "RKMK8, three bodies": lambda: three_bodies(lm.RKMK(order=8)),
    "RKMK8, three bodies, lanes": lambda: three_bodies(lm.RKMK(order=8), True),
    "LieRATTLE, chain of 1": lambda: chain(lm.LieRATTLE(), 1),
    "LieRATTLE, chain of 1, lanes": lambda: chain(lm.LieRATTLE(), 1, True),
    "LieRATTLE, chain of 2": lambda: chain(lm.LieRATTLE()),
    "LieRATTLE, chain of 2, lanes": lambda: chain(lm.LieRATTLE(), 2, True),
    "LieRATTLE, chain of 3": lambda: chain(lm.LieRATTLE(), 3),
    "LieRATTLE, chain of 3, lanes": lambda: chain(lm.LieRATTLE(), 3, True),
    "RKMK4, chain of 2": lambda: chain(lm.RKMK(order=4)),
    "Splitting 4, planets": lambda: planets(lm.Splitting(order=4)),
    "Splitting 4, planets, lanes": lambda: planets(lm.Splitting(order=4), True),
    "Splitting 8, planets": lambda: planets(lm.Splitting(order=8)),
    "Controller of KickDrift 2, satellite": lambda: satellite(lm.KickDrift(order=2)),
    "Controller of KickDrift 4, satellite": lambda: satellite(lm.KickDrift(order=4)),
    "Controller of LieVerlet, satellite": lambda: satellite(lm.LieVerlet()),
    "Controller of LieVerlet, satellite, run": lambda: run(satellite(lm.LieVerlet(), clocked=False)),
    "Controller of LieVerlet, satellite, run, lanes": lambda: run(satellite(lm.LieVerlet(), True, clocked=False)),
    "Controller of KickDrift 4, satellite, run, lanes": lambda: run(
        satellite(lm.KickDrift(order=4), True, clocked=False)
    ),
    "Adaptive RKMK5, top": lambda: run(top(lm.RKMK(order=5)), t_end=1.0, rtol=1e-6),
    "Adaptive RKMK5, top, lanes": lambda: run(top(lm.RKMK(order=5), True), t_end=1.0, rtol=1e-6),
    "Adaptive RKMK8, top": lambda: run(top(lm.RKMK(order=8)), t_end=1.0, rtol=1e-6),
    "Tangent of RKMK4, body": lambda: run(body(lm.RKMK(order=4)), tangent=True),
    "Tangent of Algorithm 1, body": lambda: run(body(COVARIANT["exp"]), tangent=True),
    "Tangent of Algorithm 1, SE(3)": lambda: run(kirchhoff(COVARIANT["exp"]), tangent=True),
    "Tangent of LieVerlet, top": lambda: run(top(lm.LieVerlet()), tangent=True),
    "Tangent of Composition 4 of exp, body": lambda: run(body(lm.Composition(COVARIANT["exp"])), tangent=True),
    "Double-double, RKMK4, body": lambda: run(body(lm.RKMK(order=4)), precision="double-double"),
    "Double-double, Algorithm 1, body": lambda: run(body(COVARIANT["exp"]), precision="double-double"),
    "Double-double, Algorithm 1, SE(3)": lambda: run(kirchhoff(COVARIANT["exp"]), precision="double-double"),
    "Double-double, LieVerlet, top": lambda: run(top(lm.LieVerlet()), precision="double-double"),
    "Double-double, LieVerlet, top, lanes": lambda: run(top(lm.LieVerlet(), True), precision="double-double"),
    "Double-double, Splitting 8, planets": lambda: run(planets(lm.Splitting(order=8)), precision="double-double"),
    "Taylor 12, body": lambda: body(Taylor(12)),
    "Taylor 18, body": lambda: body(Taylor(18)),
    "Taylor 30, body": lambda: body(Taylor(30)),
    "Taylor 14, top, lanes": lambda: top(Taylor(14, lm.Exponential()), True),
}
QUICK = (
    "RKMK4, body", "Composition 8 of exp, body, lanes", "RKMK4, SO(10)", "Algorithm 1, six exponentials", "Algorithm 1, polar",
    "Galerkin 4, tau only", "RKMK8, three bodies", "Taylor 18, body",
)  # fmt: skip


# ------------------------------------------------------------------ measuring


def measured(name: str, steps: bool) -> dict[str, Any]:
    """One case, in this process: `translation` and `llvm` in s, instructions, ns a step."""
    case = CASES[name]()
    spent: dict[str, float] = {"translation": 0.0, "llvm": 0.0}
    counts: list[int] = []

    def timed(function: Any, what: str) -> Any:
        def run(*args: Any) -> Any:
            before, inner = time.process_time(), sum(spent.values())
            result = function(*args)
            spent[what] += time.process_time() - before - (sum(spent.values()) - inner)
            if what == "translation":
                counts.append(result[1].count("\n"))
            return result

        return run

    kernel._translated = timed(kernel._translated, "translation")
    llvm.object_code = timed(llvm.object_code, "llvm")
    with warnings.catch_warnings(action="ignore"):
        if callable(case):
            case()
            steps = False
        else:
            system, method, start, h = case
            way = Steps(system, method, h, 10**9, None, "double", True, False, 1)
            run = StraightRun(plan_of(way), start, 0.0, 10, None, None)
            run.trajectory()
    result: dict[str, Any] = {"cold": sum(spent.values()), **spent, "instructions": sum(counts)}
    if steps:
        result |= a_step(system, method, start, h, run.shape.whole(run.count))
    return result


def a_step(system: Any, method: Any, start: Any, h: float, bodies: int) -> dict[str, Any]:
    """ns a step and body, and whether one has failed."""
    plan, n = lm.Plan(system, method, h=h, every=10**9, compiled=True, progress=False), 20

    def spent(steps: int) -> float:
        times = []
        for _ in range(4):
            before = time.process_time()
            plan.run(start, steps=steps)
            times.append(time.process_time() - before)
        return min(times)

    try:
        call = spent(1)
        while (took := spent(n)) < 0.03 and n < 20_000_000:
            n *= 4
    except lm.errors.IntegrationFailure:
        return {"failed": True}
    return {"ns": (took - call) / (n - 1) / bodies * 1e9}


def goal(name: str) -> float:
    """Seconds that the compilation of a case may take."""
    return next((s for g, s in LIMIT.items() if g in name), LIMIT["cold"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--quick", action="store_true", help="a few cases, without the time of a step; fails beyond the bounds"
    )
    parser.add_argument("--only", default="", help="cases whose name contains this text")
    parser.add_argument("--no-steps", action="store_true")
    parser.add_argument("--limit", type=float, default=200.0)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--case", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.case:
        print(json.dumps(measured(args.case, not args.no_steps)))
        return
    chosen = QUICK if args.quick else [name for name in CASES if args.only in name]
    results: dict[str, Any] = {}
    print(f"| {'case':48s} | cold s | goal | translation | LLVM | instructions | ns/step |\n|{' --- |' * 7}")
    environment = os.environ | {"LIEMECH_CACHE_DIR": os.devnull}
    for name in chosen:
        options = ["--no-steps"] if args.quick or args.no_steps else []
        command = [sys.executable, __file__, "--case", name, *options]
        try:
            done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=args.limit)
        except subprocess.TimeoutExpired:
            print(f"| {name:48s} | > {args.limit:g} † |", flush=True)
            results[name] = {"cold": float("inf")}
            continue
        if done.returncode:
            print(f"| {name:48s} | {done.stderr.strip().splitlines()[-1][:300]} |", flush=True)
            results[name] = {"cold": float("nan")}
            continue
        r = results[name] = json.loads(done.stdout)
        ns = f"{r['ns']:.1f}" if "ns" in r else "-"
        mark, late = " †" if r["cold"] > goal(name) else "", " failed" if r.get("failed") else ""
        print(
            f"| {name:48s} | {r['cold']:.2f}{mark} | {goal(name):g} | {r['translation']:.2f} | "
            f"{r['llvm']:.2f} | {r['instructions']} | {ns}{late} |",
            flush=True,
        )
    if args.out:
        args.out.write_text(json.dumps(results, indent=1) + "\n")
    if args.quick:
        slow = [n for n, r in results.items() if not r["cold"] <= goal(n)]
        if slow:
            print(f"longer than allowed: {slow}")


if __name__ == "__main__":
    main()
