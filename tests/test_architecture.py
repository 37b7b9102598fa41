"""The shape of the library: which file may import which, what an import costs, what a public name owes its reader."""

from __future__ import annotations

import ast
import functools
import graphlib
import importlib
import inspect
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from sources import PACKAGE, nodes, trees

import liemech

CORE = (
    "names",  # the public ones, which are imported when they are asked for
    "errors",
    "formulas",
    "compiler",
    "solvers",  # Newton's method
    "groups",
    "tableaus",  # numbers and their laws, which know no mechanics
    "systems",
    "integrators",
    "simulation",
)
"""From the ground up: a module imports from its own layer and from those before it, never from those after it.  The
words of many sites belong to it: `formulas/sites.py`, `compiler/sites/`, `systems/many/`.
"""

ROOMS: dict[str, tuple[str, ...]] = {
    "rooms.constraints": (),
    "rooms.hamilton_jacobi": (),
    "rooms.poisson": (),
    "rooms.noise": (),
    "rooms.fictive_time": ("rooms.constraints",),
    "rooms.at_work": ("rooms.fictive_time",),
    "rooms.sites": ("rooms.hamilton_jacobi", "rooms.noise", "rooms.poisson"),
    "rooms.fields": ("rooms.sites",),
    "rooms.derivatives": ("rooms.fictive_time", "rooms.hamilton_jacobi", "rooms.sites"),
    "joints": ("rooms.constraints", "rooms.sites"),
    "rooms.stability": (),
    "rooms.files": ("joints", "rooms.fictive_time", "rooms.poisson", "rooms.sites"),
    "models": ("joints", "rooms.constraints", "rooms.fields", "rooms.noise", "rooms.poisson", "rooms.sites"),
    "estimation": ("rooms.constraints", "rooms.derivatives"),
    "checks": ("rooms.constraints", "rooms.fictive_time", "rooms.noise", "rooms.poisson", "rooms.sites"),
    "plots": ("joints", "models", "rooms.at_work", "rooms.constraints"),
    "viewer": ("joints", "models", "plots"),
    "rooms.published": ("joints", "models", "rooms.at_work", "rooms.constraints", "rooms.sites"),
    "command_line": ("checks", "plots", "rooms.at_work", "rooms.files", "rooms.published", "viewer"),
}
"""What stands on the core, each with the rooms that it imports; none imports another one."""

DOORS = {
    ("simulation.plan", "rooms.fictive_time"): "a plan of a method with a time scale makes runs in fictive time",
    ("simulation.plan", "rooms.derivatives"): "`plan.tangent` and `plan.gradient`",
    ("simulation.plan", "rooms.at_work"): "`plan.stepper`, `plan.export`, runs by executors",
    ("simulation.trajectory", "rooms.files"): "`run.save`, tables of xarray and pandas, `run.cite`",
    ("simulation.trajectory", "plots"): "`run.plot`",
    ("simulation.trajectory", "viewer"): "`run.view`",
    ("systems.system", "rooms.sites"): "`System.runs_in`: who runs the form of a system for many sites",
}
"""The modules of the core that open a room when they are asked for what it has: inside a function, or as a text that
names a module and a class.
"""

HOMES = {"llvmlite": "compiler", "numba": None, "matplotlib": "plots", "meshcat": "viewer"}
"""The one layer that may know an optional package; None: nobody."""

SOURCED = (
    *("groups", "integrators", "joints", "models", "estimation"),
    *("rooms.constraints", "rooms.fields", "rooms.hamilton_jacobi", "rooms.noise", "rooms.poisson", "rooms.stability"),
)
"""The parts made of other people's mathematics: a public docstring says where the formula stands in print."""

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
    def parts(self) -> tuple[str, str]:
        return part(self.module), part(self.target)


def part(module: str) -> str:
    """The layer of the core or the room that a module is of: liemech.rooms.noise.stochastic is of `rooms.noise`."""
    names = module.split(".")[1:]
    return ".".join(names[: 2 if names[:1] == ["rooms"] else 1])


def layer(module: str) -> str:
    """liemech.groups.rigid.so3 is of the layer `groups`, and so is the package itself; `liemech` is above all layers."""
    return module.partition(".")[2].partition(".")[0]


def parts(node: ast.AST) -> Iterator[ast.AST]:
    """What a statement consists of, without the expressions: no statement stands in these."""
    return (child for child in ast.iter_child_nodes(node) if not isinstance(child, ast.expr))


