"""The reference: one page for each part of the library, with all its public names, written from
what the library exports.
"""

from __future__ import annotations

import inspect
import sys
from pathlib import Path
from typing import Any

from docstrings import escaped, readable
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer

import liemech
from liemech.names import public, sentence

PARTS = {
    "simulation": ("Runs", "`integrate`, prepared runs, and what a run leaves behind."),
    "groups": (
        "Groups",
        "Lie groups, their algebras, actions, coadjoint orbits and Poisson structures.",
    ),
    "retractions": ("Retractions", "Maps from the algebra to the group."),
    "systems": ("Systems", "What moves: groups and energies, bodies in fields, equations."),
    "constraints": ("Constraints", "Systems that stay on g(q) = 0, and their methods."),
    "joints": ("Mechanisms", "Linkages, joints, and what acts on them."),
    "sites": ("Many sites", "Spins, bodies, points: terms over graphs."),
    "fields": ("Fields", "Fields g(s, t) on a group, in cells along a line."),
    "poisson": ("Poisson systems", "Structures that are no Lie algebra's, charts, methods."),
    "hamilton_jacobi": ("Hamilton-Jacobi methods", "Steps from generating functions."),
    "fictive_time": ("Time transformations", "Time scales, and steps in a fictive time."),
    "noise": ("Noise and damping", "White noise and dissipation on coadjoint orbits."),
    "stability": (
        "Steady motions and chaos",
        "Relative equilibria, their stability, Lyapunov exponents.",
    ),
    "at_work": ("Plans at work", "Steppers, commands, measured orders."),
    "derivatives": ("Derivatives", "Runs as functions of other packages."),
    "models": ("Models", "Systems that are ready: bodies, tops, pendulums, planets, lattices."),
    "integrators": ("Methods", "One step each; `integrate` owns the loop."),
    "tableaus": ("Tableaus", "Coefficients with names, sources and checks of their own."),
    "estimation": ("Estimation", "States, inertias and biases from measurements."),
    "checks": ("Checks", "Every law and every claim, on the classes you write."),
    "plots": ("Pictures", "Matplotlib axes; every function draws one thing."),
    "viewer": ("Viewer", "Moving pictures in the browser."),
    "formulas": (
        "Formulas",
        "What formulas are made of: vectors, matrices, functions, derivatives.",
    ),
    "errors": ("Errors", "All errors and warnings, in one tree."),
}
MODULES = ("estimation", "tableaus", "plots", "viewer", "errors")
"""Parts that are modules of their own: their names are `lm.plots.drift` and so on."""


INDEX = """API reference
=============

Every public name, by the part of the library that it belongs to.

.. toctree::
   :maxdepth: 1

"""


def names(part: str) -> list[str]:
    """The full names of what a part exports."""
    if part in MODULES:
        module = getattr(liemech, part)
        own = getattr(module, "__all__", None) or [
            name for name, x in vars(module).items() if _is_from(x, module)
        ]
        return [f"liemech.{part}.{name}" for name in own if not name.startswith("_")]
    full = [name.replace("lm", "liemech", 1) for name in public().values()]
    full += [f"liemech.neighbours.{name}" for name in liemech.neighbours.__all__]  # chain is two
    full = [*dict.fromkeys(full)]
    return [f for f in full if f.split(".")[1] not in (*MODULES, "formulas") and _part(f) == part]


def _is_from(thing: Any, module: Any) -> bool:
    return inspect.isclass(thing) and thing.__module__ == module.__name__


def _part(name: str) -> str:
    """The part in which what has this full name is defined; empty for a module."""
    thing = _thing(name)
    module = getattr(thing, "__module__", "") or ""
    if inspect.ismodule(thing):
        return ""
    first, _, rest = module.removeprefix("liemech.").partition(".")
    if not module.startswith("liemech."):
        return "formulas"
    return (
        "retractions"
        if module.endswith(".retractions")
        else rest.split(".")[0]
        if first == "rooms"
        else first
    )


def _thing(full: str) -> Any:
    path = full.split(".")[1:]
    thing: Any = liemech
    for name in path:
        thing = getattr(thing, name)
    return thing


def constants(part: str) -> dict[str, str]:
    """The texts under the constants of a part's files."""
    found: dict[str, str] = {}
    for module in [name for name in sys.modules if name.startswith(f"liemech.{part}.")]:
        docs = ModuleAnalyzer.for_module(module).find_attr_docs()
        found |= {
            name: "\n".join(lines).strip() for (scope, name), lines in docs.items() if not scope
        }
    return found


def row(full: str) -> list[str]:
    """A name and the first sentence about it."""
    about = sentence(_thing(full))
    stop = "" if about.endswith("?") else "."
    return [f"   * - :obj:`~{full}`", f"     - {escaped(about, None)}{stop}"]


def page(part: str) -> str:
    """One part: a table of its names, then each of them."""
    title, about = PARTS[part]
    everything = sorted(names(part), key=lambda full: full.rpartition(".")[2].lower())
    documented = [
        full
        for full in everything
        if inspect.isclass(_thing(full)) or inspect.isroutine(_thing(full))
    ]
    data = [full for full in everything if full not in documented]
    text = [title, "=" * len(title), "", about.replace("`", "``"), ""]
    text += [".. list-table::", "", *[line for full in documented for line in row(full)], ""]
    for full in documented:
        kind = "autoclass" if inspect.isclass(_thing(full)) else "autofunction"
        text += [f".. {kind}:: {full}", ""]
    if data:
        text += ["Constants", "---------", ""]
        texts = constants(part)
        for full in data:
            name, value = full.rpartition(".")[2], _thing(full)
            about = texts.get(name) or (
                f"``{value!r}`` {value.source}" if hasattr(value, "source") else ""
            )
            text += [
                f".. py:data:: {full}",
                "",
                *[f"   {line}" for line in readable(about.split("\n"), None)],
                "",
            ]
    return "\n".join(text)


def write(app: Sphinx) -> None:
    """The pages, where they have changed, and their index."""
    folder = Path(app.srcdir) / "generated" / "api"
    folder.mkdir(parents=True, exist_ok=True)
    parts = {_part(name.replace("lm", "liemech", 1)): name for name in public().values()}
    missing = parts.keys() - PARTS.keys() - {""}
    assert not missing, (
        f"parts of the library without a page: {[(part, parts[part]) for part in missing]}"
    )
    pages = {part: page(part) for part in PARTS} | {
        "index": INDEX + "".join(f"   {part}\n" for part in PARTS)
    }
    for name, text in pages.items():
        file = folder / f"{name}.rst"
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
