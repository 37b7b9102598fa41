"""The page of all public names, from the stubs that list them: `python docs/site/names.py` writes
it.  A name is explained on the page that is most about it, where a table or the text first has it.
"""

from __future__ import annotations

import ast
import functools
import inspect
import itertools
import re
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent.parent
sys.path[:0] = [str(DOCS.parent), str(DOCS / "site")]

import typeset  # noqa: E402
from contents import groups  # noqa: E402

from liemech.formulas.classes import annotations  # noqa: E402
from liemech.names import everything, public, sentence  # noqa: E402

APART = ("errors", "formulas", "neighbours", "plots", "tableaus", "viewer")
"""Modules with a page, or a tree, of their own."""

PASSED_OVER = ("Proof",)
"""Headings of the first page under which nothing is explained."""

WORDS = ("equations", "gallery", "glossary")
"""Pages that mention what others explain."""

EVERYWHERE = {
    "chain": "joints",
    "check_system": "your_own_system",
    "coadjoint": "groups",
    "CovariantVariational": "algorithm_1",
    "GalerkinVariational": "algorithm_1",
    "HamiltonianSystem": "hamilton_jacobi",
    "integrate": "options",
    "Kepler": "symplectic_methods",
    "MoserVeselov": "algorithm_1",
    "record": "your_own_system",
    "Retraction": "your_own_group",
    "RigidBody": "tutorial",
    "RKMK": "tableaus",
}
"""Names that many pages use, and the page about each."""

INTRODUCTION = """# Names

The public names, from A to Z: what each is, and where it is explained. `lm` is the library,
`import liemech as lm`. At its top are what runs and checks, the base classes, groups, systems and
methods. What is ready to be used with them is in modules by its kind, such as `lm.models` and
`lm.joints`. A name that is asked for in another place gives an error that says where it is. Six
modules have names of their own, which are not in this list: [lm.plots](plots.md),
[lm.viewer](viewer.md), [lm.tableaus](tableaus.md), [lm.formulas](native.md), such as
`lm.formulas.cos`, and `lm.errors`, whose docstring draws the tree.

| name | what it is | more |
| --- | --- | --- |
"""


def page() -> str:
    """The text of the page."""
    things = everything()
    names = [n for n, full in public().items() if full.split(".")[1] not in APART]
    rows = [
        f"| `{public()[name]}` | {about(name, things[name])} | {link(name)} |"
        for name in sorted(names, key=str.lower)
    ]
    return INTRODUCTION + "\n".join(rows) + "\n"


def about(name: str, thing: Any) -> str:
    """A sentence about a public name, fit for a cell of a table."""
    documented = inspect.isclass(thing) or inspect.isroutine(thing) or inspect.ismodule(thing)
    text = sentence(thing) if documented else constants()[name]
    plain = re.sub(r"`[^`]*`", lambda code: "\u2026" * len(code[0]), text)
    for first, last in reversed(typeset.inside(plain)):
        text = f"{text[:first]}`{text[first:last]}`{text[last:]}"
    # what a forge would take for a mark of its own
    text = re.sub(r"(`[^`]*`)|([|*_<])", lambda m: m[1] or "\\" + m[2], text)
    return re.sub(r"`[^`]*`", lambda code: code[0].replace("|", r"\|"), text)


@functools.cache
def constants() -> dict[str, str]:
    """The sentences under the names of annotations that are no classes."""
    tree = ast.parse(inspect.getsource(annotations)).body
    return {
        one.target.id: inspect.cleandoc(ast.literal_eval(after.value))
        .partition(". ")[0]
        .rstrip(".")
        for one, after in itertools.pairwise(tree)
        if isinstance(one, ast.AnnAssign)
        and isinstance(one.target, ast.Name)
        and isinstance(after, ast.Expr)
    }


@functools.cache
def texts() -> dict[str, str]:
    """The pages that explain, in the order of reading."""
    listed = groups((DOCS / "index.md").read_text(encoding="utf-8"))
    pages = [p for heading, ps in listed.items() if heading not in PASSED_OVER for p in ps]
    pages = [p for p in pages if p not in (*WORDS, "names") and not p.startswith("generated/")]
    return {p: (DOCS / f"{p}.md").read_text(encoding="utf-8") for p in pages}


def link(name: str) -> str:
    """Where a name is explained, as a link to a section."""
    page = EVERYWHERE.get(name) or max(texts(), key=lambda page: weight(name, page))
    place = re.search(rf"^\| `{name}\b", texts()[page], flags=re.MULTILINE)
    before = texts()[page][: place.start() if place else min(mentions(page)[name], default=0)]
    if not before:
        raise LookupError(f"{name} is on no page that explains; write a line about it")
    before = re.sub(r"```.*?(```|$)", "", before, flags=re.DOTALL)
    title, *sections = re.findall(r"^#+ (.+)$", before, flags=re.MULTILINE)
    anchor = re.sub(r"[^\w -]", "", sections[-1].lower()).replace(" ", "-") if sections else ""
    return f"[{title}]({page}.md{'#' if anchor else ''}{anchor})"


def weight(name: str, page: str) -> float:
    """How much a page is about a name: it is in the title, begins rows of tables, stands in the text
    or is used in programs.
    """
    if not mentions(page)[name]:
        return 0.0
    title = bool(re.match(rf"# .*\b{name}\b", texts()[page]))
    row = bool(re.search(rf"^\| `{name}\b", texts()[page], flags=re.MULTILINE))
    return 100 * title + 10 * row + sum(mentions(page)[name].values())


@functools.cache
def mentions(page: str) -> dict[str, dict[int, float]]:
    """The places of each word in the code of a page, and what each counts."""
    places: dict[str, dict[int, float]] = defaultdict(dict)
    for block in re.finditer(r"```.*?```|`[^`\n]+`", texts()[page], flags=re.DOTALL):
        counts = 0.5 if block[0].startswith("```") else 1.0
        for word in re.finditer(r"\w+\b(?!=)", block[0]):
            places[word[0]][block.start() + word.start()] = counts
    return places


if __name__ == "__main__":
    (DOCS / "names.md").write_text(page(), encoding="utf-8")