def asks_for_typing(statement: ast.AST) -> bool:
    """Is it an `if` of TYPE_CHECKING?"""
    return isinstance(statement, ast.If) and any(
        getattr(node, "id", getattr(node, "attr", "")) == "TYPE_CHECKING" for node in ast.walk(statement.test)
    )


def executed(node: ast.AST, lazy: bool = False) -> Iterator[tuple[ast.Import | ast.ImportFrom, bool]]:
    """The import statements that run, and whether only when some function is called; annotations do not count."""
    for child in parts(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child, lazy
        elif asks_for_typing(child):
            for other in child.orelse:
                yield from executed(ast.Module([other], []), lazy)
        else:
            yield from executed(child, lazy or isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef))


def for_typing(node: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """The import statements that only type checkers run."""
    for child in parts(node):
        if asks_for_typing(child):
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


def test_the_reader_of_imports_sees_through_every_spelling() -> None:
    inside = "from ...formulas import Vec\nfrom ..orbits import Orbit\nimport liemech.errors\nfrom liemech import formulas, SO3\n"
    found = [target for node in ast.parse(inside).body for target in targets("liemech.groups.rigid.so3", node)]
    assert found == ["liemech.formulas", "liemech.groups.orbits", "liemech.errors", "liemech.formulas", "liemech"]
    package = ast.parse("from .rigid.so3 import SO3\nfrom ..errors import LawViolation\n").body
    found = [target for node in package for target in targets("liemech.groups", node)]
    assert found == ["liemech.groups.rigid.so3", "liemech.errors"]
    hidden = "if TYPE_CHECKING:\n    import a\nelse:\n    import b\ndef f():\n    import c\nclass C:\n    import d\n"
    seen = [(statement.names[0].name, lazy) for statement, lazy in executed(ast.parse(hidden))]
    assert seen == [("b", False), ("c", True), ("d", False)]


# --- the direction of imports
# ------------------------------------------------------------------------------------


@functools.cache
def for_typing_inside() -> tuple[Import, ...]:
    return tuple(
        Import(module, statement.lineno, target, lazy=True)
        for module, tree in trees().items()
        if module != "liemech"
        for statement in for_typing(tree)
        for target in targets(module, statement)
        if target.partition(".")[0] == "liemech"
    )


@functools.cache
def named_in_texts() -> tuple[Import, ...]:
    """Modules in texts such as "rooms.sites.runs.plan:SitesOfPlan", but for those of `names`, which lists what moved."""
    return tuple(
        Import(module, node.lineno, target, lazy=True)
        for module in trees()
        if part(module) != "names"
        for node in nodes()[module]
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        if (text := re.fullmatch(r"([\w.]+):\w+", node.value))
        if (target := f"liemech.{text[1].removeprefix('liemech.')}") in trees()
    )


def is_a_door(one: Import) -> bool:
    return one.lazy and (one.module.removeprefix("liemech."), one.parts[1]) in DOORS


def within() -> list[Import]:
    """Imports between files of the library, also those for type checkers and by texts."""
    faces = ("liemech", "liemech.__main__")
    return [
        one for one in (*inside(), *for_typing_inside(), *named_in_texts()) if one.module not in faces and one.parts[1]
    ]


def test_every_module_belongs_to_the_core_or_to_a_room() -> None:
    known = {*CORE, *ROOMS, "", "__main__", "rooms"}
    complain(
        [module for module in trees() if part(module) not in known], "Modules of no layer in CORE and no room in ROOMS:"
    )


def test_imports_point_down_the_layers_of_the_core() -> None:
    height = {name: number for number, name in enumerate(CORE)}
    upward = [one for one in within() if {*one.parts} <= height.keys() and height[one.parts[0]] < height[one.parts[1]]]
    complain(upward, f"Imports that point up the layers {' < '.join(CORE)}:")


def test_the_core_imports_no_room_but_by_doors() -> None:
    entered = [one for one in within() if one.parts[0] in CORE and one.parts[1] in ROOMS]
    complain([one for one in entered if not is_a_door(one)], "Imports of rooms from the core:")
    assert {(one.module.removeprefix("liemech."), one.parts[1]) for one in entered} == DOORS.keys()
    assert len(DOORS) <= 7


def test_rooms_import_the_rooms_of_their_line() -> None:
    between = [one for one in within() if one.parts[0] in ROOMS and one.parts[1] in ROOMS and len({*one.parts}) == 2]
    complain(
        [one for one in between if one.parts[1] not in ROOMS[one.parts[0]]], "Imports that no line of ROOMS allows:"
    )
    for room, others in ROOMS.items():
        assert {one.parts[1] for one in between if one.parts[0] == room} == {*others}, f"the line of {room} names more"


@pytest.mark.parametrize("folder", [PACKAGE, *sorted({file.parent for file in PACKAGE.rglob("*.py")} - {PACKAGE})])
def test_a_folder_is_a_table_of_contents(folder: Path) -> None:
    entries = [path for path in folder.iterdir() if path.name != "__pycache__"]
    assert len(entries) <= (25 if folder == PACKAGE else 20)


@pytest.mark.parametrize("room", [*(name for name in ROOMS if name.startswith("rooms."))])
def test_a_room_begins_with_a_map_of_its_files(room: str) -> None:
    folder = PACKAGE.joinpath(*room.split("."))
    map_ = (ast.get_docstring(trees()[f"liemech.{room}"]) or "").replace("/", " ")
    names = [path.stem for path in folder.iterdir() if path.stem not in ("__init__", "__pycache__")]
    complain(
        [name for name in names if name not in re.findall(r"\w+", map_)], f"Files of {room} that its map leaves out:"
    )


def test_no_circles() -> None:
    graph: dict[str, set[str]] = {module: set() for module in trees()}
    for one in inside():
        if one.module != "liemech" and one.target != one.module and not is_a_door(one):
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
    """The top-level modules of a new process after the statements, without the standard library and liemech."""
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
        and part(thing.__module__) in SOURCED
        and name not in UNSOURCED
        and "Source:" not in (thing.__doc__ or "")
    ]
    complain(silent, "Public names of the mathematical layers without `Source:` (book or paper, equation):")


