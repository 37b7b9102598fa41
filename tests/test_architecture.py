"""The shape of the library: which file may import which, what an import costs, what a public name
owes its reader.
"""

from __future__ import annotations

import ast
import functools
import graphlib
import inspect
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import liemech

PACKAGE = Path(liemech.__file__).parent

LAYERS = (
    "names",  # the public ones, which are imported when they are asked for
    "errors",
    "formulas",
    "compiler",
    "groups",
    "solvers",  # Newton's method
    "retractions",
    "tableaus",  # numbers and their laws, which know no mechanics
    "systems",
    "integrators",
    "models",
    "simulation",
    "estimation",
    "checks",
    "plots",
    "viewer",
    "command_line",
    "__main__",
    *("actions", "charts", "class_functions", "joints", "loops", "neighbours", "parts"),
    *("structures", "time_scales"),
)
"""From the ground up: a module imports from its own layer and from those before it, never from
those after it.
"""

DOORS = {("simulation", "plots"), ("simulation", "viewer")}
"""The exceptions: `run.plot_momentum()` opens a door upwards, inside the method, when it is called."""

ROOMS = (
    "reports",
    "compiled",
    "between",
    "",  # simulation/ itself: a run, from its options to its result
    "fictive_time",
    "sites",
    "derivatives",
    "at_work",
    "files",
)
"""The folders of simulation/, in the order of the layers: most of a run stands between what it is made of,
and what is made of it.
"""

INNER_DOORS = {
    ("plan", "fictive_time"),
    ("plan", "sites"),
    ("plan", "derivatives"),
    ("plan", "at_work"),
    ("plan", "files"),
    ("trajectory", "files"),
    ("trajectory", "sites"),
    ("sites.plan", "derivatives"),
}
"""The modules of simulation/ that open rooms above their own, inside a function: a plan makes runs of every
kind, a trajectory is saved and looked at.
"""

HOMES = {"llvmlite": "compiler", "numba": None, "matplotlib": "plots", "meshcat": "viewer"}
"""The one layer that may know an optional package; None: nobody."""

SOURCED = ("groups", "retractions", "models", "integrators", "estimation")
"""The layers made of other people's mathematics: a public docstring says where the formula stands
in print.
"""

UNSOURCED: frozenset[str] = frozenset()
"""Public names of those layers that hold nobody's formula."""


# --- reading the imports
# -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Import:
    """One import statement: which module, at which line, imports what, and when."""

    module: str
    line: int
    target: str
    lazy: bool

    def __str__(self) -> str:
        return f"{self.module}, line {self.line}: imports {self.target}"

    @property
    def layers(self) -> tuple[str, str]:
        return layer(self.module), layer(self.target)


def layer(module: str) -> str:
    """liemech.groups.so3 is of the layer `groups`, and so is the package itself; `liemech` is above
    all layers.
    """
    return module.partition(".")[2].partition(".")[0]


@functools.cache
def trees() -> dict[str, ast.Module]:
    """Every module of the library by its dotted name, parsed."""
    parsed = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        parts = ("liemech", *file.relative_to(PACKAGE).with_suffix("").parts)
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        parsed[name] = ast.parse(file.read_text(encoding="utf-8"), filename=str(file))
    return parsed


def parts(node: ast.AST) -> Iterator[ast.AST]:
    """What a statement consists of, without the expressions: no statement stands in these."""
    return (child for child in ast.iter_child_nodes(node) if not isinstance(child, ast.expr))


def executed(node: ast.AST, lazy: bool = False) -> Iterator[tuple[ast.Import | ast.ImportFrom, bool]]:
    """The import statements that run, and whether only when some function is called; annotations do
    not count.
    """
    for child in parts(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child, lazy
        elif isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
            for other in child.orelse:
                yield from executed(ast.Module([other], []), lazy)
        else:
            yield from executed(child, lazy or isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef))


