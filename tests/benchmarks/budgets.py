"""Goals of time and memory, and of time to error beside other packages: wanted, measured, met.

    python tests/benchmarks/budgets.py [--run rigid_body calls ... | all] [--quick] [--minutes 20]

--run measures these again, each by its own benchmark, and keeps the rows in `budgets.json`; a
benchmark that does not finish within its share of the minutes is named, and its rows stay.  Then
docs/proof/measured/budgets.md is written from them, from `leader_board.json` and from
`tests/stress/long_runs.json`.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import harness
import numpy as np
from board_page import best, error, number, quickest

import liemech as lm

HERE = Path(__file__).parent
KEPT, PAGE = HERE / "budgets.json", HERE.parents[1] / "docs" / "proof" / "measured" / "budgets.md"
STRESS = HERE.parent / "stress"
Row = dict[str, Any]
HEAD = """# Budgets

What was wanted when the library was planned, what is measured, and whether it is met. A range is that of all cases, and
the worst of them decides. `python tests/benchmarks/budgets.py --run all` measures the first table and writes both; the
second is that of the [leader board](../leader_board.md). [Performance](../performance.md) says where the time goes, and
[reliability](../reliability.md) has the goals under stress.

"""


def row(what: str, goal: str, measured: str, met: bool | None, undecided: str = "not measured") -> Row:
    """A line of the table; met is None where it was not measured, or not as far as the goal asks,
    which `undecided` says then.
    """
    return {"what": what, "goal": goal, "measured": measured, "met": met, "undecided": undecided}


def span(values: Iterable[float], unit: str = "") -> str:
    """The least and the largest, with their median if there are many."""
    x = sorted(values)
    middle = f", median {number(statistics.median(x))}" if len(x) > 4 else ""
    return (f"{number(x[0])} to {number(x[-1])}{middle}" if len(x) > 1 else number(x[0])) + unit


def at_most(what: str, goal: str, values: Iterable[float], bound: float, unit: str = "") -> Row:
    """A row that is met if no value is above the bound."""
    x = list(values)
    count = sum(v <= bound for v in x)
    many = f" ({count} of {len(x)} within)" if len(x) > 1 else ""
    return row(what, goal, span(x, unit) + many, max(x) <= bound) if x else row(what, goal, "-", None)


# ------------------------------------------------------------------ what each benchmark says


def _beside_c(what: str, rows: list[Row], name: str = "C") -> list[Row]:
    bounds = {"off": ("without contraction", 1.1), "fast": ("with contraction", 1.25)}
    return [
        at_most(
            f"{what}, beside {name} {words}", f"{bound} times",
            [r["ratios"][f"{name} {key}"] for r in rows if f"{name} {key}" in r["ratios"]], bound,
        )
        for key, (words, bound) in bounds.items()
    ]  # fmt: skip


def rigid_body(found: Any) -> list[Row]:
    """Single bodies, ensembles, start-up."""
    rows = _beside_c("a step of a free body or a top", found["steps"], "C++")
    stages = [r["stages"] / 5.0 for r in found["steps"] if r.get("stages")]
    rows.append(at_most("composition as data, beside its five stages", "1.1 times", stages, 1.1))
    ratios = [1.0 / r["ratios"]["C++ off"] for r in found["ensembles"] if r["ratios"].get("C++ off")]
    if ratios:
        rows.append(
            row("ensemble, one core, speed beside C++ SIMD", "at least 0.85", span(ratios), min(ratios) >= 0.85)
        )
    alone = {(r["method"], r["attitude"]): r["ns"]["liemech"]["best"] for r in found["steps"] if "liemech" in r["ns"]}
    gains = [
        alone[key] / r["ns"]["liemech"]["best"]
        for r in found["ensembles"]
        if (key := (r["method"], r["attitude"])) in alone and "liemech" in r["ns"]
    ]
    if gains:
        rows.append(row("ensemble, one core, beside a single body", "at least 6 times", span(gains), min(gains) >= 6.0))
    start = {r["command"]: r for r in found.get("start_up", [])}
    if start:
        ratio = start["python -c 'import liemech'"]["over_numpy"]
        rows.append(at_most("import, beside `import numpy`", "1.2 times", [ratio], 1.2))
        rows.append(
            at_most("the main job in a new process", "0.5 s", [start["python -m liemech --quiet"]["median"]], 0.5, " s")
        )
        for state, bound in (("warm", 0.6), ("cold", 4.0)):
            times = [r["median"] for name, r in start.items() if f"{state} cache" in name]
            rows.append(
                at_most(f"a first compiled run in a new process, cache {state}", f"{bound} s", times, bound, " s")
            )
    return rows


def groups(found: Any) -> list[Row]:
    """SE(3), tableaus, generators, a user's energy."""
    rows = _beside_c("a step on SE(3)", found["rigid_motions"], "C++")
    rows.append(at_most("tableau as data, beside stages written out", "1.1 times", _all(found["tableaus"]), 1.1))
    rows.append(at_most("generators alone, beside a closed form", "3 times", _all(found["generators_so3"]), 3.0))
    for key, bound in (("gradient given", 1.05), ("derived", 1.15)):
        ratios = [r["ratios"][key] for r in found["energies"]]
        rows.append(at_most(f"a user's energy, {key}, beside the built-in one", f"{bound} times", ratios, bound))
    return rows


