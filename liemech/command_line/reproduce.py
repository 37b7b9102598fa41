"""`liemech reproduce`: published results, computed again."""

from __future__ import annotations

import sys
from argparse import RawDescriptionHelpFormatter
from collections.abc import Sequence

from ..errors import InvalidInput
from ..rooms.published import RESULTS
from ..rooms.published.compared import reproduced, title_of
from .options import Parser


def reproduce(arguments: Sequence[str]) -> int:
    """The command.  Returns the exit status: 0, 1 if a published number was not reached."""
    parser = Parser(
        prog="liemech reproduce",
        description="Compute published results again, and print theirs beside ours; without a name, list them.",
        epilog="examples:\n  liemech reproduce iftomm-a02\n  liemech reproduce all --full",
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="of a result, or all")
    parser.add_argument("--full", action="store_true", help="with the rows that take minutes")
    options = parser.parse_args(arguments)
    try:
        titles = {name: title_of(name) for name in (RESULTS if options.names in ([], ["all"]) else options.names)}
    except InvalidInput as wrong:
        parser.error(str(wrong))
    hold = []
    for name, title in titles.items():
        print(f"{name + ':':<14}{title}", flush=True)
        if options.names:
            result = reproduced(name, options.full)
            print(result, end="\n\n")
            hold.append(result.holds)
    if len(hold) > 1:
        print(f"{sum(hold)} of {len(hold)} reproduced", file=sys.stderr)
    return 0 if all(hold) else 1
