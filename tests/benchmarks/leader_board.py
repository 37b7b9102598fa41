"""The leader board: time against error, this library beside all other packages that are installed,
on ten problems and ensembles.

    python tests/benchmarks/leader_board.py [--minutes 10] [--only top kepler] [--quick] [--page]

It measures, writes `leader_board.json` beside this file, docs/leader_board.md and the tables of
docs/work_precision.md; --page writes the pages from the file that is there, --quick is the smoke
run and writes nothing.

An error is the largest difference to the reference over all outputs.  A "warm" call is one of
several in a row, a "cold" one the first after all others had their turn.  Setting up, fitting and
making machine code are apart: `prepare` and the first call.
"""

from __future__ import annotations

import argparse
import os

os.environ |= dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
)  # before NumPy comes
os.environ.setdefault(
    "XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
)

import json
import math
import time
import warnings
from pathlib import Path
from typing import Any

import crowds
import harness
import homes
import numpy as np
import rivals
from board_page import TARGETS, time_for, write_pages
from races import RACES, Race
from rivals import Entry, Run

KEPT = Path(__file__).with_suffix(".json")
ROUNDS = 9
LONG = 0.1
"""Seconds: longer calls are made three times, those of more than ten times this once."""


def first_calls(
    race: Race, everybody: list[Entry], patience: float
) -> list[tuple[dict[str, Any], list[tuple[dict[str, Any], Run]]]]:
    """Every method set up and called once with each of its settings: error, and seconds of setting
    up and of the first call.
    """
    exact, found = race.exact, []
    for entry in everybody:
        curve = {
            "package": entry.package,
            "method": entry.method,
            "closed": entry.closed,
            "points": [],
            "failed": [],
        }
        runs: list[tuple[dict[str, Any], Run]] = []
        fine = 0
        for setting in entry.settings:
            try:
                with warnings.catch_warnings(action="ignore"):
                    begun = time.perf_counter()
                    run = entry.prepare(setting)
                    ready = time.perf_counter()
                    raw = run()
                    done = time.perf_counter()
                    spent = _timed(run)[1]  # the first call may have made machine code
                error = float(np.abs(entry.outputs(raw) - exact).max())
            except Exception as failure:  # of whatever kind: the package gives up at this setting
                curve["failed"].append(
                    [
                        setting,
                        str(failure).splitlines()[0][:200]
                        if str(failure)
                        else type(failure).__name__,
                    ]
                )
                continue
            if not math.isfinite(error):
                curve["failed"].append([setting, "not finite"])
                continue
            point = {
                "setting": setting,
                "error": error,
                "set_up": ready - begun,
                "first": done - ready,
                "warm": [],
                "cold": [],
            }
            curve["points"].append(point)
            runs.append((point, run))
            fine += error < 1e-13
            if spent > patience or fine > 1:
                break
        found.append((curve, runs))
    return found


def _timed(run: Run, times: int = 1) -> tuple[Any, float]:
    """What the last of so many calls gives, and the seconds of one."""
    begun = time.perf_counter()
    for _ in range(times):
        raw = run()
    return raw, (time.perf_counter() - begun) / times


def measure(
    race: Race, everybody: list[Entry], rounds: int, seconds: float
) -> list[dict[str, Any]]:
    """All methods of a race, in turn: medians and quartiles of warm and of cold calls."""
    begun = time.perf_counter()
    found = first_calls(race, everybody, 0.2 if rounds == 1 else 3.0)
    everything = [pair for _, runs in found for pair in runs]
    for k in range(rounds):
        if k > 2 and time.perf_counter() - begun > seconds:
            break
        for point, run in everything:
            known = point["cold"][0] if point["cold"] else point["first"]
            if (k > 2 and known > LONG) or (k > 0 and known > 10 * LONG):
                continue
            with warnings.catch_warnings(action="ignore"):
                point["cold"].append(_timed(run)[1])
                point["warm"].append(_timed(run, max(1, min(20, int(2e-3 / point["cold"][-1]))))[1])
    for point, _ in everything:
        for kind in ("warm", "cold"):
            low, middle, high = np.quantile(point.pop(kind), [0.25, 0.5, 0.75]).tolist()
            point |= {kind: middle, f"{kind} quartiles": [low, high]}
    print(f"{race.name}: {time.perf_counter() - begun:.0f} s", flush=True)
    return [curve for curve, _ in found]


def keep(kept: dict[str, Any]) -> None:
    """Write the file, one method a line."""
    kept["machine"] = harness.machine()
    kept["races"] = {
        race.key: kept["races"][race.key] for race in RACES if race.key in kept["races"]
    }
    text = json.dumps(kept, separators=(",", ":")).replace('{"package"', '\n{"package"')
    KEPT.write_text(text + "\n", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="smoke run: two races, every third method, two settings, once",
    )
    parser.add_argument(
        "--minutes", type=float, default=10.0, help="for the rounds; setting up takes what it takes"
    )
    parser.add_argument(
        "--only", nargs="*", help="races by key, or `crowds`; the others stay as they were measured"
    )
    parser.add_argument("--page", action="store_true", help="write the pages only")
    chosen = parser.parse_args()
    if chosen.page:
        write_pages(json.loads(KEPT.read_text(encoding="utf-8")))
        return
    kept: dict[str, Any] = (
        json.loads(KEPT.read_text(encoding="utf-8"))
        if KEPT.exists() and chosen.only
        else {"races": {}}
    )
    races = [race for race in RACES if race.key in chosen.only] if chosen.only else list(RACES)
    if chosen.quick:
        races = [race for race in RACES if race.key in ("momentum", "driven")]
    versions: dict[str, str | None] = {}
    for race in races:
        others, versions = rivals.entries(race)
        everybody = [*homes.entries(race), *others]
        if chosen.quick:
            everybody = [
                Entry(e.package, e.method, e.settings[:2], e.prepare, e.outputs, e.closed)
                for e in everybody[1::3]
            ]
        share = 60.0 * chosen.minutes / (len(RACES) + 2)
        curves = measure(race, everybody, 1 if chosen.quick else ROUNDS, share)
        here = harness.machine()["cpu"]
        kept["races"][race.key] = {"name": race.name, "curves": curves, "machine": here}
        rows = [
            [
                c["package"],
                c["method"],
                *[1e3 * t if (t := time_for(c["points"], e)) else None for e in TARGETS],
            ]
            for c in curves
        ]
        harness.table(
            f"{race.name}: ms for an error of",
            ["package", "method", *[f"{e:.0e}" for e in TARGETS]],
            rows,
        )
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