def test_modules_of_formulas_name_their_source() -> None:
    documented = ast.Module | ast.ClassDef | ast.FunctionDef
    silent = [
        module
        for module, tree in trees().items()
        if part(module) in SOURCED
        and not module.endswith((".plan", ".runs", ".input_checks"))  # which hold no mathematics
        and any(isinstance(node, ast.ClassDef | ast.FunctionDef) for node in tree.body)
        and not any("Source:" in (ast.get_docstring(n) or "") for n in nodes()[module] if isinstance(n, documented))
    ]
    complain(silent, "Modules of the mathematical layers that nowhere say `Source:`:")


OPENINGS = "What ", "Such ", "So many ", "The same "
"""Words with which a docstring says what a thing is like before it says what it is."""


def test_docstrings_say_what_things_are() -> None:
    documented = ast.Module | ast.ClassDef | ast.FunctionDef
    opening = [
        f"{module}, {getattr(node, 'name', 'module')}: {text.partition(chr(10))[0]}"
        for module in trees()
        for node in nodes()[module]
        if isinstance(node, documented)
        if (text := (ast.get_docstring(node, clean=False) or "").lstrip()).startswith(OPENINGS)
    ]
    complain(opening, f"Docstrings that open with {', '.join(OPENINGS)}:")


RESULTS = "liemech.simulation.result", "liemech.simulation.trajectory"


def test_trajectories_are_made_in_one_place() -> None:
    makers = {"Trajectory", "TangentTrajectory", "TransformedTrajectory", "run_of"}
    makers |= {"promised"}
    others = [
        f"{module}, line {node.lineno}"
        for module in trees()
        if module.startswith("liemech.simulation") and module not in RESULTS
        for node in nodes()[module]
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


@pytest.mark.compiled
def test_programs_within_texts_import_what_is_there() -> None:
    """Those of the gate, of pages and of tests, which no checker reads."""
    home = Path(__file__).parent.parent
    files = [home / ".ci/run", *home.glob("*.md"), *home.glob("docs/**/*.md"), *home.glob("tests/**/*.py")]
    wanted = {
        (file.relative_to(home), module, name.split()[0])
        for file in files
        for module, names in re.findall(r"\bfrom (liemech\.[\w.]+) import ([\w, ]+)", file.read_text(encoding="utf-8"))
        for name in names.split(",")
        if name.strip()
    }
    assert len(wanted) > 1000
    lost = [
        f"{file}: from {module} import {name}"
        for file, module, name in sorted(wanted)
        if f"{module}.{name}" not in trees()
        and (module not in trees() or not hasattr(importlib.import_module(module), name))
    ]
    complain(lost, "Imported by programs, and not there:")


def test_files_of_tests_have_names_of_their_own() -> None:
    """Two of one name cannot be collected together."""
    names = [path.name for path in Path(__file__).parent.rglob("test_*.py")]
    complain([name for name in names if names.count(name) > 1], "Files of tests of one name:")
