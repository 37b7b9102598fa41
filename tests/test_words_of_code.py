"""Words of private code, counted: numbers that only fall.  `python tests/test_words_of_code.py` prints them, module by module."""

from __future__ import annotations

import ast
import functools
from collections import Counter, defaultdict

import pytest
from sources import nodes

PRONOUNS = {
    *("found", "given", "made", "one", "own", "some", "more", "here", "there", "way", "told", "asked", "seen", "known"),
    *("begun", "rest", "kept", "mine", "theirs", "ours", "those", "wanted", "many", "few", "alike", "gone", "said"),
}
"""Names that say nothing of what they hold."""

FORMULA = {*"=^_*(/<|"}
"""Signs of formulas, which say all in few words."""

MOST = {
    "assignments to pronouns": 98,
    "docstrings under five words": 0,
    "functions called `of`": 24,
    "class names that two files share": 2,
}
"""How many there may be; who makes one of these fewer lowers its number."""

SPARE = 0.9


@functools.cache
def counted() -> dict[str, Counter[str]]:
    """How often each occurs, by module; of class names by name."""
    found: dict[str, Counter[str]] = {what: Counter() for what in MOST}
    homes = defaultdict(set)
    for module in nodes():
        for node in nodes()[module]:
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                found["assignments to pronouns"][module] += node.id in PRONOUNS
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (
                text := ast.get_docstring(node, clean=False)
            ):
                found["docstrings under five words"][module] += len(text.split()) < 5 and not set(text) & FORMULA
            if isinstance(node, ast.FunctionDef):
                found["functions called `of`"][module] += node.name == "of"
            if isinstance(node, ast.ClassDef):
                homes[node.name].add(module)
    found["class names that two files share"].update({name: 1 for name, files in homes.items() if len(files) > 1})
    return found


@pytest.mark.parametrize("what", MOST)
def test_words_that_say_nothing_become_fewer(what: str) -> None:
    by_module, most = counted()[what], MOST[what]
    worst = ", ".join(f"{name} ({n})" for name, n in by_module.most_common(8))
    assert by_module.total() <= most, f"{by_module.total()} {what}, and {most} are allowed. The most are in {worst}"
    assert by_module.total() >= SPARE * most, f"only {by_module.total()} {what}: lower the {most} of MOST"


if __name__ == "__main__":
    for what, by_module in counted().items():
        print(f"{by_module.total()} {what}, of {MOST[what]}")
        print("".join(f"    {n:4} {name}\n" for name, n in by_module.most_common(20) if n))