def _all(rows: list[Row]) -> list[float]:
    return [x for r in rows for x in r["ratios"].values()]


def calls(found: Any) -> list[Row]:
    """What a call costs."""
    names = {
        "plan.run, 200 steps and samples": "a prepared run of 200 steps, beyond the steps",
        "integrate, the same": "`integrate` repeated, beyond the steps",
        "stepper.step, one step": "a single compiled step, by hand",
    }
    return [
        at_most(text, f"{found[n]['goal']:g} us", [found[n]["beyond"]], found[n]["goal"], " us")
        for n, text in names.items()
    ]


def compile_time(found: Any) -> list[Row]:
    """Cold compiles."""
    large = {name: r["cold"] for name, r in found.items() if "SO(16)" in name}
    rest = {name: r["cold"] for name, r in found.items() if name not in large}
    rows = [at_most("cold compile of anything shipped", "4 s", rest.values(), 4.0, " s")]
    return rows + ([at_most("cold compile on SO(16)", "10 s", large.values(), 10.0, " s")] if large else [])


def direct(_: Any) -> list[Row]:
    """Two cores, and memory."""
    body, n = lm.RigidBody([1.0, 1.5, 2.0]), 4096
    mu = np.random.default_rng(1).normal(size=(n, 3))
    start = body.state(mu=mu)
    ratios = []
    for _ in range(7):
        spent = []
        for workers in (1, 2):
            plan = lm.Plan(body, lm.RKMK(order=4), h=0.1, every=2000, compiled=True, progress=False, workers=workers)
            plan.run(start, steps=20)
            begun = time.perf_counter()
            plan.run(start, steps=2000)
            spent.append(time.perf_counter() - begun)
        ratios.append(spent[0] / spent[1])
    gain = float(np.median(ratios))
    alone = lm.Plan(body, lm.RKMK(order=4), h=0.1, every=10**6, compiled=True, progress=False)
    one = body.state(mu=mu[0])
    alone.run(one, steps=10)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    alone.run(one, steps=10**8)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    return [
        row("two cores on an ensemble", "at least 1.8 times", f"{number(gain)} on {os.cpu_count()} cores", gain >= 1.8),
        at_most("memory of 10^8 steps, 100 of them kept", "the samples and 5 MB", [grown], 5.0, " MB"),
    ]