def for_typing(node: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """The import statements that only type checkers run."""
    for child in parts(node):
        if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
            yield from (s for part in child.body for s, _ in executed(ast.Module([part], [])))
        yield from for_typing(child)


def targets(module: str, statement: ast.Import | ast.ImportFrom) -> Iterator[str]:
    """The modules that one statement imports, by dotted name."""
    if isinstance(statement, ast.Import):
        yield from (alias.name for alias in statement.names)
        return
    base = statement.module or ""
    if statement.level:
        is_package = (PACKAGE.parent / Path(*module.split(".")) / "__init__.py").exists()
        above = module.split(".")[: (is_package - statement.level) or None]
        base = ".".join([*above, base] if base else above)
    for alias in statement.names:
        yield f"{base}.{alias.name}" if f"{base}.{alias.name}" in trees() else base


@functools.cache
def imports() -> tuple[Import, ...]:
    return tuple(
        Import(module, statement.lineno, target, lazy)
        for module, tree in trees().items()
        for statement, lazy in executed(tree)
        for target in targets(module, statement)
    )


def inside() -> list[Import]:
    return [one for one in imports() if one.target.partition(".")[0] == "liemech"]


def outside() -> list[Import]:
    known = sys.stdlib_module_names | {"liemech", "__future__"}
    return [one for one in imports() if one.target.partition(".")[0] not in known]


def complain(offenders: list[object], law: str) -> None:
    assert not offenders, "\n".join([law, *map(str, offenders)])


@pytest.mark.slow
def test_the_reader_of_imports_sees_through_every_spelling() -> None:
    inside = (
        "from ..formulas import Vec\nfrom .ad import hat\nimport liemech.errors\nfrom liemech import formulas, SO3\n"
    )
    found = [target for node in ast.parse(inside).body for target in targets("liemech.groups.so3", node)]
    assert found == ["liemech.formulas", "liemech.groups.ad", "liemech.errors", "liemech.formulas", "liemech"]
    package = ast.parse("from .so3 import SO3\nfrom ..errors import LawViolation\n").body
    found = [target for node in package for target in targets("liemech.groups", node)]
    assert found == ["liemech.groups.so3", "liemech.errors"]
    hidden = "if TYPE_CHECKING:\n    import a\nelse:\n    import b\ndef f():\n    import c\nclass C:\n    import d\n"
    seen = [(statement.names[0].name, lazy) for statement, lazy in executed(ast.parse(hidden))]
    assert seen == [("b", False), ("c", True), ("d", False)]


# --- the direction of imports
# ------------------------------------------------------------------------------------


def test_every_module_belongs_to_a_layer() -> None:
    strangers = [module for module in trees() if module != "liemech" and layer(module) not in LAYERS]
    complain(strangers, "Modules that no layer knows; add a layer to LAYERS, in its place:")


def test_imports_point_down_the_layers() -> None:
    height = {name: number for number, name in enumerate(LAYERS)} | {"": len(LAYERS)}
    upward = [
        one
        for one in inside()
        if one.module != "liemech"
        and height.get(one.layers[0], -1) < height.get(one.layers[1], -1)
        and not (one.lazy and one.layers in DOORS)
        and one.layers != ("command_line", "")
    ]
    complain(upward, f"Imports that point up the layers {' < '.join(LAYERS)}:")


def test_imports_for_typing_point_down_too() -> None:
    """A layer that names what stands above it, if only in an annotation, cannot be read without it."""
    height = {name: number for number, name in enumerate(LAYERS)} | {"": len(LAYERS)}
    named = [
        Import(module, statement.lineno, target, lazy=True)
        for module, tree in trees().items()
        if module != "liemech"
        for statement in for_typing(tree)
        for target in targets(module, statement)
        if target.partition(".")[0] == "liemech"
    ]
    assert named
    upward = [
        one
        for one in named
        if height.get(one.layers[0], -1) < height.get(one.layers[1], -1) and one.layers not in DOORS
    ]
    complain(upward, f"Imports for typing that point up the layers {' < '.join(LAYERS)}:")


def room(module: str) -> tuple[str, str]:
    """A module of simulation/ by its name there, and the room that it is in."""
    name = module.removeprefix("liemech.simulation").removeprefix(".")
    first = name.partition(".")[0]
    folder = (PACKAGE / "simulation" / first).is_dir()
    return name, first if folder else ""


def opens_a_room(one: Import) -> bool:
    """Is this one of the INNER_DOORS?"""
    inside = all(x.startswith("liemech.simulation.") for x in (one.module, one.target))
    return inside and one.lazy and (room(one.module)[0], room(one.target)[1]) in INNER_DOORS


def test_imports_between_the_rooms_of_simulation_go_one_way() -> None:
    prefix = "liemech.simulation."
    within = [x for x in inside() if x.module.startswith(prefix) and x.target.startswith(prefix)]
    upward = [
        one
        for one in within
        if ROOMS.index(room(one.module)[1]) < ROOMS.index(room(one.target)[1]) and not opens_a_room(one)
    ]
    complain(upward, "Imports that point up the rooms of simulation/:")
    opened = {(room(x.module)[0], room(x.target)[1]) for x in within if opens_a_room(x)}
    assert opened == INNER_DOORS


def test_no_circles() -> None:
    graph: dict[str, set[str]] = {module: set() for module in trees()}
    for one in inside():
        if (
            one.module != "liemech"
            and one.target != one.module
            and not (one.lazy and one.layers in DOORS)
            and not opens_a_room(one)
        ):
            graph[one.module].add(one.target)
    try:
        tuple(graphlib.TopologicalSorter(graph).static_order())
    except graphlib.CycleError as circle:
        pytest.fail("Modules that import each other in a circle: " + " <- ".join(circle.args[1]))


# --- other people's packages
# -------------------------------------------------------------------------------------


def test_each_optional_package_has_one_home() -> None:
    strays = [
        one for one in outside() if HOMES.get(one.target.partition(".")[0], layer(one.module)) != layer(one.module)
    ]
    complain(strays, f"Packages imported away from home, which is {HOMES}:")


def test_only_numpy_is_imported_before_it_is_needed() -> None:
    eager = [
        one
        for one in outside()
        if not one.lazy and (top := one.target.partition(".")[0]) != "numpy" and HOMES.get(top) != layer(one.module)
    ]
    complain(eager, "Packages imported with the module; import them in the function that needs them:")


def loaded_by(statements: str) -> set[str]:
    """The top-level modules of a new process after the statements, without the standard library and
    liemech.
    """
    code = f"{statements}\nimport json, sys; print(json.dumps(sorted(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    names = {name.partition(".")[0] for name in json.loads(run.stdout.splitlines()[-1])}
    return names - sys.stdlib_module_names - {"liemech", "__main__", "__mp_main__"}


def test_import_loads_numpy_and_nothing_else() -> None:
    assert loaded_by("import liemech") <= loaded_by("import numpy")


@pytest.mark.slow
def test_naming_groups_systems_and_methods_loads_numpy_and_nothing_else() -> None:
    names = [name for name in ("SO3", "Cayley", "RigidBody", "RKMK", "integrate") if name in liemech.__all__]
    assert loaded_by(f"import liemech; [getattr(liemech, name) for name in {names}]") <= loaded_by("import numpy")


# --- what a public name owes
# -------------------------------------------------------------------------------------


def test_the_package_is_typed() -> None:
    assert (PACKAGE / "py.typed").exists()


def test_public_names_are_unique() -> None:
    assert len(set(liemech.__all__)) == len(liemech.__all__)


def test_public_names_exist_and_are_documented() -> None:
    names = [name for name in liemech.__all__ if not name.startswith("__")]
    complain([name for name in names if name not in dir(liemech)], "Public names that are not there:")
    kinds = inspect.isclass, inspect.isroutine, inspect.ismodule
    things = {name: getattr(liemech, name) for name in names}
    silent = [name for name, it in things.items() if any(kind(it) for kind in kinds) and not (it.__doc__ or "").strip()]
    complain(silent, "Public names without a docstring of their own:")


def test_public_formulas_name_their_source() -> None:
    silent = [
        f"{thing.__module__}.{name}"
        for name in liemech.__all__
        if (inspect.isclass(thing := getattr(liemech, name)) or inspect.isroutine(thing))
        and layer(thing.__module__) in SOURCED
        and name not in UNSOURCED
        and "Source:" not in (thing.__doc__ or "")
    ]
    complain(silent, "Public names of the mathematical layers without `Source:` (book or paper, equation):")


def test_modules_of_formulas_name_their_source() -> None:
    documented = ast.Module | ast.ClassDef | ast.FunctionDef
    silent = [
        module
        for module, tree in trees().items()
        if layer(module) in SOURCED
        and any(isinstance(node, ast.ClassDef | ast.FunctionDef) for node in tree.body)
        and not any("Source:" in (ast.get_docstring(n) or "") for n in ast.walk(tree) if isinstance(n, documented))
    ]
    complain(silent, "Modules of the mathematical layers that nowhere say `Source:`:")


OPENINGS = "What ", "Such ", "So many ", "The same "
"""Words with which a docstring says what a thing is like before it says what it is."""


def test_docstrings_say_what_things_are() -> None:
    documented = ast.Module | ast.ClassDef | ast.FunctionDef
    opening = [
        f"{module}, {getattr(node, 'name', 'module')}: {text.partition(chr(10))[0]}"
        for module, tree in trees().items()
        for node in ast.walk(tree)
        if isinstance(node, documented) and (text := ast.get_docstring(node) or "").startswith(OPENINGS)
    ]
    complain(opening, f"Docstrings that open with {', '.join(OPENINGS)}:")


RESULTS = "liemech.simulation.result", "liemech.simulation.trajectory"


def test_trajectories_are_made_in_one_place() -> None:
    makers = {"Trajectory", "TangentTrajectory", "TransformedTrajectory", "run_of"}
    makers |= {"promised"}
    others = [
        f"{module}, line {node.lineno}"
        for module, tree in trees().items()
        if module.startswith("liemech.simulation") and module not in RESULTS
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and str(getattr(node.func, "attr", getattr(node.func, "id", ""))) in makers
    ]
    complain(others, "Trajectories that are not made by simulation/result.py:")


def test_the_page_for_contributors_names_what_is_there() -> None:
    home = Path(__file__).parent.parent
    page = (home / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = re.findall(r"`((?:\w+/)+[\w.]*)`", page)
    assert len(named) > 40
    roots = home, home / "liemech"
    complain([path for path in named if not any((root / path).exists() for root in roots)], "Named, and not there:")


def test_files_of_tests_have_names_of_their_own() -> None:
    """Two of one name cannot be collected together."""
    names = [path.name for path in Path(__file__).parent.rglob("test_*.py")]
    complain([name for name in names if names.count(name) > 1], "Files of tests of one name:")
