"""Stress: the 28 goals of reliability measured, hard scenes, and errors over time.

    python tests/stress/run.py [--quick] [--write] [--steps 1000000] [--calls 10000] [--only R5]
    [--scenes] [--minutes N]

--write puts the tables into docs/proof/reliability.md, with --only or --scenes these rows alone, and draws
docs/figures/error_over_time.png.  --quick takes smaller sizes and a
minute or two.  It fails if a goal is missed that the page says is met, or if a hard scene ends in
NaN or a bare error.

--minutes N is a full run: from half an hour on 10^5 random calls and 10^6 steps; what is left of
the time goes to runs of 10^8 steps of every family and of other packages (`long_runs.py`).
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import subprocess
import sys
import time
from pathlib import Path

TESTS = Path(__file__).parent.parent
sys.path[:0] = [str(TESTS), *(str(TESTS / folder) for folder in ("benchmarks", "calls", "groups", "simulation"))]
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import goals  # noqa: E402
import hard_scenes  # noqa: E402
import over_time  # noqa: E402

PAGE = TESTS.parent / "docs" / "proof" / "reliability.md"
FIGURE = TESTS.parent / "docs" / "figures" / "error_over_time.png"
HEADS = {
    "goals": "| | wanted | measured | | where |\n| --- | --- | --- | --- | --- |",
    "scenes": "| scene | runs | kept to rounding | refused by name | NaN, bare errors, lost structure | largest change |"
    "\n| --- | --- | --- | --- | --- | --- |",
    "back": "| 100 steps | 1000 | 10,000 | long mode: 100 | 1000 | 10,000 |\n| --- | --- | --- | --- | --- | --- |",
}


def between(name: str, text: str, page: str) -> str:
    """The page with this text between the markers of that name."""
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    first, last = page.index(begin) + len(begin), page.index(end)
    return f"{page[:first]}\n\n{text}\n\n{page[last:]}"


def verdicts(text: str) -> dict[str, bool]:
    """The goals of a table: whether each is met; those that are not measured are left out."""
    rows = re.findall(r"^\| (R\d+) .* \| (met[\w ]*|\*\*missed\*\*) \|", text, flags=re.MULTILINE)
    return {name: how != "**missed**" for name, how in rows}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="smaller sizes")
    parser.add_argument("--write", action="store_true", help="write the page and draw the figure")
    parser.add_argument("--steps", type=int, default=10**6, help="of a long run")
    parser.add_argument("--calls", type=int, default=10**4, help="random calls of public functions")
    parser.add_argument("--only", nargs="*", help="goals by name, without scenes")
    parser.add_argument("--scenes", action="store_true", help="the hard scenes alone")
    parser.add_argument("--minutes", type=float, help="the full size, as far as this time goes")
    chosen = parser.parse_args()
    if chosen.minutes:
        chosen.steps, chosen.calls = (10**6, 10**5) if chosen.minutes >= 30 else (300_000, 10**4)
    begun = time.perf_counter()
    size = goals.Size(True, 20_000, 500) if chosen.quick else goals.Size(False, chosen.steps, chosen.calls)
    wanted = goals.GOALS if chosen.only is None else chosen.only
    rows = [
        goals.row(goal, size) for goal in goals.GOALS if not chosen.scenes and (goal in wanted or goal.name in wanted)
    ]
    table = "\n".join((HEADS["goals"], *rows))
    now, page = verdicts(table), PAGE.read_text(encoding="utf-8")
    worse = [name for name, met in verdicts(page).items() if met and not now.get(name, True)]
    bad = []
    if chosen.only is None:
        scenes = [hard_scenes.row(scene, size) for scene in hard_scenes.SCENES]
        bad = [line for line in scenes if line.split(" | ")[4] != "0"]
        listed = "\n".join((HEADS["scenes"], *scenes))
        if chosen.scenes and chosen.write:
            PAGE.write_text(between("scenes", listed, PAGE.read_text(encoding="utf-8")))
    if chosen.only is None and not chosen.scenes:
        back = hard_scenes.there_and_back(size)
        if chosen.write:
            sizes = f"Runs of {size.steps:,} steps, {size.calls:,} random calls, {os.cpu_count()} cores of {platform.machine()}."
            page = PAGE.read_text(encoding="utf-8")  # which may have changed since
            page = between("sizes", sizes, between("goals", table, page))
            page = between("scenes", listed, page)
            page = between("back", "\n".join((HEADS["back"], back)), page)
            PAGE.write_text(page, encoding="utf-8")
            over_time.draw(FIGURE, size)
        if chosen.minutes:
            left = max(1.0, chosen.minutes - (time.perf_counter() - begun) / 60.0)
            command = [sys.executable, str(Path(__file__).with_name("long_runs.py")), "--minutes", f"{left:g}"]
            subprocess.run(command, check=True)
    elif chosen.write:
        page = PAGE.read_text(encoding="utf-8")
        for line in rows:
            page = re.sub(rf"^\{line.split(' | ')[0]} \|.*$", lambda _, new=line: new, page, flags=re.MULTILINE)
        PAGE.write_text(page, encoding="utf-8")
    missed = [name for name, met in now.items() if not met]
    print(
        f"{sum(now.values())} of {len(goals.GOALS)} goals met; missed: {missed}; worse than the "
        f"page: {worse}; scenes: {bad}"
    )
    return 1 if worse or bad else 0


if __name__ == "__main__":
    sys.exit(main())