BENCHMARKS: dict[str, Callable[[Any], list[Row]]] = {
    "rigid_body": rigid_body,
    "groups": groups,
    "splittings": lambda found: _beside_c("a splitting step", found["steps"]),
    "constrained": lambda found: _beside_c("a step of RATTLE", found["steps"]),
    "time_transformations": lambda found: _beside_c("a time-transformed step", found["steps"]),
    "poisson": lambda found: _beside_c("a step of a Poisson system", found["steps"]),
    "calls": calls,
    "compile_time": compile_time,
    "direct": direct,
}


# ------------------------------------------------------------------ time to error


def problems(board: Any) -> list[Row]:
    """Goals beside heyoka, SciPy and diffrax."""
    rows = []
    wanted: dict[str, dict[float, float]] = {
        "momentum": {1e-12: 0.8}, "attitude": {1e-12: 0.35}, "long": {1e-9: 0.25}, "top": dict.fromkeys((1e-3, 1e-6, 1e-9), 1.0),
        "fish": dict.fromkeys((1e-3, 1e-6, 1e-9), 1.0), "kepler": {1e-6: 0.6}, "pendulum": {1e-3: 1.0, 1e-6: 1.0, 1e-9: 1.5},
    }  # fmt: skip
    for key, goals in wanted.items():
        race = board["races"].get(key)
        for target, bound in goals.items() if race else ():
            ours, theirs = (
                best([c for c in race["curves"] if c["package"] == p], target) for p in ("liemech", "heyoka")
            )
            what, goal = (f"{race['name']}, error {error(target)}, time beside heyoka", f"at most {bound:g}")
            ratio = ours[0] / theirs[0] if ours and theirs else None
            rows.append(
                row(what, goal, f"{number(ratio)} ({ours[1]})" if ratio and ours else "-", ratio and ratio <= bound)
            )
    for package, method, bound in (("SciPy", "DOP853", 20.0), ("diffrax", "", 5.0)):
        factors = {}
        for race in board["races"].values():
            for target in (1e-6, 1e-9):
                ours = best([c for c in race["curves"] if c["package"] == "liemech"], target)
                times = [
                    quickest(c["points"], target)
                    for c in race["curves"]
                    if c["package"] == package and method in c["method"]
                ]
                theirs = min((t for t in times if t), default=None)
                if ours and theirs:
                    factors[f"{race['name']}, {error(target)}"] = theirs / ours[0]
        if factors:
            least = min(factors, key=lambda name: factors[name])
            text = f"{span(factors.values())}; least: {least}"
            rows.append(
                row(
                    f"time of {package} {method} over ours, 1e-6 and 1e-9",
                    f"at least {bound:g}",
                    text,
                    factors[least] >= bound,
                )
            )
    for found in board.get("crowds", {}).get("to error", []):
        seconds = {name: t["median"] for name, t in found["seconds"].items()}
        ours = min((t, name) for name, t in seconds.items() if name.startswith("liemech"))
        theirs = [t for name, t in seconds.items() if "batches" in name]
        which = "inertia of their own" if found["different"] else "equal inertia"
        if theirs:
            ratio = ours[0] / theirs[0]
            text = f"{number(ratio)} ({ours[1].removeprefix('liemech ')})"
            rows.append(
                row(f"ensemble to t = 20, 1e-9, {which}, beside batches of heyoka", "at most 0.2", text, ratio <= 0.2)
            )
    for name, bound in (("JAX RK4", 4.0), ("MuJoCo RK4", 100.0)):
        factors = {
            f"{r['bodies']:,} bodies, {r['steps']} steps": r["seconds"][name]["median"]
            / r["seconds"]["liemech RKMK4"]["median"]
            for r in board.get("crowds", {}).get("steps", [])
            if name in r["seconds"]
        }
        if factors:
            values = factors.values()
            rows.append(
                row(
                    f"ensemble of order 4, time of {name} over ours",
                    f"at least {bound:g}",
                    span(values),
                    min(values) >= bound,
                )
            )
    rows.append(row("isospectral midpoint on su(256), beside quflow", "at most 0.5", "quflow is not installed", None))
    return rows


