"""`liemech scenes` and `liemech methods`: what there is."""

from __future__ import annotations

import inspect
import json
import math
import shutil
import textwrap
from collections.abc import Sequence
from typing import Any

import liemech as lm

from ..names import everything, sentence
from .constructors import names
from .options import Parser
from .scenes import SCENES

EXAMPLES = {
    "Composition": "Composition(CovariantVariational(), order=4)",
    "IndexReduction": "IndexReduction(RKMK(order=4))",
    "ReversibleController": "ReversibleController(StormerVerlet(), EqualArc())",
}
"""Examples of methods that need another one."""


def scenes(arguments: Sequence[str]) -> int:
    """The command `liemech scenes`.  Returns the exit status, 0."""
    as_json = _as_json(arguments, "scenes", "List the scenes for `liemech run`.")
    rows = []
    for name, function in SCENES.items():
        scene = function()
        row = {
            "scene": name,
            "about": sentence(function),
            "system": type(scene.system).__name__,
            "method": repr(scene.method),
        }
        rows.append(row)
    width = max(map(len, SCENES)) + 2
    print(json.dumps(rows) if as_json else "\n".join(_row(f"{r['scene']:<{width}}", r["about"]) for r in rows))
    return 0


def methods(arguments: Sequence[str]) -> int:
    """The command `liemech methods`.  Returns the exit status, 0."""
    rows = method_rows()
    if _as_json(arguments, "methods", "List the methods: order, whether symmetric and symplectic."):
        print(json.dumps(rows))
        return 0
    lines = [f"{'method':<26}{'order':<7}{'symmetric':<11}{'symplectic':<12}what it is"]
    for r in rows:
        order = "exact" if r["order"] is None else str(r["order"])
        marks = ("yes" if r[claim] else "-" for claim in ("symmetric", "symplectic"))
        symmetric, symplectic = marks
        columns = f"{r['method']:<26}{order:<7}{symmetric:<11}{symplectic:<12}"
        lines.append(_row(columns, r["about"]))
    lines.append("The order is that of the default; most take another as order=...; docs/methods.md says which to use.")
    print("\n".join(lines))
    return 0


def method_rows() -> list[dict[str, Any]]:
    """Name, order (None if exact), symmetric, symplectic and a sentence for every public method
    that can be made without a run.
    """
    from .constructors import read

    rows = []
    for name in names(lm.Method):
        cls = everything()[name]
        required = [p for p in inspect.signature(cls).parameters.values() if p.default is p.empty]
        if required and name not in EXAMPLES:
            continue  # made from a body and a step, such as ExactMoserVeselov
        method = read(EXAMPLES.get(name, name), lm.Method, name)
        order = None if math.isinf(method.order) else method.order
        rows.append(
            {"method": name, "order": order, "symmetric": bool(method.symmetric), "symplectic": bool(method.symplectic)}
            | {"about": sentence(cls)}
        )
    return rows


def _row(columns: str, about: str) -> str:
    """A row whose last column goes on below itself, as wide as the terminal."""
    width = max(shutil.get_terminal_size().columns, len(columns) + 40)
    return textwrap.fill(columns + about, width, subsequent_indent=" " * len(columns))


def _as_json(arguments: Sequence[str], name: str, description: str) -> bool:
    parser = Parser(prog=f"liemech {name}", description=description)
    parser.add_argument("--json", action="store_true", help="as JSON")
    return bool(parser.parse_args(arguments).json)
