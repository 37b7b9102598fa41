"""Throughput of ensembles: 10^5 bodies beside the C++ in SIMD lanes, attitudes beside momenta
alone, two workers beside one, and beside them the C++ in two threads and in one.

    python tests/benchmarks/throughput.py [--quick] [--write] [--out results.json]

Times are those of the clock, of whole calls from given starts to the last states; runs that are
compared take turns.  --write puts the tables into docs/proof/performance.md.  Let nothing else run.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import baseline
import harness
import numpy as np

import liemech as lm

BODIES, STEP = 99_840, 0.05  # a multiple of 24 lanes and of 16
METHODS = {"RKMK4": lm.RKMK(order=4), "Algorithm 1, Cayley": lm.CovariantVariational(lm.Cayley())}
OPPONENTS = {"RKMK4": ("RKMK4",), "Algorithm 1, Cayley": ("Algorithm 1, Cayley", "Algorithm 1, Cayley, one unknown")}
GOALS = {20: 0.85, 200: 0.9}
PAGE = Path(__file__).parents[2] / "docs" / "proof" / "performance.md"
MARKS = "<!-- throughput -->", "<!-- end of throughput -->"


def timed(runs: dict[str, Callable[[], Any]], repetitions: int) -> dict[str, harness.Timing]:
    """Seconds of calls in turn."""
    spent: dict[str, list[float]] = {name: [] for name in runs}
    for run in runs.values():
        run()
    for _ in range(repetitions):
        for name, run in runs.items():
            begun = time.perf_counter()
            run()
            spent[name].append(time.perf_counter() - begun)
    return {name: harness.Timing(np.array(x)) for name, x in spent.items()}


def ours(method: lm.Method, bodies: int, steps: int, workers: int = 1, attitude: bool = False) -> Callable[[], Any]:
    """A call of liemech."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    mu = np.random.default_rng(0).normal(size=(bodies, 3))
    start = body.state(mu, np.broadcast_to(np.eye(3), (bodies, 3, 3)) if attitude else None)
    plan = lm.Plan(body, method, STEP, every=steps, compiled=True, progress=False, workers=workers, compensated=False)
    return lambda: plan.run(start, steps=steps)


def theirs(build: baseline.Baseline, name: str, steps: int, attitude: bool, bodies: int = BODIES) -> Callable[[], Any]:
    """The same in C++: its arrays are laid out as its lanes want them, and copied before each run."""
    mu = np.ascontiguousarray(np.random.default_rng(0).normal(size=(bodies, 3)).T)
    g = np.ascontiguousarray(np.eye(3).reshape(9, 1).repeat(bodies, axis=1)) if attitude else None
    inertia, lanes = np.array([1.0, 1.5, 2.0]), build.lanes()

    def run() -> None:
        build.advance(baseline.METHODS[name], lanes, mu.copy(), None if g is None else g.copy(), inertia, STEP, steps)

    return run


def at_once(*runs: Callable[[], Any]) -> Callable[[], Any]:
    """A call that makes these, each in a thread."""
    others = ThreadPoolExecutor(len(runs) - 1)

    def run() -> None:
        waiting = [others.submit(other) for other in runs[1:]]
        runs[0]()
        for other in waiting:
            other.result()

    return run


def beside_cpp(repetitions: int) -> list[dict[str, Any]]:
    """Rows of 10^5 bodies: a million steps a second, and the share of the speed of C++, middle and best."""
    build, rows = baseline.build().get("off"), []
    for name, method in METHODS.items():
        for attitude in (False, True):
            for steps, goal in GOALS.items():
                runs = {"liemech": ours(method, BODIES, steps, attitude=attitude)}
                if build is not None:
                    runs |= {opponent: theirs(build, opponent, steps, attitude) for opponent in OPPONENTS[name]}
                found = timed(runs, repetitions)
                mine = found["liemech"]
                row: dict[str, Any] = {
                    "method": name,
                    "records": "mu, g" if attitude else "mu",
                    "steps": steps,
                    "rate": BODIES * steps / mine.best / 1e6,
                    "goal": goal,
                }
                for key, opponent in zip(("share", "one unknown"), OPPONENTS[name], strict=False):
                    if opponent in found:
                        other = found[opponent]
                        row[key] = [1.0 / mine.over(other), other.best / mine.best]
                rows.append(row)
    return rows


def by_workers(repetitions: int) -> list[dict[str, Any]]:
    """How many times as fast two workers are as one, and two threads of C++, with half of the bodies each, as one."""
    build, rows, name = baseline.build().get("off"), [], "Algorithm 1, Cayley"
    for bodies, steps in ((17, 1000), (1000, 1000), (BODIES, 20), (BODIES, 200)):
        runs = {str(w): ours(METHODS[name], bodies, steps, w) for w in (1, 2)}
        halves = bodies // 2 // 24 * 24
        if build is not None and halves:
            first, second = (theirs(build, name, steps, False, halves) for _ in range(2))
            runs |= {"C++ 1": theirs(build, name, steps, False, 2 * halves)}
            runs |= {"C++ 2": at_once(first, second)}
        found = timed(runs, repetitions)
        row: dict[str, Any] = {"bodies": bodies, "steps": steps}
        for key, one, two in (("gain", "1", "2"), ("gain of C++", "C++ 1", "C++ 2")):
            if two in found:
                row[key] = [found[one].over(found[two]), found[one].best / found[two].best]
        rows.append(row)
    return rows


def pair(found: list[float] | None) -> str:
    """Middle and best."""
    return "-" if found is None else f"{found[0]:.2f}, {found[1]:.2f}"


def page(results: dict[str, Any]) -> str:
    """Both tables."""
    machine = results["machine"]
    lines = [
        f"{BODIES} bodies, {machine['cpu']}, {machine['cores']} cores, {machine['time']}. Ratios:",
        "the median over neighbouring repetitions, and that of the best times.",
        "",
        "| method | records | steps | M steps/s | speed beside C++ | wanted | beside one unknown |",
        "| --- | --- | --- | --- | --- | --- | --- |",
        *(
            f"| {r['method']} | {r['records']} | {r['steps']} | {r['rate']:.1f} | "
            f"{pair(r.get('share'))} | {r['goal']} | {pair(r.get('one unknown'))} |"
            for r in results["beside C++"]
        ),
        "",
        "| bodies | steps | two workers: times as fast as one | two threads of C++ |",
        "| --- | --- | --- | --- |",
        *(
            f"| {r['bodies']} | {r['steps']} | {pair(r['gain'])} | {pair(r.get('gain of C++'))} |"
            for r in results["workers"]
        ),
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="smoke run: rough numbers")
    parser.add_argument("--write", action="store_true", help="put the tables into the page")
    parser.add_argument("--out", type=Path, default=Path("throughput.json"), help="for the JSON")
    chosen = parser.parse_args()
    repetitions = 2 if chosen.quick else 25
    results = {"machine": harness.machine(), "beside C++": beside_cpp(repetitions), "workers": by_workers(repetitions)}
    text = page(results)
    print(text)
    harness.write(chosen.out, results)
    if chosen.write:
        before, _, rest = PAGE.read_text().partition(MARKS[0])
        _, _, after = rest.partition(MARKS[1])
        PAGE.write_text(f"{before}{MARKS[0]}\n\n{text}\n\n{MARKS[1]}{after}")


if __name__ == "__main__":
    main()
