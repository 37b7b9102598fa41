"""What a new command of a control loop costs, from Python and in exported C, and how it scatters.

    python tests/benchmarks/control_loop.py [--quick] [--out results.json]

Commands: the least processor time of many rounds; both ways take turns in each round.  `new plan` is
what a command cost before steppers had inputs: a system, a plan and a stepper for each.  C: the steps
of `plan.export`, compiled by cc -O2, against the same steps in one call from Python.  Jitter: wall
times of single turns of a whole loop, 1 kHz, four native steps, PD control; without waiting.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import harness
import numpy as np

import liemech as lm


@lm.record
class Held(lm.Force):
    torque: lm.Vec

    def covector(self, t, xi, g):
        return self.torque


@lm.record
class Fuel(lm.DrivenKineticEnergy):
    moments: lm.Vec

    def inertia(self, t):
        return (1.0 - 1e-6 * t) * self.moments


MOMENTS, H = np.array([1.0, 1.5, 2.0]), 0.25e-3


def satellite(torque: Any = (0.0, 0.0, 0.0)) -> lm.MechanicalSystem:
    load = Held(lm.vec(*torque))
    return lm.MechanicalSystem(lm.RigidBody(MOMENTS), lm.NoPotential(), load=load)


def start_of(system: Any, bodies: int = 0) -> Any:
    g = lm.SO3().exp([0.5, 1.0, -0.5])
    if not bodies:
        return system.state(mu=[0.3, -0.3, 0.8], g=g)
    mu = np.random.default_rng(1).normal(size=(bodies, 3))
    return system.state(mu=mu, g=np.tile(g, (bodies, 1, 1)))


def pd(loop: Any) -> np.ndarray:
    """The torque of a PD controller: towards g = 1, against the turning."""
    g = loop.g
    away = np.array([g[2, 1] - g[1, 2], g[0, 2] - g[2, 0], g[1, 0] - g[0, 1]])
    return -0.5 * away - 2.0 * loop.mu / MOMENTS


def least(ways: dict[str, Callable[[], Any]], rounds: int, seconds: float) -> dict[str, float]:
    """us a call of each, processor time: the least of the rounds, in which they take turns."""
    counts = {}
    for name, way in ways.items():
        for _ in range(3):
            way()
        begun = time.process_time()
        for _ in range(10):
            way()
        counts[name] = max(3, int(seconds / max(1e-6, (time.process_time() - begun) / 10)))
    found = dict.fromkeys(ways, np.inf)
    for _ in range(rounds):
        for name, way in ways.items():
            begun = time.process_time()
            for _ in range(counts[name]):
                way()
            found[name] = min(found[name], 1e6 * (time.process_time() - begun) / counts[name])
    return found


def commands(quick: bool) -> list[dict[str, Any]]:
    rows = []
    torque = np.array([1e-3, 2e-3, -1e-3])
    cases: list[tuple[str, Any, int]] = [
        ("RKMK 4", lm.RKMK(order=4), 0),
        ("Lie-Verlet", lm.LieVerlet(), 0),
        ("RKMK 4, 256 bodies", lm.RKMK(order=4), 256),
    ]
    for name, method, bodies in cases[: 2 if quick else 3]:
        plan = lm.Plan(satellite(), method, H, compiled=True, progress=False)
        loop = plan.stepper(start_of(plan.system, bodies))
        state, u = loop.state, torque if not bodies else np.tile(torque, (bodies, 1))
        loop.step(4, torque=u)

        def anew(plan: Any = plan, state: Any = state) -> None:
            plan.replace(system=satellite(torque)).stepper(state, 0.0).step(4)

        ways: dict[str, Callable[[], Any]] = {
            "one step": lambda loop=loop: loop.step(),
            "command and one step": lambda loop=loop, u=u: loop.step(1, torque=u),
            "command and four": lambda loop=loop, u=u: loop.step(4, torque=u),
            "new plan and four": anew,
        }
        if not bodies:
            ways["inertia and one step"] = lambda loop=loop: loop.step(1, inertia=MOMENTS)
        loop.reset()
        rows.append({"method": name, **least(ways, 5 if quick else 15, 0.005 if quick else 0.02)})
        loop.reset()
    return rows


CLOCKED = """
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "attitude.h"

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}

static double wall(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}

