"""`liemech reproduce`: published results, computed again."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..plots.style import require_matplotlib, save, subplots
from ..rooms.published import RESULTS
from ..rooms.published.compared import Reproduced, reproduced, title_of
from .options import Parser, picture


def reproduce(arguments: Sequence[str]) -> int:
    """The command.  Returns the exit status: 0, 1 if a published number was not reached."""
    parser = Parser(
        prog="liemech reproduce",
        description="Compute published results again, and print theirs beside ours; without a name, list them.",
        epilog="examples:\n  liemech reproduce iftomm-a02\n  liemech reproduce all --full\n"
        "  liemech reproduce bend-45 --picture bend.png",
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="of a result, or all")
    parser.add_argument("--full", action="store_true", help="with the rows that take minutes")
    parser.add_argument("--picture", type=picture, metavar="FILE", help="of one result: theirs and ours, by Matplotlib")
    options = parser.parse_args(arguments)
    if options.picture and (len(options.names) != 1 or options.names == ["all"]):
        parser.error(f"--picture draws one result, such as {next(iter(RESULTS))}")
    if options.picture:
        require_matplotlib()
    titles = {name: title_of(name) for name in (RESULTS if options.names in ([], ["all"]) else options.names)}
    hold = []
    for name, title in titles.items():
        print(f"{name + ':':<19}{title}", flush=True)
        if options.names:
            try:
                result = reproduced(name, options.full)
            except InvalidInput as missing:  # files that are not installed
                print(f"  {missing}\n")
                hold.append(False)
                continue
            print(result, end="\n\n")
            hold.append(result.holds)
        if options.picture:
            save(drawn(name, result).figure, options.picture)
    if len(hold) > 1:
        print(f"{sum(hold)} of {len(hold)} reproduced", file=sys.stderr)
    return 0 if all(hold) else 1


def drawn(name: str, result: Reproduced) -> Any:
    """Axes with the distance of each number from the published one, beside what it may be, which is 1."""
    rows = result.rows[::-1]
    _, ax = subplots(figsize=(6.4, 1.2 + 0.22 * len(rows)))
    places = np.arange(len(rows))
    ax.plot([max(row.part, np.finfo(float).eps) for row in rows], places, "o", label="ours")
    ax.axvline(1.0, color="0.4", label="published")
    ax.set(xscale="log", xlabel="difference beside what the source allows", title=name)
    ax.set_yticks(places, [row.quantity for row in rows], fontsize=8)
    ax.legend(frameon=False, fontsize=8)
    return ax
