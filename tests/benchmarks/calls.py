"""What a step costs in native code, and what a call costs beside the steps it makes.

    python tests/benchmarks/calls.py [--quick] [--only TEXT] [--out results.json]
    python tests/benchmarks/calls.py --against OTHER [--gate 1.03] [--rounds 5] [--only TEXT]

Each line is the least of many repetitions: what the machine needs when nothing else runs.  `beyond` leaves out what
native code takes, which is clocked by itself.  With --against the same table is made of this tree and of another one,
whose path is given, in processes of their own and in turn; where a ratio is larger than the gate the exit code is 1.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
import timeit
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import harness
import numpy as np

import liemech as lm
from liemech.compiler import kernel
from liemech.models.bodies.gravity import FixedPointGravity
from liemech.models.bodies.heavy_top import HeavyTop
from liemech.rooms.fictive_time.time_scales import DistancePower

Call = Callable[[], Any]

WARM = 1.5
"""Seconds of this process after which native code that is made when it pays is there."""

LONG = 2000
"""Steps of a run of which a step is timed."""


@dataclass(frozen=True)
class Entry:
    """A line of the table.

    make : what is called, prepared.  steps : by how many a call is divided, for ns a step; 0 for us
    a call.  goal : us, beyond the steps.
    """

    name: str
    make: Callable[[], Call]
    steps: int = 0
    goal: float = 0.0

    @property
    def unit(self) -> str:
        return "ns" if self.steps else "us"


# ---------------------------------------------------------------- what is run

BODY, RKMK4, RKMK5 = lm.RigidBody([1.0, 1.5, 2.0]), lm.RKMK(order=4), lm.RKMK(order=5)
START = BODY.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
TOP = HeavyTop([1.0, 1.2, 0.6], 1.0, [0.0, 0.0, 0.5])
SPUN = TOP.state(mu=[0.1, 0.2, 3.0], g=np.eye(3))
PENDULUM = lm.SphericalPendulum()
SWING = PENDULUM.state([1.0, 0.0, 0.0], [0.0, 0.5, 0.3])
ORBIT = lm.Kepler()
FALL = ORBIT.state([0.1, 0.0], [0.0, 19.0**0.5])
CONTROLLED = lm.ReversibleController(lm.Splitting(order=8), DistancePower(1.5))
TIMES = np.linspace(0.0, 20.0, 201)


@lm.record
class Gyrostat(lm.Hamiltonian):
    """A body with a rotor."""

    inertia: lm.Vec
    rotor: lm.Vec

    def energy(self, mu):
        return 0.5 * lm.dot(mu - self.rotor, (mu - self.rotor) / self.inertia)

    def gradient(self, mu):
        return (mu - self.rotor) / self.inertia


@lm.record
class Held(lm.Force):
    """A torque that is held."""

    torque: lm.Vec

    def covector(self, t, xi, g):
        return self.torque


def held(torque: Any) -> lm.MechanicalSystem:
    return lm.MechanicalSystem(BODY, lm.NoPotential(), load=Held(torque))


def gyrostats(count: int) -> list[lm.MechanicalSystem]:
    """Bodies with a rotor in a field, each with its own numbers."""
    return [
        lm.MechanicalSystem(
            lm.LiePoissonSystem(lm.SO3(), Gyrostat([1.0, 1.5, 2.0 + 1e-4 * i], [0.1, 0.2, 0.7 + 1e-4 * i])),
            FixedPointGravity(1.0, [0.0, 0.0, 0.5]),
        )
        for i in range(count)
    ]


def bodies(count: int) -> list[lm.RigidBody]:
    return [lm.RigidBody([1.0, 1.5, 2.0 + i / (count + 1.0)]) for i in range(count)]


def many(count: int, g: bool = True) -> lm.BodyState:
    mu = np.random.default_rng(1).normal(size=(count, 3))
    return BODY.state(mu=mu, g=np.broadcast_to(np.eye(3), (count, 3, 3)) if g else None)


def falling(t: float, state: Any) -> Any:
    return state.mu[1]


def plan(system: Any, method: Any, h: float | None = None, **options: Any) -> lm.Plan:
    return lm.Plan(system, method, h, compiled=True, progress=False, **options)


def run_of(prepared: lm.Plan, start: Any, **span: Any) -> Call:
    return lambda: prepared.run(start, **span)


def looked(run: Any, *names: str) -> None:
    for name in names:
        getattr(run, name)


# ---------------------------------------------------------------- the tables


def steps() -> Iterator[Entry]:
    """ns a step of a long run."""

    def long(name: str, system: Any, method: Any, start: Any, n: int = LONG, **options: Any) -> Entry:
        every = {"every": n} | options

        def make() -> Call:
            span = {"steps": n} | {k: every.pop(k) for k in ("t_eval",) if k in every}
            return run_of(plan(system, method, 0.01, **every), start, **span)

        count = start.bodies or 1
        return Entry(f"a step: {name}", make, n * count)

    yield long("RKMK 4", BODY, RKMK4, START)
    yield long("Algorithm 1, Cayley", BODY, lm.CovariantVariational(lm.Cayley()), START)
    yield long("Algorithm 1, exp", BODY, lm.CovariantVariational(lm.Exponential()), START)
    yield long("Hamilton-Jacobi 4", BODY, lm.LiePoissonHamiltonJacobi(order=4), START)
    yield long("RATTLE", PENDULUM, lm.RATTLE(), SWING)
    yield long("Lie-Verlet", TOP, lm.LieVerlet(), SPUN)
    yield long("kicks and drifts 4", TOP, lm.KickDrift(order=4), SPUN)
    yield long("Taylor 12", BODY, lm.Taylor(12), START, 500)
    yield long("Gauss 2", BODY, lm.RKMK(tableau=lm.tableaus.gauss(2)), START, 500)
    yield long("midpoint", BODY, lm.ImplicitMidpoint(), START)
    for count, n in ((16, LONG), (4096, 100)):
        yield long(f"RKMK 4, {count} in lanes", BODY, RKMK4, many(count), n)
        yield long(f"Cayley, {count} in lanes", BODY, lm.CovariantVariational(lm.Cayley()), many(count), n)
    yield long("every one kept", BODY, RKMK4, START, every=1)
    yield long("every one kept, 256 in lanes", BODY, RKMK4, many(256), 100, every=1)
    yield long("energies kept", BODY, RKMK4, START, every=1, record=("energy",))
    yield long("with an event", BODY, RKMK4, START, every=1, events=[falling])
    yield long("with an event, 256 in lanes", BODY, RKMK4, many(256), 100, every=1, events=[falling])
    yield long("t_eval between steps", BODY, RKMK4, START, every=1, t_eval=np.linspace(0.0, 20.0, 777))
    yield long("with breaks", BODY, RKMK4, START, every=1, breaks=[1.234, 5.678])

    def adaptive(name: str, start: Any, t_end: float, n: int, t_eval: Any = None, **options: Any) -> Entry:
        def make() -> Call:
            return run_of(plan(BODY, RKMK5, rtol=1e-9, **options), start, t_end=t_end, t_eval=t_eval)

        return Entry(f"a step by tolerance: {name}", make, n)

    # so many steps these runs have; what matters is the ratio of two trees
    end = np.array([200.0])
    yield adaptive("only the end", START, 200.0, 1838, end)
    yield adaptive("dense", START, 200.0, 1838)
    yield adaptive("at 777 times", START, 200.0, 1838, np.linspace(0.0, 200.0, 777))
    yield adaptive("with an event", START, 200.0, 1838, events=[falling])
    yield adaptive("16 in lanes", many(16), 20.0, 4_000, end / 10.0)
    yield adaptive("4096 in lanes", many(4096), 1.0, 80_000, end / 200.0)

    def fictive(name: str, n: int, t_eval: Any, count: int = 1) -> Entry:
        start = FALL
        if count > 1:
            start = ORBIT.state([[0.1, 0.0]] * count, [[0.0, 19.0**0.5 - 1e-3 * i] for i in range(count)])

        def make() -> Call:
            return run_of(plan(ORBIT, CONTROLLED, 0.1), start, t_end=60.0, t_eval=t_eval)

        return Entry(f"a step in fictive time: {name}", make, n * count)

    yield fictive("all kept", 750, None)
    yield fictive("at eleven times", 750, np.linspace(0.0, 60.0, 11))
    yield fictive("at eleven times, 16 in lanes", 750, np.linspace(0.0, 60.0, 11), 16)


def calls() -> Iterator[Entry]:
    """us a call."""

    def of(name: str, make: Callable[[], Call], goal: float = 0.0) -> Entry:
        return Entry(name, make, 0, goal)

    def with_plan(use: Callable[[lm.Plan], Call]) -> Callable[[], Call]:
        return lambda: use(plan(BODY, RKMK4, 0.1))

    def stepped(use: Callable[[Any], Any]) -> Callable[[], Call]:
        def make() -> Call:
            stepper = plan(BODY, RKMK4, 0.1).stepper(START)
            return lambda: use(stepper)

        return make

    def resumed(**span: Any) -> Callable[[lm.Plan], Call]:
        def use(p: lm.Plan) -> Call:
            begun = p.run(START, steps=200)
            return lambda: p.resume(begun, **span)

        return use

    def by_hand(p: lm.Plan) -> Call:
        return lambda: p.step(p.begin(START), 20)

    def one_more(n: int) -> Callable[[lm.Plan], Call]:
        def use(p: lm.Plan) -> Call:
            carry = p.begin(START)
            return lambda: p.step(carry, n)

        return use

    def with_an_input() -> Call:
        p, torque = plan(held([0.0, 0.0, 0.0]), RKMK4, 0.02), [0.0]
        start = p.system.state(mu=[0.3, -0.2, 0.4], g=np.eye(3))
        loop = [p.stepper(start)]

        def use() -> None:
            torque[0] = 0.1 - torque[0]
            loop[0] = p.replace(system=held([torque[0], 0.0, 0.0])).stepper(start, loop[0].t)
            loop[0].step(10)

        return use

    def kept(*names: str) -> Callable[[], Call]:
        p = plan(BODY, RKMK4, 0.1, record=names)
        return lambda: lambda: looked(p.run(START, steps=200), *names)

    def ensemble(count: int, n: int, own: bool = False) -> Callable[[], Call]:
        def make() -> Call:
            return run_of(plan(bodies(count) if own else BODY, RKMK4, 0.1, every=n), many(count), steps=n)

        return make

    def spun() -> Call:
        systems = gyrostats(5000)
        start = systems[0].state(mu=many(5000).mu, g=many(5000).g)
        return run_of(plan(systems, RKMK4, 0.1, every=20), start, steps=20)

    def to_a_time(system: Any, start: Any, **span: Any) -> Callable[[], Call]:
        return lambda: run_of(plan(system, RKMK5, rtol=1e-9, record=("mu", "g")), start, **span)

    end, ten = np.array([10.0]), np.linspace(0.0, 10.0, 11)
    grid = np.linspace(0.0, 60.0, 11)
    series = {"rtol": 1e-9, "atol": 1e-9, "record": ("q", "p")}
    yield of("plan.step, 200 steps", with_plan(one_more(200)))
    yield of("plan.step, one step", with_plan(one_more(1)))
    yield of("plan.begin and plan.step, 20 steps", with_plan(by_hand))
    yield of("stepper.step, one step", stepped(lambda s: s.step()), 3.0)
    yield of("the same, and its mu", stepped(lambda s: (s.step(), s.mu)), 3.0)
    yield of("a stepper with a new input, 10 steps", with_an_input)
    yield of("plan.run, 200 steps and samples", with_plan(lambda p: run_of(p, START, steps=200)), 10.0)
    yield of("the same, and its t, mu, g", with_plan(lambda p: lambda: looked(p.run(START, steps=200), "t", "mu", "g")))
    yield of("plan.resume, 200 steps", with_plan(resumed(steps=200)))
    yield of("record=('mu',), and its mu", kept("mu"), 10.0)
    yield of("record=('mu', 'g'), and both", kept("mu", "g"), 10.0)
    yield of(
        "a new start", with_plan(lambda p: lambda: p.run(BODY.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3)), steps=200))
    )
    yield of("a heavy top, kicks and drifts", lambda: run_of(plan(TOP, lm.KickDrift(order=6), 0.05), SPUN, steps=20))
    yield of("a pendulum, RATTLE", lambda: run_of(plan(PENDULUM, lm.RATTLE(), 0.05), SWING, steps=20))
    yield of(
        "integrate, the same", lambda: lambda: lm.integrate(BODY, RKMK4, START, h=0.1, steps=200, compiled=True), 30.0
    )
    yield of(
        "integrate, a new body",
        lambda: lambda: lm.integrate(lm.RigidBody([1.0, 1.5, 2.0]), RKMK4, START, h=0.1, steps=200, compiled=True),
    )
    yield of("plan.run, adaptive to t = 10", lambda: run_of(plan(BODY, RKMK5, rtol=1e-9), START, t_end=10.0))
    yield of("the same, only the end", to_a_time(BODY, START, t_end=10.0, t_eval=end), 30.0)
    yield of("the same at eleven times", to_a_time(BODY, START, t_end=10.0, t_eval=ten), 30.0)
    yield of(
        "Kepler, Taylor 18, adaptive",
        lambda: run_of(plan(ORBIT, lm.Taylor(18), **series), FALL, t_end=60.0, t_eval=grid),
    )
    yield of("Kepler in fictive time", lambda: run_of(plan(ORBIT, CONTROLLED, 0.1), FALL, t_end=60.0, t_eval=grid))
    yield of("16 bodies, 20 steps", ensemble(16, 20))
    yield of("256 bodies, 20 steps", ensemble(256, 20))
    yield of("16 bodies with inertias of their own, 20 steps", ensemble(16, 20, own=True))
    yield of("5000 bodies, 20 steps", ensemble(5000, 20))
    yield of("5000 bodies with inertias of their own, 20 steps", ensemble(5000, 20, own=True))
    yield of("10^6 bodies, 20 steps", ensemble(1_000_000, 20))
    yield of("5000 gyrostats in a field, made", lambda: lambda: gyrostats(5000))
    yield of("5000 gyrostats in a field, 20 steps", spun)
    yield of("256 inertias to t = 20, adaptive", lambda: to_a_time(bodies(256), many(256), t_end=20.0, t_eval=[20.0])())
    yield of("RigidBody(...)", lambda: lambda: lm.RigidBody([1.0, 1.5, 2.0]), 5.0)
    yield of("body.state(mu, g)", lambda: lambda: BODY.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3)), 5.0)
    yield of("body.exact, 201 times", lambda: lambda: BODY.exact(START, TIMES), 60.0)
    yield of("run.drift, 400 samples", with_plan(lambda p: p.run(START, steps=400).drift), 1000.0)
    yield of("ExactMoserVeselov.of", lambda: lambda: lm.ExactMoserVeselov.of(BODY, START, 0.1), 100.0)


# ---------------------------------------------------------------- timing


def least(call: Call, duration: float) -> float:
    """Microseconds of a call: the least of several runs, each of a millisecond or of one call, for so many seconds."""
    call()
    begun = time.perf_counter()
    call()
    found = max(1e-7, time.perf_counter() - begun)
    number, begun = max(1, int(1e-3 / found)), time.perf_counter()
    while time.perf_counter() - begun < duration:
        found = min(found, timeit.timeit(call, number=number) / number)
    return 1e6 * found


def in_native_code(call: Call) -> float:
    """Microseconds of a call that are native code."""
    kernels, spent = [(k, k.call) for k in kernel.alive()], [0.0]

    def timed(run: Callable[[bytes], None]) -> Callable[[bytes], None]:
        def call(block: bytes) -> None:
            begun = time.perf_counter()
            run(block)
            spent[0] += time.perf_counter() - begun

        return call

    for k, run in kernels:
        k.call = timed(run)
    found, begun = math.inf, time.perf_counter()
    for n in range(200):
        spent[0] = 0.0
        call()
        found = min(found, spent[0])
        if n and time.perf_counter() - begun > 0.5:
            break
    for k, run in kernels:
        k.call = run
    return 1e6 * found


def chosen(only: str) -> Iterator[Entry]:
    """The lines whose name has this text."""
    return (entry for table in (steps, calls) for entry in table() if only in entry.name)


def measured(entry: Entry, duration: float, warm: float = 0.0) -> tuple[Call, float]:
    """What is called, and its time in the entry's unit."""
    call, begun = entry.make(), time.process_time()
    while time.process_time() - begun < warm:
        call()
    found = least(call, duration)
    return call, 1e3 * found / entry.steps if entry.steps else found


