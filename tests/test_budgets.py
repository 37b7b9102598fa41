"""How large each part of the library may be.  `python tests/test_budgets.py` prints the table.

A part grows only by raising its number here, in the commit that makes it grow, with a word why in the message;
where a part has become smaller, its number falls.
"""

from __future__ import annotations

import functools
from pathlib import Path

import pytest
from sources import PACKAGE, files, nodes, texts

BUDGETS = {
    ".": (790, 3_400),
    "checks": (5_190, 30_500),
    "command_line": (1_760, 9_800),
    "compiler": (12_560, 73_650),
    "estimation": (1_920, 9_350),
    "formulas": (10_240, 53_000),
    "groups": (10_120, 54_300),
    "integrators": (5_110, 26_800),
    "joints": (7_330, 44_650),
    "models": (8_180, 48_550),
    "names": (310, 1_120),
    "plots": (2_310, 13_300),
    "rooms/at_work": (1_770, 9_100),
    "rooms/constraints": (2_950, 16_300),
    "rooms/derivatives": (3_860, 23_750),
    "rooms/fictive_time": (1_660, 8_200),
    "rooms/files": (1_420, 9_600),
    "rooms/hamilton_jacobi": (1_270, 6_450),
    "rooms/noise": (800, 3_100),
    "rooms/poisson": (1_800, 8_400),
    "rooms/published": (330, 1_950),
    "rooms/sites": (8_290, 46_850),
    "rooms/stability": (720, 4_300),
    "simulation": (9_210, 53_700),
    "systems": (4_500, 20_300),
    "tableaus": (2_460, 9_100),
    "viewer": (3_100, 16_000),
}
"""Lines and nodes of syntax, those of `ast.walk` but Load and Store, of each layer of the core and each room; the loose
files of the library are `.`.
"""

SPARE = 0.9
"""A budget of which less than this share is used is lowered."""


def part_of(file: Path) -> str:
    """The layer of the core, or the room, that a file belongs to."""
    folders = file.relative_to(PACKAGE).parent.parts
    room = "/".join(folders[: 2 if folders[:1] == ("rooms",) else 1])
    return room if room not in ("", "rooms") else "."


@functools.cache
def sizes() -> dict[str, tuple[int, int]]:
    """Lines and nodes of syntax of each part."""
    totals: dict[str, tuple[int, int]] = {}
    for module, file in files().items():
        lines, syntax = totals.get(part_of(file), (0, 0))
        totals[part_of(file)] = lines + texts()[module].count("\n"), syntax + len(nodes()[module])
    return totals


def test_every_part_has_a_budget() -> None:
    assert set(sizes()) == set(BUDGETS)


@pytest.mark.parametrize("part", BUDGETS)
def test_no_part_outgrows_its_budget(part: str) -> None:
    for size, budget, unit in zip(sizes()[part], BUDGETS[part], ("lines", "nodes of syntax"), strict=True):
        assert size <= budget, f"liemech/{part} has {size} {unit}: make it smaller, or raise its {budget} in {__file__}"
        assert size >= SPARE * budget, f"liemech/{part} has only {size} {unit}: lower its {budget} in {__file__}"


if __name__ == "__main__":
    measured = sizes()
    for part, (lines, syntax) in measured.items():
        print(f"{part:30}{lines:8,} lines{syntax:10,} nodes of {BUDGETS.get(part, '?')}")
    print(f"{'all':30}{sum(x for x, _ in measured.values()):8,} lines{sum(x for _, x in measured.values()):10,} nodes")
