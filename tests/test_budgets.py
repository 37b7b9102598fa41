"""How large each part of the library may be.  `python tests/test_budgets.py` prints the table.

A part grows only by raising its number here, in the commit that makes it grow, with a word why in the message;
where a part has become smaller, its number falls.
"""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

LIBRARY = Path(__file__).parent.parent / "liemech"

BUDGETS = {}
"""Lines and nodes of syntax, as `ast.walk` counts them, of each folder of the library; its loose files are `.`, and
the folders of simulation/ count apart.
"""

SPARE = 0.98
"""A budget of which less than this share is used is lowered."""


def part_of(file: Path) -> str:
    """The part of the library that a file belongs to."""
    folders = file.relative_to(LIBRARY).parent.parts
    return "/".join(folders[: 2 if folders[:1] == ("simulation",) else 1]) or "."


def sizes() -> dict[str, tuple[int, int]]:
    """Lines and nodes of syntax of each part."""
    totals: dict[str, tuple[int, int]] = {}
    for file in sorted(LIBRARY.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        lines, nodes = totals.get(part_of(file), (0, 0))
        syntax = sum(1 for _ in ast.walk(ast.parse(text)))
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
