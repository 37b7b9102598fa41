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
    ".": (790, 3_450),
    "checks": (5_310, 31_500),
    "command_line": (1_760, 9_950),
    "compiler": (12_570, 73_950),
    "estimation": (1_900, 9_350),
    "formulas": (10_300, 53_650),
    "groups": (10_170, 55_100),
    "integrators": (5_120, 27_200),
    "joints": (8_180, 50_150),
    "models": (8_190, 48_100),
    "names": (310, 1_150),
    "plots": (2_350, 13_500),
    "rooms/at_work": (1_740, 8_950),
    "rooms/constraints": (2_930, 16_250),
    "rooms/derivatives": (4_310, 27_350),
    "rooms/fictive_time": (1_630, 8_150),
    "rooms/fields": (630, 3_550),
    "rooms/files": (1_420, 9_700),
    "rooms/hamilton_jacobi": (1_250, 6_450),
    "rooms/noise": (770, 3_000),
    "rooms/poisson": (1_790, 8_500),
    "rooms/published": (1_060, 6_650),
    "rooms/sites": (8_410, 47_650),
    "rooms/stability": (920, 5_550),
    "simulation": (9_540, 56_000),
    "systems": (4_460, 20_250),
    "tableaus": (2_200, 8_900),
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