def table(only: str, duration: float, warm: float) -> dict[str, Any]:
    """Measure and print all."""
    results: dict[str, Any] = {}
    print(f"{'what':<52}{'ns or us':>12}{'beyond the steps':>20}{'goal':>8}")
    for entry in chosen(only):
        call, spent = measured(entry, duration, warm)
        results[entry.name] = {entry.unit: spent, "goal": entry.goal}
        beyond = ""
        if not entry.steps:
            results[entry.name]["beyond"] = spent - in_native_code(call)
            beyond = f"{results[entry.name]['beyond']:.1f}"
        print(f"{entry.name:<52}{spent:>9.1f} {entry.unit}{beyond:>20}{entry.goal or '':>8}", flush=True)
    return results


# ---------------------------------------------------------------- two trees


def of_tree(tree: Path, cache: str, only: str, duration: float, warm: float) -> dict[str, list[Any]]:
    """The times of a tree, in a process of its own; what it cannot do is missing."""
    known = {"PYTHONPATH": str(tree), "LIEMECH_CACHE_DIR": cache, "OPENBLAS_NUM_THREADS": "1"}
    how = "--only", only, "--duration", str(duration), "--bare", str(warm)
    command = [sys.executable, __file__, *how]
    done = subprocess.run(command, env=os.environ | known, cwd=tree, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{tree}: {done.stderr}")
    found: dict[str, list[Any]] = json.loads(done.stdout.splitlines()[-1])
    return found


def bare(only: str, duration: float, warm: float) -> None:
    """The times as JSON, for `of_tree`."""
    found = {}
    for entry in chosen(only):
        try:
            found[entry.name] = [entry.unit, measured(entry, duration, warm)[1]]
        except Exception as error:  # another tree may refuse it
            print(f"{entry.name}: {type(error).__name__}: {error}", file=sys.stderr)
    print(json.dumps(found))


def against(other: Path, rounds: int, gate: float, only: str, duration: float) -> int:
    """Both trees in turn, the least of each line, and their ratio."""
    trees = {"other": other.resolve(), "this": Path(lm.__file__).resolve().parent.parent}
    least_of: dict[str, dict[str, float]] = {"other": {}, "this": {}}
    units: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        for k in range(rounds):
            for name in sorted(trees, reverse=k % 2 == 1):
                warm = 0.3 if k else WARM  # native code lies on the disk later on
                found = of_tree(trees[name], f"{folder}/{name}", only, duration, min(warm, 20.0 * duration))
                for line, (unit, value) in found.items():
                    units[line] = unit
                    least_of[name][line] = min(value, least_of[name].get(line, math.inf))
    slower = []
    print(f"{'what':<52}{'other':>12}{'this':>12}{'ratio':>8}")
    for line, unit in units.items():
        a, b = (least_of[name].get(line, math.nan) for name in ("other", "this"))
        late = b > gate * a
        slower += [line] * late
        print(f"{line:<52}{a:>9.1f} {unit}{b:>9.1f} {unit}{b / a:>8.3f}{' *' * late}")
    print(f"{len(slower)} of {len(units)} lines above {gate}" + "".join(f"\n  {x}" for x in slower))
    return 1 if slower else 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="smoke run: rough numbers")
    parser.add_argument("--only", default="", metavar="TEXT", help="lines whose name has this text")
    parser.add_argument("--out", type=Path, default=Path("calls.json"), help="where the JSON goes")
    parser.add_argument("--against", type=Path, metavar="PATH", help="another tree")
    parser.add_argument("--gate", type=float, default=1.03, help="the largest ratio")
    parser.add_argument("--rounds", type=int, default=5, help="processes of each tree")
    parser.add_argument("--duration", type=float, default=0.15, help="seconds for a line")
    parser.add_argument("--bare", type=float, help=argparse.SUPPRESS)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    duration = 0.01 if args.quick else args.duration
    if args.bare is not None:
        return bare(args.only, duration, args.bare)
    if args.against:
        rounds = 1 if args.quick else args.rounds
        raise SystemExit(against(args.against, rounds, args.gate, args.only, duration))
    results = table(args.only, duration, 0.05 if args.quick else WARM)
    harness.write(args.out, results)


if __name__ == "__main__":
    main()
