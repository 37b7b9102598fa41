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
    "checks": (5_250, 31_000),
    "command_line": (1_790, 10_000),
    "compiler": (12_670, 74_250),
    "estimation": (1_920, 9_350),
    "formulas": (10_290, 53_300),
    "groups": (10_170, 54_950),
    "integrators": (5_140, 27_250),
    "joints": (7_420, 45_150),
    "models": (8_220, 48_200),
    "names": (310, 1_150),
    "plots": (2_350, 13_500),
    "rooms/at_work": (1_750, 8_900),
    "rooms/constraints": (2_930, 16_300),
    "rooms/derivatives": (4_240, 26_700),
    "rooms/fictive_time": (1_640, 8_150),
    "rooms/fields": (630, 3_550),
    "rooms/files": (1_430, 9_700),
    "rooms/hamilton_jacobi": (1_250, 6_450),
    "rooms/noise": (780, 3_050),
    "rooms/poisson": (1_800, 8_500),
    "rooms/published": (1_060, 6_650),
    "rooms/sites": (8_420, 47_650),
    "rooms/stability": (920, 5_550),
    "simulation": (9_560, 56_000),
    "systems": (4_470, 20_300),
    "tableaus": (2_460, 9_100),
    "viewer": (3_100, 16_050),
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
