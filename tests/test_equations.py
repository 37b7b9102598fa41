"""The table of equations is true: what it names is there, and so are the tests that hold it."""

from __future__ import annotations

import re
from pathlib import Path

import liemech as lm

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "equations.md").read_text(encoding="utf-8")
FOLDERS = {"Constrained systems": "constrained", "Poisson systems": "poisson", "Time": "timing"}


def test_every_equation_names_a_test_that_is_there() -> None:
    for head, folder in FOLDERS.items():
        section = PAGE.partition(f"## {head}\n")[2].partition("\n## ")[0]
        code = "".join(
            path.read_text(encoding="utf-8")
            for path in sorted((ROOT / "tests" / folder).glob("test_*.py"))
        )
        rows = [
            row
            for row in section.splitlines()
            if row.startswith("| ") and not row.startswith(("| equation", "| ---"))
        ]
        assert len(rows) > 10
        for row in rows:
            names = re.findall(r"`(test_\w+)`", row.split("|")[4])
            assert names, f"no test: {row}"
            for name in names:
                assert f"def {name}(" in code, f"{name} is not in tests/{folder}"


def test_no_equation_is_left_out() -> None:
    named = {(int(a), int(b)) for a, b in re.findall(r"\((\d)\.(\d+)\)", PAGE)}
    assert {(1, k) for k in range(1, 17)} | {(2, k) for k in range(1, 19)} | {
        (3, k) for k in range(1, 10)
    } <= named


def test_classes_and_functions_of_the_table_are_there() -> None:
    for row in PAGE.splitlines():
        cells = row.split("|")
        if len(cells) > 4 and "`" in cells[3]:
            for name in re.findall(r"`([A-Z]\w+)(?:\.(\w+))?`", cells[3]):
                thing = getattr(lm, name[0])
                assert not name[1] or name[1] in dir(thing), name
