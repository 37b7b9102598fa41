"""How large each part of the library may be.  `python tests/test_budgets.py` prints the table.

A part grows only by raising its number here, in the commit that makes it grow, with a word why in the message;
where a part has become smaller, its number falls.
"""

from __future__ import annotations

import ast
import functools
from pathlib import Path

import pytest

LIBRARY = Path(__file__).parent.parent / "liemech"

BUDGETS = {
    ".": (1_160, 4_600),
    "checks": (5_220, 30_400),
    "command_line": (1_740, 9_600),
    "compiler": (12_380, 72_400),
    "estimation": (1_920, 9_200),
    "formulas": (9_840, 50_400),
    "groups": (9_940, 53_600),
    "integrators": (12_400, 71_600),
    "models": (12_700, 75_000),
    "plots": (2_300, 13_000),
    "simulation": (6_180, 35_200),
    "simulation/at_work": (1_720, 9_000),
    "simulation/between": (1_140, 7_800),
    "simulation/compiled": (1_580, 8_400),
    "simulation/derivatives": (3_560, 23_400),
    "simulation/fictive_time": (460, 3_000),
    "simulation/files": (1_300, 8_600),
    "simulation/reports": (500, 2_800),
    "simulation/sites": (3_720, 21_800),
    "systems": (12_500, 61_400),
    "tableaus": (2_500, 9_200),
    "viewer": (3_080, 15_800),
}
"""Lines and nodes of syntax, those of `ast.walk` but Load and Store, of each folder of the library; its loose files
are `.`, and the folders of simulation/ count apart.
"""

SPARE = 0.9
"""A budget of which less than this share is used is lowered."""


def part_of(file: Path) -> str:
    """The part of the library that a file belongs to."""
    folders = file.relative_to(LIBRARY).parent.parts
    return "/".join(folders[: 2 if folders[:1] == ("simulation",) else 1]) or "."


@functools.cache
def sizes() -> dict[str, tuple[int, int]]:
    """Lines and nodes of syntax of each part."""
    totals: dict[str, tuple[int, int]] = {}
    for file in sorted(LIBRARY.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        lines, nodes = totals.get(part_of(file), (0, 0))
        syntax = sum(not isinstance(node, ast.expr_context) for node in ast.walk(ast.parse(text)))
        totals[part_of(file)] = lines + text.count("\n"), nodes + syntax
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
    for part, (lines, nodes) in measured.items():
        print(f"{part:30}{lines:8,} lines{nodes:10,} nodes of {BUDGETS.get(part, '?')}")
    print(f"{'all':30}{sum(x for x, _ in measured.values()):8,} lines{sum(x for _, x in measured.values()):10,} nodes")