static int by_size(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

int main(int count, char **words) {
  const int rounds = atoi(words[1]), turns = atoi(words[2]);
  attitude_state start = START;
  attitude_inputs command = {{1e-3, 2e-3, -1e-3}};
  attitude run;
  double *spent = malloc(turns * sizeof *spent), many = 1e9, few = 1e9, begun;
  int round, i;
  (void)count;
  for (round = 0; round < rounds; round++) {
    attitude_begin(&run, &start, NULL, 0.0);
    begun = now();
    attitude_step(&run, NULL, turns);
    begun = (now() - begun) / turns;
    if (begun < many) many = begun;
    attitude_begin(&run, &start, NULL, 0.0);
    begun = now();
    for (i = 0; i < turns; i++) attitude_step(&run, &command, 1);
    begun = (now() - begun) / turns;
    if (begun < few) few = begun;
  }
  attitude_begin(&run, &start, NULL, 0.0);
  for (i = 0; i < turns; i++) {
    begun = wall();
    attitude_step(&run, &command, 4);
    spent[i] = wall() - begun;
  }
  qsort(spent, turns, sizeof *spent, by_size);
  printf("%.17g %.17g %.17g %.17g %.17g %.17g\\n", 1e9 * many, 1e9 * few, 1e6 * spent[turns / 2],
         1e6 * spent[(int)(0.999 * turns)], 1e6 * spent[(int)(0.9999 * turns)], 1e6 * spent[turns - 1]);
  return 0;
}
"""


def in_c(quick: bool) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Steps in C and from Python, and the scatter in C; nothing without a C compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        return [], []
    rows, scatter = [], []
    fuelled = lm.MechanicalSystem(
        lm.DrivenLiePoissonSystem(lm.SO3(), Fuel(MOMENTS)), lm.NoPotential(), load=Held([0.0] * 3)
    )
    cases: list[tuple[str, Any, Any]] = [
        ("RKMK 4", satellite(), lm.RKMK(order=4)),
        ("Lie-Verlet", satellite(), lm.LieVerlet()),
        ("kicks and drifts, mass of t", fuelled, lm.KickDrift()),
    ]
    for name, system, method in cases[: 1 if quick else 3]:
        plan = lm.Plan(system, method, H, compiled=True, progress=False)
        start, turns = start_of(system), 2000 if quick else 20000
        for target in (None, "native")[: 1 if quick else 2]:
            with tempfile.TemporaryDirectory() as folder:
                made = plan.export(Path(folder) / "attitude", start, inputs=["torque"], target=target)
                given = "{" + braces(start.mu) + ", " + braces(np.array(start.g)) + "}"
                text = CLOCKED.replace("START", given)
                (Path(folder) / "clocked.c").write_text(text)
                subprocess.run(
                    [compiler, "-O2", "clocked.c", "attitude.o", "-lm", "-o", "clocked"],
                    cwd=folder, check=True,
                )  # fmt: skip
                loop, native = plan.stepper(start), np.inf
                found = np.full(6, np.inf)
                for _ in range(2 if quick else 8):  # in turn
                    loop.reset()
                    begun = time.process_time()
                    loop.step(turns)
                    native = min(native, 1e9 * (time.process_time() - begun) / turns)
                    raised = priority(True)
                    told = subprocess.run(
                        [Path(folder) / "clocked", "3", str(turns)],
                        capture_output=True, text=True, check=True,
                    ).stdout  # fmt: skip
                    priority(False)
                    found = np.minimum(found, [float(x) for x in told.split()])
            processor = "this processor" if target else "any processor"
            bound = None if made.bound is None else made.bound.instructions
            rows.append({
                "method": f"{name}, {processor}", "Python, ns a step": native, "C, ns a step": found[0],
                "C, command and step": found[1], "ratio": found[0] / native, "operations": bound,
            })  # fmt: skip
            if not scatter:
                what = "C, step alone" + ("" if raised else ", no priority here")
                scatter.append({"loop": what, **quantiles_of(found[2:])})
    return rows, scatter


def priority(wanted: bool) -> bool:
    """A priority that ordinary processes do not have, or none; was it given?"""
    if not hasattr(os, "sched_setscheduler"):
        return False
    try:
        kind = os.SCHED_FIFO if wanted else os.SCHED_OTHER
        os.sched_setscheduler(0, kind, os.sched_param(10 if wanted else 0))
    except OSError:
        return False
    return True


def braces(x: Any) -> str:
    """An array as C writes it."""
    inner = [braces(row) if np.ndim(row) else f"{float(row):.17g}" for row in x]
    return "{" + ", ".join(inner) + "}"


def quantiles_of(us: Any) -> dict[str, float]:
    return dict(zip(("50 %", "99.9 %", "99.99 %", "most"), map(float, us)))


def jitter(quick: bool) -> list[dict[str, Any]]:
    """us a turn of a whole loop: reading the state, the controller, a command, four steps."""
    turns, rows = 2000 if quick else 100_000, []
    plan = lm.Plan(satellite(), lm.RKMK(order=4), H, compiled=True, progress=False)
    for name in ("as it is", "collector frozen", "and one core", "and priority", "step alone"):
        loop = plan.stepper(start_of(plan.system))
        u, spent, alone = np.zeros(3), np.empty(turns), name == "step alone"
        loop.step(4, torque=u)
        cores = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
        if name != "as it is":
            gc.collect()
            gc.freeze()
            gc.disable()
        if cores and name in ("and one core", "and priority", "step alone"):
            os.sched_setaffinity(0, {max(cores)})
        if name in ("and priority", "step alone") and not priority(True):
            name += ", no priority here"
        try:
            for i in range(turns):
                begun = time.perf_counter_ns()
                loop.step(4, torque=u if alone else pd(loop))
                spent[i] = time.perf_counter_ns() - begun
        finally:
            gc.enable()
            gc.unfreeze()
            priority(False)
            if cores:
                os.sched_setaffinity(0, cores)
        at = np.quantile(spent, [0.5, 0.999, 0.9999, 1.0]) / 1e3
        rows.append({"loop": f"Python, {name}", **quantiles_of(at)})
    return rows


def shown(title: str, rows: list[dict[str, Any]]) -> None:
    names = [*dict.fromkeys(n for row in rows for n in row)]
    harness.table(title, names, [[row.get(name) for name in names] for row in rows])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    load = os.getloadavg() if hasattr(os, "getloadavg") else (0.0,)
    print(f"load of the machine {load[0]:.1f} on {os.cpu_count()} cores")
    calls = commands(given.quick)
    shown("A command, us of processor time", calls)
    steps, scatter = in_c(given.quick)
    if steps:
        shown("A step in C and from Python, ns", steps)
    scatter = [*jitter(given.quick), *scatter]
    shown("A turn of a loop with a command and four steps, us of wall time", scatter)
    if given.out:
        found = {"load": load, "commands": calls, "steps": steps, "jitter": scatter}
        given.out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
