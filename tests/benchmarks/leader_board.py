"""The leader board: time against error, this library beside all other packages that are installed,
on ten problems and ensembles.

    python tests/benchmarks/leader_board.py [--minutes 10] [--only top kepler] [--quick] [--page]

It measures, writes `leader_board.json` beside this file, docs/proof/leader_board.md and
docs/proof/measured/leader_board.md; --page writes the pages from the file that is there, --quick is the smoke
run and writes nothing.

An error is the largest difference to the reference over all outputs.  A "warm" call is one of
several in a row, a "cold" one the first after all others had their turn.  Setting up, fitting and
making machine code are apart: `prepare` and the first call.
"""

from __future__ import annotations

import argparse
import os

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")  # before NumPy comes
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")

import json
import math
import time
import warnings
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import crowds
import harness
import homes
import numpy as np
import rivals
from board_page import TARGETS, quickest, write_pages
from races import RACES, Race
from rivals import Entry, Run

KEPT = Path(__file__).with_suffix(".json")
ROUNDS = 9
LONG = 0.1
"""Seconds: longer calls are made three times, those of more than ten times this once."""


FINER = 4
"""Times that the interval between two settings is halved, for each target."""


@dataclass
class Curve:
    """A method of a race with all settings that were tried: what is kept, and how to call it."""

    entry: Entry
    points: dict[float, dict[str, Any]] = field(default_factory=dict)
    runs: dict[float, Run] = field(default_factory=dict)
    failed: list[list[Any]] = field(default_factory=list)

    def attempt(self, setting: float, exact: np.ndarray) -> dict[str, Any] | None:
        """Set up and called once: error, and seconds of setting up and of the first call; None if the package gives up."""
        entry = self.entry
        try:
            with warnings.catch_warnings(action="ignore"):
                begun = time.perf_counter()
                run = entry.prepare(setting)
                ready = time.perf_counter()
                raw = run()
                done = time.perf_counter()
                error = float(np.abs(entry.outputs(raw) - exact).max())
                spent = _timed(run)[1]  # the first call may have made machine code
        except Exception as failure:  # of whatever kind
            why = str(failure).splitlines()[0][:200] if str(failure) else type(failure).__name__
            self.failed.append([setting, why])
            return None
        if not math.isfinite(error):
            self.failed.append([setting, "not finite"])
            return None
        point = {"setting": setting, "error": error, "set_up": ready - begun, "first": done - ready}
        self.points[setting] = {**point, "spent": spent, "warm": [], "cold": []}
        self.runs[setting] = run
        return self.points[setting]

    def quickest(self, target: float) -> float:
        """Seconds of the quickest setting so far that reaches an error."""
        reached = (p["spent"] for p in self.points.values() if p["error"] <= target)
        return min(reached, default=math.inf)

    def refine(self, target: float, exact: np.ndarray) -> None:
        """Look between the two settings around an error for the loosest one that reaches it: a
        number of steps is a whole number, a tolerance any.
        """
        settings = self.entry.settings
        tried = [s for s in settings if s in self.points]
        errors = [self.points[s]["error"] for s in tried]
        for k in range(len(tried) - 1):
            if errors[k] > target >= errors[k + 1]:
                break
        else:
            return
        loose, tight = tried[k : k + 2]
        for _ in range(FINER):
            between = (loose + tight) // 2 if self.entry.counted else math.sqrt(loose * tight)
            if between in (loose, tight):
                return
            known = self.points.get(between) or self.attempt(between, exact)
            if known and known["error"] <= target:
                tight = between
            else:
                loose = between

    def kept(self) -> dict[str, Any]:
        """For the file, settings in the order of their errors."""
        entry = self.entry
        points = sorted(self.points.values(), key=lambda point: -point["error"])
        return {
            "package": entry.package, "method": entry.method, "closed": entry.closed, "fast": entry.fast,
            "points": points, "failed": self.failed,
        }  # fmt: skip


def first_calls(race: Race, everybody: list[Entry], patience: float, finer: bool) -> list[Curve]:
    """Every method called once with each of its settings, and those that are anywhere near the
    quickest at a target with settings in between.
    """
    exact, curves = race.exact, [Curve(entry) for entry in everybody]
    for curve in curves:
        fine = 0
        for setting in curve.entry.settings:
            point = curve.attempt(setting, exact)
            if point is None:
                continue
            fine += point["error"] < 1e-13
            if point["spent"] > patience or fine > 1:
                break
    for target in TARGETS if finer else ():
        for closed in (False, True):
            rivals = [curve for curve in curves if curve.entry.closed == closed]
            least = min((curve.quickest(target) for curve in rivals), default=math.inf)
            for curve in rivals:
                if curve.quickest(target) <= 4.0 * least < math.inf:
                    curve.refine(target, exact)
    return curves


