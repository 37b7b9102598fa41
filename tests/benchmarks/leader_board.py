"""The leader board: for each problem and error this library's quickest method beside the quickest one of any other package.

    python tests/benchmarks/leader_board.py         # writes it, and the tables of docs/work_precision.md, from what was measured
"""

import json
from pathlib import Path

from work_precision import TARGETS, winners

HERE = Path(__file__).parent
PAGE = HERE.parent.parent / "docs" / "leader_board.md"
TABLES = PAGE.with_name("work_precision.md")
MARKS = "<!-- measured: tests/benchmarks/leader_board.py -->\n", "<!-- end -->"
OURS = ("liemech", "liemech, symplectic")
HEAD = """# Leader board

For each problem and each error the quickest method of this library, and the quickest one of any other package. The
ratio is our time over theirs: below one we are ahead. Times are of a whole call, as
[work and precision](work_precision.md) explains; that page has all packages and what each of them integrates.
Measured with {versions}.

`python tests/benchmarks/work_precision.py` measures, `python tests/benchmarks/leader_board.py` writes this page.

| problem | error | liemech, ms | best other package, ms | ratio | |
| --- | --- | --- | --- | --- | --- |
"""
TAIL = """
## What stands in the way

The call. Both we and heyoka are [prepared](prepared_runs.md) once, and a run is one call; of ours 0.03 to 0.05 ms is
Python around the native steps: what formulas have read is compared with what it is now, the arguments are checked, arrays are made
for the samples, and a run that knows its system is built around them. heyoka advances one object in place.
These are short runs. After a long time, where energy and Casimirs count, the order is
another one: [energy after a long time](work_precision.md#energy-after-a-long-time).
"""


def page(measured: dict) -> str:
    """The page, of what was measured."""
    text = HEAD.format(versions=", ".join(f"{name} {version}" for name, version in measured["versions"].items()))
    for problem, curves in measured["curves"].items():
        best = winners(curves, sorted({curve["package"] for curve in curves}))
        for target in TARGETS:
            ours = min((best[p][target] for p in OURS if best.get(p, {}).get(target)), default=None)
            others = [(cell[target][0], p) for p, cell in best.items() if p not in OURS and cell[target]]
            theirs = min(others, default=None)
            cells = [f"{1e3 * t[0]:.2g} ({t[1]})" if t else "not reached" for t in (ours, theirs)]
            ratio = f"{ours[0] / theirs[0]:.2g}" if ours and theirs else ""
            ahead = ours and (not theirs or ours[0] < theirs[0])
            text += f"| {problem} | {target:.0e} | {cells[0]} | {cells[1]} | {ratio} | {'🟢 ahead' if ahead else '🔴 behind'} |\n"
    return text.replace("e-0", "e-") + TAIL


def tables(measured: dict) -> str:
    """For each problem the quickest method of each package, in milliseconds."""
    text = ""
    for problem, curves in measured["curves"].items():
        best = winners(curves, list(dict.fromkeys(curve["package"] for curve in curves)))
        text += f"{problem[0].upper()}{problem[1:]}:\n\n| | {' | '.join(f'{target:.0e}' for target in TARGETS)} |\n"
        text += f"| --- |{' --- |' * len(TARGETS)}\n"
        for package, cell in best.items():
            times = [cell[target] and (float(f"{1e3 * cell[target][0]:.2g}"), cell[target][1]) for target in TARGETS]
            cells = [f"{time[0]:g} ({time[1]})" if time else "not reached" for time in times]
            text += f"| {package} | {' | '.join(cells)} |\n"
        text += "\n"
    versions = ", ".join(f"{name} {version}" for name, version in measured["versions"].items())
    return text.replace("e-0", "e-") + f"On {measured['machine']['cpu']}, {measured['machine']['time'][:10]}, with {versions}.\n"


if __name__ == "__main__":
    measured = json.loads((HERE / "work_precision.json").read_text(encoding="utf-8"))
    PAGE.write_text(page(measured), encoding="utf-8")
    before, _, rest = TABLES.read_text(encoding="utf-8").partition(MARKS[0])
    after = rest.partition(MARKS[1])[2]
    TABLES.write_text(before + MARKS[0] + tables(measured) + MARKS[1] + after, encoding="utf-8")