def long_runs() -> list[Row]:
    """Energy of symplectic methods after 10^8 steps."""
    path = STRESS / "long_runs.json"
    if not path.exists():
        return []
    sys.path.insert(0, str(STRESS))
    import long_runs as stress

    kept = json.loads(path.read_text(encoding="utf-8"))
    chosen = {
        k: v
        for k, v in kept.items()
        if any(name in k for name in ("Algorithm 1", "Hamilton-Jacobi 4", "Lie-Verlet", "RATTLE", "Stormer"))
    }
    slopes = [p for v in chosen.values() if (p := stress.exponent(v["errors"])) is not None]
    least = min(v["steps"] for v in chosen.values())
    if not slopes:
        return []
    steps = f"{least:.0e} steps".replace("e+0", "e")
    met = False if max(slopes) >= 0.1 else True if least >= 1e8 else None
    return [
        row(
            "energy of symplectic methods: no slope after 10^8 steps",
            "exponent below 0.1",
            f"exponents {span(slopes)} after {steps} and more",
            met,
            f"measured to {steps} only",
        )
    ]


# ------------------------------------------------------------------ the page


def table(rows: list[Row]) -> str:
    """Goal, measured, met."""
    text = "| | goal | measured | |\n| --- | --- | --- | --- |\n"
    for r in rows:
        undecided = r.get("undecided", "not measured")
        said = undecided if r["met"] is None else "met" if r["met"] else "**missed**"
        text += f"| {r['what']} | {r['goal']} | {r['measured']} | {said} |\n"
    met, missed = (sum(r["met"] is x for r in rows) for x in (True, False))
    return f"{met} met, {missed} missed, {len(rows) - met - missed} undecided.\n\n{text}"


def write_page() -> None:
    """docs/proof/measured/budgets.md."""
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    text, page = "", HEAD
    if kept.get("machine"):
        text = f"On {kept['machine']['cpu']}, {kept['machine']['time'][:10]}. "
    page += f"## Steps, calls, memory\n\n{text}"
    page += table([r for name in BENCHMARKS for r in kept.get(name, [])] + long_runs())
    board = HERE / "leader_board.json"
    if board.exists():
        page += "\n## Time to error\n\n" + table(problems(json.loads(board.read_text(encoding="utf-8"))))
    PAGE.write_text(page, encoding="utf-8")
    print(f"written: {PAGE}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", nargs="*", default=[], help="benchmarks to run first, or `all`")
    parser.add_argument("--quick", action="store_true", help="their smoke runs: rough numbers")
    parser.add_argument("--minutes", type=float, default=20.0, help="for all, at most")
    chosen = parser.parse_args()
    ends = time.monotonic() + 60.0 * chosen.minutes
    kept: dict[str, Any] = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    names = list(BENCHMARKS) if "all" in chosen.run else chosen.run
    for k, name in enumerate(names):
        share = max(1.0, 2.0 * (ends - time.monotonic()) / (len(names) - k + 1))
        found = None
        if name != "direct":
            with tempfile.TemporaryDirectory() as folder:
                out = Path(folder) / "found.json"
                command = [
                    sys.executable,
                    str(HERE / f"{name}.py"),
                    "--out",
                    str(out),
                    *["--quick"] * chosen.quick,
                    *["--short"] * (name == "rigid_body"),
                ]
                try:
                    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=share)
                except subprocess.TimeoutExpired:
                    print(f"{name}: not finished within {share:.0f} s", flush=True)
                    continue
                if not out.exists():
                    print(f"{name}: {(done.stderr.strip() or 'nothing was written').splitlines()[-1]}")
                    continue
                found = json.loads(out.read_text(encoding="utf-8"))
        kept[name] = BENCHMARKS[name](found)
        kept["machine"] = harness.machine()
        KEPT.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
        print(f"{name}: {sum(r['met'] is True for r in kept[name])} of {len(kept[name])} met", flush=True)
    write_page()


if __name__ == "__main__":
    main()