def _timed(run: Run, times: int = 1) -> tuple[Any, float]:
    """What the last of so many calls gives, and the seconds of one."""
    begun = time.perf_counter()
    for _ in range(times):
        raw = run()
    return raw, (time.perf_counter() - begun) / times


def measure(race: Race, everybody: list[Entry], rounds: int, seconds: float) -> list[dict[str, Any]]:
    """All methods of a race, in turn: medians and quartiles of warm and of cold calls."""
    begun = time.perf_counter()
    curves = first_calls(race, everybody, 0.2 if rounds == 1 else 1.0, rounds > 1)
    everything = [(curve.points[s], run) for curve in curves for s, run in curve.runs.items()]
    for k in range(rounds):
        if k > 2 and time.perf_counter() - begun > seconds:
            break
        for point, run in everything:
            known = point["spent"]
            if (k > 2 and known > LONG) or (k > 0 and known > 10 * LONG):
                continue
            with warnings.catch_warnings(action="ignore"):
                point["cold"].append(_timed(run)[1])
                point["warm"].append(_timed(run, max(1, min(20, int(2e-3 / point["cold"][-1]))))[1])
    for point, _ in everything:
        del point["spent"]
        for kind in ("warm", "cold"):
            low, middle, high = np.quantile(point.pop(kind), [0.25, 0.5, 0.75]).tolist()
            point |= {kind: middle, f"{kind} quartiles": [low, high]}
    print(f"{race.name}: {time.perf_counter() - begun:.0f} s", flush=True)
    return [curve.kept() for curve in curves]


def keep(kept: dict[str, Any]) -> None:
    """Write the file, one method a line."""
    kept["machine"] = harness.machine()
    kept["races"] = {race.key: kept["races"][race.key] for race in RACES if race.key in kept["races"]}
    text = json.dumps(kept, separators=(",", ":")).replace('{"package"', '\n{"package"')
    KEPT.write_text(text + "\n", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--quick", action="store_true", help="smoke run: two races, every third method, two settings, once"
    )
    parser.add_argument("--minutes", type=float, default=10.0, help="for the rounds; setting up takes what it takes")
    parser.add_argument("--only", nargs="*", help="races by key, or `crowds`; the others stay as they were measured")
    parser.add_argument("--page", action="store_true", help="write the pages only")
    chosen = parser.parse_args()
    if chosen.page:
        write_pages(json.loads(KEPT.read_text(encoding="utf-8")))
        return
    kept: dict[str, Any] = (
        json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() and chosen.only else {"races": {}}
    )
    races = [race for race in RACES if race.key in chosen.only] if chosen.only else list(RACES)
    if chosen.quick:
        races = [race for race in RACES if race.key in ("momentum", "driven")]
    versions: dict[str, str | None] = {}
    for race in races:
        others, versions = rivals.entries(race)
        everybody = [*homes.entries(race), *others]
        if chosen.quick:
            everybody = [replace(e, settings=e.settings[:2]) for e in everybody[1::3]]
        share = 60.0 * chosen.minutes / (len(RACES) + 2)
        curves = measure(race, everybody, 1 if chosen.quick else ROUNDS, share)
        here = harness.machine()["cpu"]
        kept["races"][race.key] = {"name": race.name, "curves": curves, "machine": here}
        rows = [
            [c["package"], c["method"], *[1e3 * t if (t := quickest(c["points"], e)) else None for e in TARGETS]]
            for c in curves
        ]
        harness.table(f"{race.name}: ms for an error of", ["package", "method", *[f"{e:.0e}" for e in TARGETS]], rows)
        if not chosen.quick:
            kept["versions"] = {**versions, "numbalsoda": rivals.version("numbalsoda")}
            keep(kept)
    if chosen.quick or not chosen.only or "crowds" in chosen.only:
        kept["crowds"] = crowds.measure(chosen.quick) | {"machine": harness.machine()["cpu"]}
    if not chosen.quick:
        keep(kept)
        write_pages(kept)


if __name__ == "__main__":
    main()
